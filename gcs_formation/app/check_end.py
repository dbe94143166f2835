"""What `check` says of a flight's planned end: the climb to circles, and the ground that comes before that."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from flight_model.autopilot import AutopilotModel, FlightState, advance
from formation_scenario import Scenario, slot_schedule
from formation_scenario.begin_and_end import planned_end_m
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.guidance.leader import points_ahead
from gcs_formation.mission.opening import Stack, stacked
from gcs_formation.parameters import autopilot_models
from gcs_formation.vehicle.telemetry import Motion

STEP_S = 0.5
SHORT_M = 0.5
"""A lack of clearance that isn't worth a warning."""


def final_circles(scenario: Scenario) -> Iterator[str]:
    """Yield which ground the vehicles' last circles are lifted for, and where they come too near to it before.

    And how far above the fence they are: one above the other, many vehicles need much height.
    """
    terrain, fence = scenario.terrain, scenario.safety.fence
    if terrain is None and fence is None:
        return
    climb = _Climb(scenario, -math.inf if terrain is None else terrain.clearance_m)
    if terrain is not None:
        yield from climb.warnings()
    if fence is not None:
        yield from climb.beyond(fence.heights_m[1])


class _Climb:
    """The climb of all vehicles to their circles, straight on from where the flight is planned to end."""

    def __init__(self, scenario: Scenario, clearance_m: float) -> None:
        self._path, self._speed_mps = scenario.leader_path, scenario.path.speed_mps
        self._end_m = planned_end_m(scenario)
        self._ground, self._floor, self._clearance_m = scenario.ground, GroundFloor(scenario), clearance_m
        first = 1 if scenario.leader is None else 0
        self._models = autopilot_models(scenario)[first:]
        self._slots_m = slot_schedule(scenario)[-1].places_m[first:]
        self._end = self._path.at(self._end_m)
        north_m, east_m = self._places(np.zeros(1))
        lowest_m = self._ground.height(north_m, east_m)[:, 0] + clearance_m  # slots are lifted that far
        up_m = np.fmax(self._end.height_m + self._slots_m[:, 2], lowest_m).tolist()
        each = zip(north_m[:, 0].tolist(), east_m[:, 0].tolist(), up_m, strict=True)
        climb_mps = self._end.slope * self._speed_mps
        self._begin = {VehicleId(1, at): Motion(0.0, *place, 0.0, 0.0, climb_mps, 0.0) for at, place in enumerate(each)}
        self._stack = Stack(scenario.safety.avoidance.distance_m, stand=scenario.hovers)
        climb_mps = min(model.climb_max_mps for model in self._models)
        self._limit_s = stacked(self._begin, self._stack, self._floor, "loiter", self._ahead, climb_mps)
        self._stack.add(self._begin)

    def warnings(self) -> Iterator[str]:
        where, height_m = f"path at {self._end_m:.0f} m, the flight's end", self._end.height_m
        begins = [
            (place.north_m + north_m, place.east_m + east_m)
            for place in self._begin.values()
            for north_m, east_m in self._ahead(self._limit_s)
        ]
        top = self._floor.highest(begins)
        if top.height_m > height_m:
            yield (
                f"{where}: vehicles circle {top.height_m - height_m:.1f} m above it, at "
                f"{top.height_m:.0f} m and higher, for the ground at north {top.north_m:.0f}, east {top.east_m:.0f}"
            )
        unknown = next((place for begin in begins if (place := self._floor.unknown(*begin)) is not None), None)
        if unknown is not None:
            north_m, east_m = unknown
            yield (
                f"{where}: found no elevation at north {north_m:.0f}, east {east_m:.0f}, below "
                "the vehicles' circles or their way there; the ground there isn't kept clear of"
            )
        yield from self._too_low()

    def beyond(self, most_m: float) -> Iterator[str]:
        """Yield by how much the highest circle is above `most_m`."""
        highest_m = max(self._stack.heights_m.values())
        if highest_m > most_m + SHORT_M:
            yield (
                f"path at {self._end_m:.0f} m, the flight's end: vehicles circle one above the other, up to "
                f"{highest_m:.0f} m; {most_m:g} m are allowed (safety.fence.height_max_m)"
            )

    def _ahead(self, seconds: float) -> list[tuple[float, float]]:
        points = [self._path.at(self._end_m + far_m) for far_m in points_ahead(seconds * self._speed_mps)]
        return [(point.north_m - self._end.north_m, point.east_m - self._end.east_m) for point in points]

    def _too_low(self) -> Iterator[str]:
        """Yield the lowest clearance on the way straight on, until the last vehicle is at its height."""
        goals_m = [self._stack.heights_m[identity] for identity in self._begin]
        times_s = np.arange(0.0, self._limit_s, STEP_S)
        ways = zip(self._models, self._begin.values(), goals_m, strict=True)
        height_m = np.array([_climb(model, begin, goal_m, len(times_s)) for model, begin, goal_m in ways])
        climbing = times_s <= times_s[(height_m < np.array(goals_m)[:, None] - SHORT_M).any(axis=0)].max(initial=0.0)
        north_m, east_m = self._places(times_s[climbing] * self._speed_mps)
        clearance_m = height_m[:, climbing] - self._ground.height(north_m, east_m)
        worst = np.unravel_index(np.nanargmin(clearance_m), clearance_m.shape)
        if clearance_m[worst] < self._clearance_m - SHORT_M:
            place = f"north {north_m[worst]:.0f}, east {east_m[worst]:.0f}"
            yield (
                f"path at {self._end_m:.0f} m, the flight's end: vehicles that climb to circle come to "
                f"{clearance_m[worst]:.1f} m above the ground straight on, at {place}; {self._clearance_m:g} m are "
                "asked for (terrain.clearance_m)"
            )

    def _places(self, ahead_m: Array) -> tuple[Array, Array]:
        """Return how far north and east everybody is (V, T) where the leader is so far (T,) beyond the end."""
        points = self._path.at(self._end_m + ahead_m)
        cosine, sine = np.cos(points.course_rad), np.sin(points.course_rad)
        forward_m, right_m, _ = self._slots_m.T[:, :, None]
        return points.north_m + forward_m * cosine - right_m * sine, points.east_m + forward_m * sine + right_m * cosine


def _climb(model: AutopilotModel, begin: Motion, goal_m: float, count: int) -> list[float]:
    """Return the heights of a vehicle that is told another one, every `STEP_S`."""
    state = FlightState(0.0, 0.0, begin.height_m, begin.climb_mps, model.speed_min_mps, 0.0, 0.0, 0.0)
    heights_m = list[float]()
    for _ in range(count):
        heights_m.append(state.height_m)
        advance(state, model, math.nan, math.nan, goal_m, STEP_S)
    return heights_m
