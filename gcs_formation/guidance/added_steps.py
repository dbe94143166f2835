"""Steps added to the leader's setpoints, so that its vehicles can be identified: the guidance doesn't act on them.

A loop that were shown what a step does would take it for a disturbance: within seconds it would turn the leader back,
and afterwards turn it as far to the other side. So the guidance steers the leader as it would fly without steps, its
heading less the response to them by model (7), and its position less the lateral distance that this has led to. Once
the steps and the response to them are over, the guidance leads the leader back over what distance is left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from flight_model.autopilot_model import AutopilotModel, remaining
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.formation import Step, added

OVER_RAD: Final = math.radians(0.5)
"""A response smaller than this is over. Tuned: rad; 0.2 to 1 degree; shown by `pytest tests/gcs_formation/guidance`."""


class AddedSteps:
    """The steps of a scenario, and what the leader has done by them so far."""

    def __init__(self, steps: Sequence[Step], dt_s: float) -> None:
        """Take the steps, and the time between ticks."""
        self._steps, self._dt_s = steps, dt_s
        self._turned_rad = self._right_m = 0.0

    def drop_state(self) -> None:
        """Reset: something else than the stepped setpoint is flown, or another vehicle leads."""
        self._turned_rad = self._right_m = 0.0

    def without(self, state: FlightState) -> FlightState:
        """Return the leader's state as it would be without the steps of heading."""
        if self._turned_rad == 0.0:
            return state
        as_steered = state.copy()
        as_steered.heading_rad -= self._turned_rad
        as_steered.north_m += self._right_m * math.sin(as_steered.heading_rad)
        as_steered.east_m -= self._right_m * math.cos(as_steered.heading_rad)
        return as_steered

    def add(self, wanted: Setpoint, mission_time_s: float, state: FlightState, model: AutopilotModel) -> None:
        """Add the steps of a mission time to a tick's setpoint, and advance the response to them by a tick.

        Args:
            wanted: is changed.
            mission_time_s: NaN before the path, where there are no steps.
            state: the leader's when the setpoint acts.
            model: of its autopilot.
        """
        speed_mps, heading_rad, height_m = added(self._steps, mission_time_s)
        wanted.speed_mps += speed_mps
        wanted.heading_rad += heading_rad
        wanted.height_m += height_m
        before_rad, off_rad = self._turned_rad, heading_rad - self._turned_rad
        left = model.decay(self._dt_s).heading
        left_rad = remaining(off_rad, self._dt_s, model.tau_psi_s, model.turn_rate_max_rps, left)
        self._turned_rad = heading_rad - left_rad
        if heading_rad == 0.0 and abs(self._turned_rad) < OVER_RAD:
            self.drop_state()
            return
        self._right_m += state.airspeed_mps * math.sin((before_rad + self._turned_rad) / 2.0) * self._dt_s
