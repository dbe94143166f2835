"""The geofences of the vehicles themselves: path and slots must be inside, and commanded heights are kept inside."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario import Scenario
from formation_scenario.slot_assignment import slot_schedule
from gcs_formation.fleet.circle_heights import STACK_M
from gcs_formation.vehicle.own_fence import MARGIN_M, OwnFence
from gcs_formation.vehicle.vehicle import Vehicle

EVERY_M = 25.0
"""Distance of the points at which the path is looked at. Tuned: m; 10 to 100; by judgement."""


class Needs(NamedTuple):
    """What a flight needs: heights above the origin, the path's points (N, 2), and how far slots are from them, m."""

    lowest_m: float
    highest_m: float
    points_m: Array
    slots_m: float


class OwnFences:
    """Judges each vehicle's fence once its parameters and its home are known."""

    def __init__(self, scenario: Scenario) -> None:
        """Start with none."""
        self._scenario, self._reported = scenario, list[tuple[Vehicle, OwnFence]]()
        self._judged = dict[VehicleId, list[str]]()

    @property
    def settled(self) -> bool:
        """Whether all that have been reported are judged."""
        return len(self._judged) == len(self._reported)

    def apply(self, vehicle: Vehicle, fence: OwnFence | None) -> None:
        """Take what a vehicle's parameters say."""
        if fence is not None:
            self._reported.append((vehicle, fence))

    @property
    def unflyable(self) -> list[str]:
        """What of path and slots is outside, in words."""
        return [text for texts in self._judged.values() for text in texts]

    def settle(self) -> None:
        """Judge those whose homes are known by now, and bound their heights."""
        for vehicle, fence in self._reported:
            motion = vehicle.telemetry.motion
            if motion is None or vehicle.identity in self._judged:
                continue
            home_m = motion.height_m - motion.above_home_m
            vehicle.autopilot.heights_m = home_m + fence.lowest_m + MARGIN_M, home_m + fence.highest_m - MARGIN_M
            at_m = vehicle.telemetry.home_m or (motion.north_m, motion.east_m)
            found = self._outside(fence, home_m, at_m)
            self._judged[vehicle.identity] = [f"vehicle {vehicle.identity}: {each}" for each in found]

    @cached_property
    def _needs(self) -> Needs:
        scenario = self._scenario
        path = scenario.leader_path
        at = path.at(np.linspace(0.0, path.length_m, 2 + int(path.length_m / EVERY_M)))
        slots_m = np.concatenate([each.positions_m for each in slot_schedule(scenario)])
        up_m = slots_m[:, 2]
        stack_m = 0.0 if scenario.hovers else STACK_M * (len(scenario.vehicles) - 1)
        lowest_m = float(np.min(at.height_m)) + min(0.0, float(up_m.min()))
        highest_m = float(np.max(at.height_m)) + max(0.0, float(up_m.max())) + stack_m
        points_m = np.column_stack((at.north_m, at.east_m))
        return Needs(lowest_m, highest_m, points_m, float(np.hypot(slots_m[:, 0], slots_m[:, 1]).max()))

    def _outside(self, fence: OwnFence, home_m: float, at_m: tuple[float, float]) -> list[str]:
        """Return what a fence around a home doesn't allow, with the parameter and what it would have to be."""
        needs = self._needs
        low_m, high_m = needs.lowest_m - home_m - MARGIN_M, needs.highest_m - home_m + MARGIN_M
        away_m = float(np.hypot(*(needs.points_m - np.array(at_m)).T).max()) + needs.slots_m + MARGIN_M
        found = list[str]()
        if low_m < fence.lowest_m:
            found.append(_words(fence.names[0], fence.lowest_m, f"{math.floor(low_m)} m or less", "path.waypoints_m"))
        if high_m > fence.highest_m:
            more = f"{math.ceil(high_m)} m or more, for path, slots and the circles at the end"
            found.append(_words(fence.names[1], fence.highest_m, more, "path.waypoints_m"))
        if away_m > fence.radius_m:
            more = f"{math.ceil(away_m)} m or more, for path and slots"
            found.append(_words(fence.names[2], fence.radius_m, more, "path.waypoints_m"))
        return found


def _words(name: str, value: float, allowed: str, key: str) -> str:
    return f"{name}: found {value:g}; allowed: {allowed}, or another {key}"
