"""What vehicles are commanded instead of a law's setpoints once these can't be computed, until they loiter."""

from __future__ import annotations

import math

from flight_model.autopilot_model import AutopilotModel, within
from flight_model.slot import UNKNOWN, Vector3, all_finite
from gcs_formation.control.finite import is_finite
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.guidance.path_ahead import AHEAD_M


class StraightOn:
    """Lets all vehicles fly on at the leader's last speed and heading, so side by side; hovering ones stop.

    They keep their heights; the vertical separation at the end of a flight then gives each one of its own.
    """

    def __init__(self, models: list[AutopilotModel], *, hovers: bool) -> None:
        """Take the (C,) models of all vehicles."""
        self._models, self._hovers = models, hovers
        self._speed_mps = self._heading_rad = 0.0
        self._begun = False

    def known(self, measured: MeasuredStates, leader: int, last: Vector3) -> MeasuredStates:
        """Return the measured states, with others in place of those that aren't finite, which become inactive.

        `last`: the leader's last setpoint, if that is finite; otherwise its own motion is continued.
        """
        indices = range(len(measured.states))
        active = [measured.active[index] and is_finite(measured.states[index]) for index in indices]
        known = [index for index in indices if active[index]]
        if not known:
            return MeasuredStates(measured.states, measured.stamps, active, measured.acts)
        if not self._begun:
            state = measured.states[leader if active[leader] else known[0]]
            speed_mps, heading_rad, _ = last if all_finite(last) else (state.airspeed_mps, state.heading_rad, 0.0)
            self._speed_mps, self._heading_rad, self._begun = speed_mps, heading_rad, True
        states = [measured.states[index if is_finite(measured.states[index]) else known[0]] for index in indices]
        return MeasuredStates(states, measured.stamps, active, measured.acts)

    def ahead_m(self, seconds: float) -> list[tuple[float, float]]:
        """Return the path ahead within some time: points north and east of here, m, from here."""
        steps = 0 if self._hovers else math.ceil(self._speed_mps * seconds / AHEAD_M)
        north, east = math.cos(self._heading_rad), math.sin(self._heading_rad)
        return [(AHEAD_M * step * north, AHEAD_M * step * east) for step in range(1 + steps)]

    def setpoints(self, known: MeasuredStates) -> list[Vector3]:
        """Return the setpoints of a tick, NaN for inactive vehicles: airspeed, heading and height."""
        setpoints = [UNKNOWN] * len(self._models)
        for index, model in enumerate(self._models):
            if known.active[index]:
                speed_mps = within(self._speed_mps, model.speed_min_mps, model.speed_max_mps)
                height_m = known.states[index].height_m
                setpoints[index] = 0.0 if self._hovers else speed_mps, self._heading_rad, height_m
        return setpoints
