"""What `check` says about the end: vehicles climb to their circles, whose heights the ground may decide."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, offset_points
from flight_model.autopilot_model import AutopilotModel, advance
from flight_model.flight_state import FlightState
from formation_scenario import Scenario
from formation_scenario.planned_progress import planned_m
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.slot_frame import axis_rad
from gcs_formation.features.ending.holding_stack import HoldingStack, stacked
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.guidance.path_ahead import path_ahead
from gcs_formation.vehicle.reported_motion import ReportedMotion

STEP_S = 0.5
"""Time step of predicted heights. Tuned: s; 0.2 to 1; by judgement."""
SHORT_M = 0.5
"""A lack of clearance up to this isn't reported. Tuned: m; 0.2 to 1; shown by `pytest
tests/gcs_formation/features/ending`."""


def final_circles(scenario: Scenario) -> Iterator[str]:
    """Yield what is wrong with the vehicles' last circles: ground below them or on the way there, or the fence.

    Circles are one above the other, so many vehicles need much height.
    """
    terrain, fence = scenario.terrain, scenario.fence
    if terrain is None and fence is None:
        return
    climb = _Climb(scenario, -math.inf if terrain is None else terrain.clearance_m)
    if terrain is not None:
        yield from climb.warnings()
    if fence is not None:
        yield from climb.beyond(fence.heights_m[1])


class _Climb:
    """The climb of all vehicles to their circles, straight on from the planned end of the flight."""

    def __init__(self, scenario: Scenario, clearance_m: float) -> None:
        self._path, self._speed_mps = scenario.leader_path, scenario.path.begin_mps
        self._end_m = float(planned_m(scenario, np.array(scenario.duration_s)))
        self._where = f"path at {self._end_m:.0f} m, the flight's end"
        self._ground, self._floor, self._clearance_m = scenario.ground, GroundFloor(scenario), clearance_m
        first = 1 if scenario.leader is None else 0
        self._models = autopilot_models(scenario)[first:]
        self._slots_m = slot_schedule(scenario)[-1].positions_m[first:]
        self._frame = scenario.formation.frame
        self._end = self._path.at(self._end_m)
        north_m, east_m = self._positions(np.zeros(1))
        lowest_m = self._ground.height(north_m, east_m)[:, 0] + clearance_m  # slots are lifted that far
        up_m = np.fmax(self._end.height_m + self._slots_m[:, 2], lowest_m).tolist()
        each = zip(north_m[:, 0].tolist(), east_m[:, 0].tolist(), up_m, strict=True)
        climb_mps = self._end.slope * self._speed_mps
        self._begin = {
            VehicleId(1, at): ReportedMotion(0.0, *begin_m, 0.0, 0.0, climb_mps, 0.0) for at, begin_m in enumerate(each)
        }
        self._stack = HoldingStack(scenario.safety.kept_m, hover=scenario.hovers)
        climb_mps = min(model.climb_max_mps for model in self._models)
        self._limit_s = stacked(self._begin, self._stack, self._floor, "loiter", self._ahead, climb_mps)
        self._stack.add(self._begin)

    def warnings(self) -> Iterator[str]:
        where, height_m = self._where, self._end.height_m
        begins = [
            (motion.north_m + north_m, motion.east_m + east_m)
            for motion in self._begin.values()
            for north_m, east_m in self._ahead(self._limit_s)
        ]
        top = self._floor.highest(begins)
        if top.height_m > height_m:
            yield (
                f"{where}: vehicles circle {top.height_m - height_m:.1f} m above it, at "
                f"{top.height_m:.0f} m and higher, for the ground at north {top.north_m:.0f}, east {top.east_m:.0f}"
            )
        unknown = next((point for begin in begins if (point := self._floor.unknown(*begin)) is not None), None)
        if unknown is not None:
            north_m, east_m = unknown
            yield (
                f"{where}: found no elevation at north {north_m:.0f}, east {east_m:.0f}, below "
                "the vehicles' circles or their way there; the ground there isn't kept clear of"
            )
        yield from self._too_low()

    def beyond(self, max_m: float) -> Iterator[str]:
        """Yield by how much the highest circle is above `max_m`."""
        highest_m = max(self._stack.heights_m.values())
        if highest_m > max_m + SHORT_M:
            yield (
                f"{self._where}: vehicles circle one above the other, up to {highest_m:.0f} m; {max_m:g} m are "
                "allowed (safety.fence.height_max_m)"
            )

    def _ahead(self, seconds: float) -> list[tuple[float, float]]:
        return path_ahead(self._path, self._end_m, seconds * self._speed_mps)

    def _too_low(self) -> Iterator[str]:
        """Yield the lowest clearance straight on until the last vehicle is at its height, if it is too low."""
        goals_m = [self._stack.heights_m[identity] for identity in self._begin]
        times_s = np.arange(0.0, self._limit_s, STEP_S)
        climbs = zip(self._models, self._begin.values(), goals_m, strict=True)
        height_m = np.array([_climbed_m(model, begin, goal_m, len(times_s)) for model, begin, goal_m in climbs])
        climbing = times_s <= times_s[(height_m < np.array(goals_m)[:, None] - SHORT_M).any(axis=0)].max(initial=0.0)
        north_m, east_m = self._positions(times_s[climbing] * self._speed_mps)
        clearance_m = height_m[:, climbing] - self._ground.height(north_m, east_m)
        worst = np.unravel_index(np.nanargmin(clearance_m), clearance_m.shape)
        if clearance_m[worst] < self._clearance_m - SHORT_M:
            where = f"north {north_m[worst]:.0f}, east {east_m[worst]:.0f}"
            yield (
                f"{self._where}: vehicles that climb to circle come to {clearance_m[worst]:.1f} m above the ground "
                f"straight on, at {where}; {self._clearance_m:g} m are asked for (terrain.clearance_m)"
            )

    def _positions(self, ahead_m: Array) -> tuple[Array, Array]:
        """Return positions north and east (V, T) of all vehicles when the leader is `ahead_m` (T,) beyond the end."""
        points = self._path.at(self._end_m + ahead_m)
        forward_m, right_m, _ = self._slots_m.T[:, :, None]
        axis = axis_rad(self._frame, points.course_rad, points.course_rad)
        return offset_points(points.north_m, points.east_m, axis, forward_m, right_m)


def _climbed_m(model: AutopilotModel, begin: ReportedMotion, goal_m: float, count: int) -> list[float]:
    """Return the heights, every `STEP_S`, of a vehicle that climbs to `goal_m`."""
    state = FlightState(0.0, 0.0, begin.height_m, begin.climb_mps, model.speed_min_mps, 0.0, 0.0, 0.0)
    heights_m = [state.height_m]
    for _ in range(count - 1):
        advance(state, model, math.nan, math.nan, goal_m, STEP_S)
        heights_m.append(state.height_m)
    return heights_m[:count]


WARNINGS: Final = (final_circles,)
