"""Limits of the fence along a path, of the leader and every slot: the worst violation of each stretch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from flight_model.arrays import Array
from flight_model.fence_geometry import CHECKED_M, FenceAreas, Flyers, room_along_m
from flight_model.path import FlightPath
from formation_scenario.geofence import OUTER, Geofence
from formation_scenario.model import Scenario
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import SlotStep, vehicles_by_index
from formation_scenario.vehicles import Vehicle
from formation_scenario.violations import HEIGHT_TOLERANCE_M, Move, Violation
from formation_scenario.wind_triangle import drift

VehiclesBySlot: TypeAlias = dict[tuple[float, float, float], tuple[str, Vehicle]]
"""Vehicles, with a name for each, by their slots: forward, right and up of the leader, m."""


def check_fence(
    scenario: Scenario, path: FlightPath, steps: tuple[SlotStep, ...], from_m: float
) -> Iterator[Violation]:
    """Yield the worst of each stretch beyond a limit of the fence, from `from_m` on; at the start with the run-in."""
    fence = scenario.fence
    if fence is None:
        return
    begin_m = -scenario.run_in_m if from_m <= 0.0 else from_m
    sampled, flyers = SampledPath.along(path, begin_m), slot_flyers(scenario, steps)
    yield from _fence_heights(fence, sampled, flyers)
    if fence.sides is not None:
        yield from _fence_sides(fence.sides, scenario, sampled, flyers)


def slot_flyers(scenario: Scenario, steps: tuple[SlotStep, ...]) -> VehiclesBySlot:
    """Return each slot of the steps with the vehicle that is in it, the first one if several are."""
    found: VehiclesBySlot = {}
    for step in steps:
        for index, vehicle in enumerate(vehicles_by_index(scenario)):
            if vehicle is not None:
                leads = index == step.arrangement.leader
                who = "the leader" if leads else f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape}"
                forward, right, up = step.positions_m[index].tolist()
                found.setdefault((forward, right, up), (who, vehicle))
    return found


def _fence_heights(fence: Geofence, sampled: SampledPath, flyers: VehiclesBySlot) -> Iterator[Violation]:
    lowest, highest = min(flyers, key=lambda slot: slot[2]), max(flyers, key=lambda slot: slot[2])
    for slot, sign, limit_m, key in (
        (lowest, 1.0, fence.heights_m[0], "height_min_m"),
        (highest, -1.0, fence.heights_m[1], "height_max_m"),
    ):
        height_m = sampled.points.height_m + slot[2]
        lack_m = np.maximum(sign * (limit_m - height_m), 0.0)
        for stretch in sampled.stretches(lack_m > HEIGHT_TOLERANCE_M):
            worst = stretch.start + int(np.argmax(lack_m[stretch]))
            allowed = f"{limit_m:g} m or {'more' if sign > 0.0 else 'less'} (safety.fence.{key})"
            found, excess = f"{flyers[slot][0]} is at {height_m[worst]:.1f} m", float(lack_m[worst]) / 10.0
            moves = sampled.raised(stretch, sign * lack_m)
            yield sampled.violation(worst, found, allowed, "fence height", excess, moves)


def _fence_sides(
    areas: FenceAreas, scenario: Scenario, sampled: SampledPath, flyers: VehiclesBySlot
) -> Iterator[Violation]:
    """Yield the farthest outside of each stretch; where none is, the position with the least room to turn."""
    points, (forward_m, right_m, _) = sampled.points, np.array(list(flyers)).T
    turn_rps = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])
    path = points.north_m, points.east_m, points.course_rad
    who = Flyers(forward_m, right_m, turn_rps, scenario.formation.slots_turn)
    positions_m, room_m = room_along_m(areas, path, who, drift(scenario))
    within_m, names = areas.inside_m(positions_m), [who for who, _ in flyers.values()]
    lack_m = np.maximum(CHECKED_M - room_m, 0.0)
    outside_m = np.maximum(-within_m, 0.0)
    for stretch in sampled.stretches(np.asarray(np.maximum(outside_m, lack_m).max(axis=0) > 0.0)):
        out = bool((outside_m[:, stretch] > 0.0).any())
        worst_m = outside_m if out else lack_m
        row, index = np.unravel_index(int(worst_m[:, stretch].argmax()), worst_m[:, stretch].shape)
        at, by_m = stretch.start + int(index), float(worst_m[row, stretch.start + int(index)])
        moves = _inwards(areas, sampled, stretch, positions_m, np.maximum(outside_m, lack_m))
        if out:
            found, allowed = outside_fence(areas, positions_m[row, at], by_m)
        else:
            area = areas.nearest(positions_m[row, at])
            what = "fence" if area.inclusion else area
            found = f"{within_m[row, at]:.0f} m from the {what} and heads for it"
            allowed = f"{by_m:.0f} m more room to turn away ({area.key})"
        yield sampled.violation(at, f"{names[row]} is {found}", allowed, "fence", by_m / 10.0, moves)


def _inwards(
    areas: FenceAreas, sampled: SampledPath, stretch: slice, positions_m: Array, lack_m: Array
) -> dict[int, Move]:
    """Return the move of each waypoint near to a stretch that brings inside whom it brings farthest outside.

    `positions_m` (F, K, 2) of all vehicles along the path, which lack room by `lack_m` (F, K).
    """
    moves, step_m = dict[int, Move](), 0.5
    worst = lack_m[:, stretch].max(axis=0)
    for waypoint in np.unique(sampled.waypoints[stretch]).tolist():
        near_m = np.where(sampled.waypoints[stretch] == waypoint, worst, -1.0)
        at = stretch.start + int(near_m.argmax())
        who, by_m = int(lack_m[:, at].argmax()), float(near_m.max())
        sides = step_m * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        north, south, east, west = areas.inside_m(positions_m[who, at] + sides).tolist()
        slope_m = np.hypot(north - south, east - west)
        if by_m > 0.0 and slope_m > 0.0:
            moves[int(waypoint)] = (by_m * (north - south) / slope_m, by_m * (east - west) / slope_m, 0.0)
    return moves


def outside_fence(sides: FenceAreas, position_m: Array, by_m: float) -> tuple[str, str]:
    """Return what is wrong with a position (2,) outside the fence, and what is allowed, in words."""
    area = sides.nearest(position_m)
    if area.inclusion:
        return f"{by_m:.0f} m outside the {'fence' if area.key == OUTER else area}", f"inside it ({area.key})"
    return f"{by_m:.0f} m inside the {area}", f"outside it ({area.key})"
