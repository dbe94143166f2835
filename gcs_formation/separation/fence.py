"""The fence in flight: setpoints that would lead out of it are held inside."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array, Indices, Mask, within, wrap
from flight_model.autopilot_model import AutopilotModel
from flight_model.fence_geometry import CHECKED_M, inside_m, room_m
from flight_model.vehicle_arrays import FlightStates
from formation_scenario import Scenario
from formation_scenario.slot_assignment import column_ids
from formation_scenario.surroundings import Fence
from gcs_formation.recorder import Event, Tick

HELD_M = 10.0
"""Room beyond a turn away from the fence below which a vehicle is turned away."""
TURN_RAD = np.pi / 2
"""How far beside its heading a vehicle is commanded to head that is turned away: more than its tightest turn takes."""
STEP_M = 1.0
HEADING, HEIGHT = 1, 2
"""Channels of a setpoint."""


class FenceLimits:
    """Holds setpoints inside the fence, tick by tick: after the law, before the separation rule and the ground's floor.

    A vehicle is turned away when it is about to have no room for a circle inside, to either side; until then the law
    may do as it likes. Where there is no such circle any more, it heads for the inside the shorter way.
    """

    def __init__(self, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Take the scenario's fence; the (C,) `models` have the turn rates."""
        self._fenced, self._fence = scenario.safety.fence is not None, scenario.safety.fence or Fence()
        self._corners_m = np.array(self._fence.corners_m or np.zeros((0, 2)))
        self._identities = column_ids(scenario)
        self._real = np.array([each is not None for each in self._identities])
        self._turn_rps = np.array([model.turn_rate_max_rps for model in models])
        self._side = np.zeros(self._real.size)
        """-1, 1: to which side a column is being turned away."""
        self._at_limit: Mask = np.zeros((2, self._real.size), dtype=bool)

    def keep(self, tick: Tick) -> None:
        """Put setpoints inside in the place of a tick's that aren't."""
        if not self._fenced:
            return
        active: Mask = tick.active & self._real
        self._limit_heights(tick, active)
        if self._corners_m.size:
            self._turn_away(tick, active)

    def _limit_heights(self, tick: Tick, active: Mask) -> None:
        least_m, most_m = self._fence.heights_m
        beyond: Mask = np.zeros((2, active.size), dtype=bool)
        for column in np.flatnonzero(active).tolist():
            speed_mps, heading_rad, height_m = tick.setpoints[column]
            beyond[:, column] = height_m < least_m, height_m > most_m
            if height_m < least_m or height_m > most_m:
                tick.replace(column, (speed_mps, heading_rad, min(max(height_m, least_m), most_m)))
        for row, column in np.argwhere(beyond != self._at_limit).tolist():
            limit_m, begins = (least_m, most_m)[row], bool(beyond[row, column])
            text = f"height held at {limit_m:g} m" if begins else f"height no longer held at {limit_m:g} m"
            self._report(tick, column, text, begins=begins)
        self._at_limit = beyond

    def _turn_away(self, tick: Tick, active: Mask) -> None:
        if not active.any():
            return
        which = np.flatnonzero(active)
        state = FlightStates.from_each(tick.state[column] for column in which.tolist())
        place, velocity = np.stack((state.north_m, state.east_m), axis=-1), state.ground_mps.T
        through_air = state.airspeed_mps + np.hypot(state.wind_north_mps, state.wind_east_mps)
        room = room_m(self._corners_m, place, velocity, through_air, self._turn_rps[which])
        before = self._side[which]
        held = room.max(axis=1) < np.where(before != 0.0, CHECKED_M, HELD_M)
        widest = np.where(room[:, 1] >= room[:, 0], 1.0, -1.0)
        same = np.where(before > 0.0, room[:, 1], room[:, 0]) >= 0.0
        side = np.where(held, np.where((before != 0.0) & same, before, widest), 0.0)
        aside_rad = side * TURN_RAD
        lost = held & (room.max(axis=1) < 0.0)
        if lost.any():
            off_rad = wrap(self._inward_rad(place[lost]) - state.heading_rad[lost])
            aside_rad[lost] = within(off_rad, -TURN_RAD, TURN_RAD)
        turned: list[int] = which[held].tolist()
        headings_rad: list[float] = (state.heading_rad + aside_rad)[held].tolist()
        for column, heading_rad in zip(turned, headings_rad, strict=True):
            speed_mps, _, height_m = tick.setpoints[column]
            tick.replace(column, (speed_mps, heading_rad, height_m))
        self._note(tick, which, side, inside_m(self._corners_m, place))

    def _inward_rad(self, place: Array) -> Array:
        """Return the heading towards the inside from places (F, 2): where the distance to the edge grows most."""
        steps = STEP_M * np.eye(2)
        rise = [inside_m(self._corners_m, place + step) - inside_m(self._corners_m, place - step) for step in steps]
        return np.arctan2(rise[1], rise[0])

    def _note(self, tick: Tick, which: Indices, side: Array, inside: Array) -> None:
        sides = np.zeros(self._side.size)
        sides[which] = side
        distance_m = dict(zip(which.tolist(), inside.tolist(), strict=True))
        for column in np.flatnonzero((sides != 0.0) != (self._side != 0.0)).tolist():
            begins = bool(sides[column])
            text = f"turned away, {distance_m[column]:.0f} m inside" if begins else "no longer turned away"
            self._report(tick, column, text, begins=begins)
        self._side = sides

    def _report(self, tick: Tick, column: int, text: str, *, begins: bool) -> None:
        tick.events.append(Event(tick.now, "fence", text, self._identities[column], {"begins": begins}))
