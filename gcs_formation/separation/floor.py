"""The ground in flight: no height is sent that would take a vehicle nearer to it than the scenario's clearance."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import Instant, seconds_between
from flight_model.autopilot_model import AutopilotModel, FlightState
from formation_scenario import Scenario
from formation_scenario.slot_assignment import column_ids
from gcs_formation.recorder import Event, Tick

SHARES: Final = np.array([0.25, 0.5, 0.75, 1.0])
"""Of the way to where a height setpoint is reached, at which the ground is looked at."""
AROUND_M: Final = 500.0
"""How far around a vehicle the highest ground is looked for, once until it has flown as far."""
OVER_S: Final = 2.0
"""A height that hasn't been held for so long isn't held any more: nobody is told of every tick at the limit."""
HEIGHT: Final = 2
"""Channel of a setpoint."""


class HeightFloor:
    """Holds heights at `safety.clearance_m` above the ground, tick by tick. The last to change them, after the fence.

    A height setpoint is where a vehicle is when its height's lags have passed: the straight way from where it is to
    there is kept clear, so that one that descends with the ground may be told lower than the ground below it. Nobody is
    asked to climb faster than it can. Where the ground isn't known, there is no floor.
    """

    def __init__(self, scenario: Scenario, models: list[AutopilotModel]) -> None:
        """Take the scenario's ground; the (C,) `models` have the lags of heights."""
        self._ground, self._level = scenario.ground, scenario.terrain is None
        self._clearance_m: float = scenario.safety.clearance_m
        self._models, self._identities = models, column_ids(scenario)
        self._first = 0 if self._identities[0] is not None else 1
        """The first column that is a vehicle."""
        self._known: list[tuple[float, float, float]] = [(math.nan, math.nan, math.nan)] * len(models)
        """Where each looked around last, north and east, and the height that is clear of all ground there."""
        self._held: list[Instant | None] = [None] * len(models)
        """When each was held last, of those that are."""

    def keep(self, tick: Tick) -> None:
        """Put heights clear of the ground in the place of a tick's that aren't."""
        for column in range(self._first, len(self._models)):
            height_m = tick.setpoints[column][HEIGHT]
            if tick.active[column] and height_m < self._clear_m(column, tick.state[column]):
                least_m = self._least_m(tick.state[column], height_m, self._models[column])
                if height_m < least_m:
                    speed_mps, heading_rad, _ = tick.setpoints[column]
                    tick.replace(column, (speed_mps, heading_rad, least_m))
                    self._begin(tick, column, least_m)
            if self._held[column] is not None:
                self._end(tick, column)

    def _clear_m(self, column: int, state: FlightState) -> float:
        """Return a height that is clear of all ground that a vehicle may be over soon."""
        if self._level:
            return self._clearance_m
        north_m, east_m, clear_m = self._known[column]
        model, (north_mps, east_mps) = self._models[column], state.ground_mps()
        ahead_m = _lag_s(model) * math.hypot(north_mps, east_mps)
        if not math.hypot(state.north_m - north_m, state.east_m - east_m) + ahead_m <= AROUND_M:
            place = np.array([state.north_m]), np.array([state.east_m])
            clear_m = float(self._ground.bound_m(*place, max(AROUND_M, 2.0 * ahead_m))[0]) + self._clearance_m
            self._known[column] = state.north_m, state.east_m, clear_m
        return clear_m

    def _least_m(self, state: FlightState, height_m: float, model: AutopilotModel) -> float:
        """Return the least height setpoint, from `height_m` on, on the way to which the ground is clear."""
        lag_s, (north_mps, east_mps) = _lag_s(model), state.ground_mps()
        over_s = lag_s * SHARES
        ground_m = self._ground.height(state.north_m + over_s * north_mps, state.east_m + over_s * east_mps)
        floor_m = np.nan_to_num(ground_m + self._clearance_m, nan=-math.inf)
        needed_m = state.height_m + (floor_m - state.height_m) / SHARES
        least_m = min(float(needed_m.max()), float(floor_m.max()), state.height_m + lag_s * model.climb_max_mps)
        return max(height_m, least_m)

    def _begin(self, tick: Tick, column: int, least_m: float) -> None:
        if self._held[column] is None:
            text = f"height held at {least_m:.0f} m, {self._clearance_m:g} m above the ground"
            tick.events.append(Event(tick.now, "fence", text, self._identities[column], {"begins": True}))
        self._held[column] = tick.now

    def _end(self, tick: Tick, column: int) -> None:
        since = self._held[column]
        if since is not None and seconds_between(since, tick.now) > OVER_S:
            self._held[column] = None
            text = "height no longer held above the ground"
            tick.events.append(Event(tick.now, "fence", text, self._identities[column], {"begins": False}))


def _lag_s(model: AutopilotModel) -> float:
    """Return by how much a height lags behind its setpoint on a climb, s."""
    return model.tau_ha_s + model.tau_hb_s
