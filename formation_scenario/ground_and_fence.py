"""Limits of ground and fence for a path and its slots: the worst violation of each, as problems."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, offset_points
from flight_model.fence_geometry import CHECKED_M, Drift, FenceAreas, Flyers, places_along, room_along_m
from flight_model.offset_curve import STEP_M
from flight_model.path import FlightPath, PathPoints
from flight_model.path_lift_and_displacement import SAMPLE_M, sample_places
from formation_scenario.formation import added
from formation_scenario.geofence import OUTER, Geofence
from formation_scenario.model import Scenario
from formation_scenario.path_limits import TOLERANCE
from formation_scenario.sampled_path import WAYPOINTS, SampledPath, place_of
from formation_scenario.slot_assignment import SlotStep, names_by_index, slot_schedule, vehicles_by_index
from formation_scenario.slot_frame import axis_rad
from formation_scenario.source import KeyPath, dotted
from formation_scenario.start_states_and_end_times import planned_end_s, planned_m, start_states
from formation_scenario.surroundings import Terrain
from formation_scenario.terrain import LEADER_SHARE, ClearPath, Ground
from formation_scenario.vehicles import Vehicle
from formation_scenario.violations import Move, Violation

OFF_M = 0.01
"""Tolerance of heights and clearances, m."""
LEVEL_M = 1.0
"""Largest height of the ground at a take-off relative to the origin, m: the emulators' ground is level."""
STEP_SAMPLES = 200
"""Number of times within a step at which heights of path and ground are checked."""
OFFSET: KeyPath = ("start", "offset_m")
Places = dict[tuple[float, float, float], tuple[str, Vehicle]]
"""Vehicles by their slots: forward, right and up of the leader."""


def check_terrain(scenario: Scenario) -> list[Violation]:
    """Return the reasons why the formation can't clear the ground, each with the place where it is worst."""
    terrain = scenario.terrain
    if terrain is None:
        return list(_over_plain(scenario))
    ground, flat = scenario.ground, scenario.written_path
    begin_m = -scenario.run_in_m
    places = np.concatenate((np.arange(begin_m, 0.0, SAMPLE_M), sample_places(0.0, int(flat.length_m / STEP_M))))
    points = flat.at(places)
    unknown = list(_unknown_ground(scenario, ground, places, points))
    if unknown:
        return unknown
    height_m = ground.height(points.north_m, points.east_m)
    return [
        *_take_off(scenario, ground),
        *_run_in(terrain, places, points, height_m),
        *_clearance(scenario, terrain, ground),
    ]


def _over_plain(scenario: Scenario) -> Iterator[Violation]:
    """Yield the lowest points of any vehicle that are below the clearance: without terrain, paths aren't lifted."""
    sampled, least_m = SampledPath.along(scenario.written_path), scenario.safety.clearance_m
    below_m, who = min((float(step.places_m[:, 2].min()), step.shape) for step in slot_schedule(scenario))
    height_m = sampled.points.height_m + min(below_m, 0.0)
    whose = f"the lowest slot of shape {who}" if below_m < 0.0 else "the leader"
    for stretch in sampled.stretches(height_m < least_m - OFF_M):
        worst = stretch.start + int(np.argmin(height_m[stretch]))
        found, lack_m = f"{whose} is {height_m[worst]:.1f} m above the ground", least_m - height_m
        moves = sampled.raised(stretch, np.maximum(lack_m, 0.0))
        allowed = f"{least_m:g} m or more (safety.clearance_m)"
        yield sampled.violation(worst, found, allowed, "clearance", lack_m[worst] / 10.0, moves)


def _unknown_ground(scenario: Scenario, ground: Ground, places: Array, points: PathPoints) -> Iterator[Violation]:
    """Yield the first point of the path where the file has no value below the leader or a slot."""
    everyone, slots = names_by_index(scenario), {(0.0, 0.0, 0.0): "the leader"}
    for step in slot_schedule(scenario):
        for who, (forward, right, up) in zip(everyone, step.places_m.tolist(), strict=True):
            slots.setdefault((forward, right, up), f"{who} in shape {step.shape}")
    axis = axis_rad(scenario.formation.frame, points.course_rad, points.course_rad)
    for slot, who in slots.items():
        north, east = offset_points(points.north_m, points.east_m, axis, slot[0], slot[1])
        void = np.flatnonzero(np.isnan(ground.height(north, east)))
        if void.size:
            first = int(void[0])
            place = f"north {north[first]:.0f}, east {east[first]:.0f}"
            found = f"found no elevation under {who} at {places[first]:.0f} m of the path ({place})"
            allowed = "a file that covers the path and every slot, without voids"
            yield Violation(("terrain", "file"), found, allowed, "ground")
            return


def _take_off(scenario: Scenario, ground: Ground) -> Iterator[Violation]:
    """Yield the first take-off of an emulated vehicle on ground that isn't as high as the origin."""
    if scenario.start.in_air:
        return
    north_m, east_m, _ = _start_places(scenario).T
    height_m = ground.height(north_m, east_m)
    for vehicle, ground_m in zip(scenario.vehicles, height_m.tolist(), strict=True):
        if vehicle.autopilot == "emulator" and not abs(ground_m) <= LEVEL_M:
            found = f"found ground at {ground_m:.0f} m where emulated vehicle {vehicle.vehicle_id} would take off"
            yield Violation(("terrain",), found, "the origin's height there, 0 ± 1 m, or start.in_air: true", "start")
            return


def check_start(scenario: Scenario) -> Iterator[Violation]:
    """Yield the worst of the starts in the air that are too near to another, too low, or outside the fence.

    After a take-off vehicles assemble at the same positions.
    """
    in_air = scenario.on_same_path({"start": scenario.start.model_copy(update={"in_air": True})})
    places, safety = _start_places(in_air), scenario.safety
    who = [f"vehicle {vehicle.vehicle_id}" for vehicle in scenario.vehicles]
    apart_m, found = _nearest(scenario, places)
    if apart_m < safety.separation_m * (1.0 - TOLERANCE):
        yield Violation(OFFSET, found, f"{safety.separation_m:g} m or more (safety.separation_m)", "start")
    over_m = places[:, 2] - np.nan_to_num(scenario.ground.height(places[:, 0], places[:, 1]), nan=-np.inf)
    lowest = int(over_m.argmin())
    if over_m[lowest] < safety.clearance_m - OFF_M:
        found = f"{who[lowest]} begins {over_m[lowest]:.1f} m above the ground"
        yield Violation(OFFSET, found, f"{safety.clearance_m:g} m or more (safety.clearance_m)", "start")
    yield from _start_in_fence(scenario.fence, places, who)


def starts_without_room(scenario: Scenario, room_m: float) -> str | None:
    """Return the nearest starts in the air if their separation exceeds the limit by less than `room_m`; else None."""
    if not any(scenario.start.offset_m) or not scenario.start.in_air:
        return None
    apart_m, found = _nearest(scenario, _start_places(scenario))
    return f"{dotted(OFFSET)}: {found}" if apart_m < scenario.safety.separation_m + room_m else None


def _start_places(scenario: Scenario) -> Array:
    """Return the places (V, 3) at which the vehicles start: north, east and height, m."""
    return np.array([(each.north_m, each.east_m, each.height_m) for each in start_states(scenario)])


def _nearest(scenario: Scenario, places: Array) -> tuple[float, str]:
    """Return the least distance between the starts of any two vehicles (V, 3), and which two these are, in words."""
    apart_m = np.linalg.norm(places[:, None] - places[None, :], axis=-1)
    apart_m[np.tril_indices(len(places))] = np.inf
    one, other = np.unravel_index(int(apart_m.argmin()), apart_m.shape)
    first, second = (scenario.vehicles[each].vehicle_id for each in (one, other))
    return float(apart_m[one, other]), f"vehicle {first} and vehicle {second} begin {apart_m[one, other]:.3g} m apart"


def _start_in_fence(fence: Geofence | None, places: Array, who: list[str]) -> Iterator[Violation]:
    if fence is None:
        return
    lowest, highest, (least_m, max_m) = int(places[:, 2].argmin()), int(places[:, 2].argmax()), fence.heights_m
    if places[lowest, 2] < least_m - OFF_M:
        allowed = f"{least_m:g} m or more (safety.fence.height_min_m)"
        yield Violation(OFFSET, f"{who[lowest]} begins at {places[lowest, 2]:.1f} m", allowed, "start")
    if places[highest, 2] > max_m + OFF_M:
        allowed = f"{max_m:g} m or less (safety.fence.height_max_m)"
        yield Violation(OFFSET, f"{who[highest]} begins at {places[highest, 2]:.1f} m", allowed, "start")
    if fence.sides is not None:
        within_m = fence.sides.inside_m(places[:, :2])
        worst = int(within_m.argmin())
        if within_m[worst] < 0.0:
            found, allowed = _outside(fence.sides, places[worst, :2], float(-within_m[worst]))
            yield Violation(OFFSET, f"{who[worst]} begins {found}", allowed, "start")


def _outside(sides: FenceAreas, place_m: Array, by_m: float) -> tuple[str, str]:
    """Return what is wrong with a place (2,) outside the fence, and what is allowed, in words."""
    area = sides.nearest(place_m)
    if area.inclusion:
        return f"{by_m:.0f} m outside the {'fence' if area.key == OUTER else area}", f"inside it ({area.key})"
    return f"{by_m:.0f} m inside the {area}", f"outside it ({area.key})"


def check_steps(scenario: Scenario) -> Iterator[Violation]:
    """Yield steps of height that lead too near to the ground or outside the fence's heights, each at its worst time."""
    times_s = _within_steps(scenario)
    if not times_s.size:
        return
    step_m = np.array([added(scenario.path.steps, at_s)[2] for at_s in times_s.tolist()])
    points = scenario.leader_path.at(planned_m(scenario, times_s))
    lowest_m, highest_m = _lowest_and_highest_m(scenario)
    height_m = points.height_m + step_m
    over_m = height_m - np.nan_to_num(scenario.ground.height(points.north_m, points.east_m))
    fence_m = (-np.inf, np.inf) if scenario.fence is None else scenario.fence.heights_m
    for sign, limit_m, up_m, flown_m, what, key in (
        (1.0, scenario.safety.clearance_m, lowest_m, over_m, "m above the ground", "safety.clearance_m"),
        (1.0, fence_m[0], lowest_m, height_m, "m high", "safety.fence.height_min_m"),
        (-1.0, fence_m[1], highest_m, height_m, "m high", "safety.fence.height_max_m"),
    ):
        room_m = np.where(sign * step_m < 0.0, sign * (flown_m + up_m - limit_m), np.inf)
        worst = int(room_m.argmin())
        if room_m[worst] < -OFF_M:
            slot = "the leader" if up_m == 0.0 else f"the {'lowest' if sign > 0.0 else 'highest'} slot"
            found = (
                f"at {times_s[worst]:.4g} s ({place_of(points, worst)}) {slot} is {flown_m[worst] + up_m:.1f} {what}"
            )
            allowed = f"{limit_m:g} m or {'more' if sign > 0.0 else 'less'} ({key})"
            yield Violation(_step_at(scenario, times_s[worst], sign), found, allowed, "step")


def _lowest_and_highest_m(scenario: Scenario) -> tuple[float, float]:
    """Return how far others fly below and above the leader; over terrain those below are lifted clear of it."""
    up_m = [float(up_m) for step in slot_schedule(scenario) for up_m in step.places_m[:, 2]]
    return min(0.0, *up_m) if scenario.terrain is None else 0.0, max(0.0, *up_m)


def _within_steps(scenario: Scenario) -> Array:
    """Return times of steps of height before the flight's planned end, s: their corners, and samples between."""
    found, end_s = [np.zeros(0)], planned_end_s(scenario)
    for step in scenario.path.steps:
        if step.height_m:
            turns_s = np.array([step.ramp_s, step.for_s / 2.0, step.for_s - step.ramp_s])
            within_s = np.concatenate((turns_s, np.linspace(0.0, step.for_s, STEP_SAMPLES)))
            # Times strictly inside: where one step ends as another begins, they don't add up.
            found.append(step.at_s + np.clip(within_s, TOLERANCE, step.for_s - TOLERANCE))
    times_s = np.sort(np.concatenate(found))
    return times_s[times_s <= end_s]


def _step_at(scenario: Scenario, at_s: float, sign: float) -> KeyPath:
    """Return the key of the step with the largest height downwards (`sign` 1) or upwards (-1) at a time."""
    steps = scenario.path.steps
    index = min(range(len(steps)), key=lambda each: sign * added(steps[each : each + 1], at_s)[2])
    return "path", "steps", index, "height_m"


def _run_in(terrain: Terrain, places: Array, points: PathPoints, height_m: Array) -> Iterator[Violation]:
    """Yield the lowest clearance on the level run-in, which isn't lifted, and at the path's start."""
    before = np.flatnonzero(places <= 0.0)
    clearance = points.height_m[before] - height_m[before]
    worst = int(np.argmin(clearance))
    if clearance[worst] < terrain.clearance_m - OFF_M:
        where = "the path's start" if places[worst] == 0.0 else f"{-places[worst]:.0f} m before the path's start"
        found = f"{place_of(points, worst)}: {clearance[worst]:.1f} m above the ground at {where}"
        lack_m = terrain.clearance_m - float(clearance[worst])
        moves = {0: (0.0, 0.0, lack_m)}
        yield Violation((*WAYPOINTS, 0), found, _min(terrain), "clearance", lack_m / 10.0, 0.0, 0, moves)


def _clearance(scenario: Scenario, terrain: Terrain, ground: Ground) -> Iterator[Violation]:
    """Yield the lowest clearances of a path that can't be lifted sufficiently."""
    path = scenario.leader_path
    assert isinstance(path, ClearPath)
    if path.clearance_offset.short_m <= OFF_M:
        return
    sampled = SampledPath.along(path)
    points, places = sampled.points, sampled.places_m
    clearance = points.height_m - ground.height(points.north_m, points.east_m)
    lack_m = np.maximum(terrain.clearance_m - clearance, 0.0)
    climb_mps = LEADER_SHARE * min(vehicle.model.climb_max_mps for vehicle in scenario.vehicles)
    for stretch in sampled.stretches(lack_m > OFF_M):
        worst = stretch.start + int(np.argmax(lack_m[stretch]))
        if worst == 0:  # the run-in's end, which is said
            continue
        found = (
            f"path at {places[worst]:.0f} m ({place_of(points, worst)}): {clearance[worst]:.1f} m above the ground, "
            f"{lack_m[worst]:.1f} m too low, with climbs of {climb_mps:.3g} m/s from its start on"
        )
        allowed, waypoint = f"{_min(terrain)}, or a higher start", int(sampled.waypoints[worst])
        excess, moves = float(lack_m[worst]) / 10.0, {0: (0.0, 0.0, float(lack_m[worst]))}
        yield Violation(WAYPOINTS, found, allowed, "clearance", excess, float(places[worst]), waypoint, moves)


def _min(terrain: Terrain) -> str:
    return f"{terrain.clearance_m:g} m or more (terrain.clearance_m)"


def check_fence(
    scenario: Scenario, path: FlightPath, steps: tuple[SlotStep, ...], from_m: float
) -> Iterator[Violation]:
    """Yield the worst of each stretch beyond a limit of the fence, from `from_m` on; at the start with the run-in."""
    fence = scenario.fence
    if fence is None:
        return
    begin_m = -scenario.run_in_m if from_m <= 0.0 else from_m
    sampled, flyers = SampledPath.along(path, begin_m), _flyers(scenario, steps)
    yield from _fence_heights(fence, sampled, flyers)
    if fence.sides is not None:
        yield from _fence_sides(fence.sides, scenario, sampled, flyers)


def _flyers(scenario: Scenario, steps: tuple[SlotStep, ...]) -> Places:
    found: Places = {}
    for step in steps:
        for index, vehicle in enumerate(vehicles_by_index(scenario)):
            if vehicle is not None:
                leads = index == step.arrangement.leader
                who = "the leader" if leads else f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape}"
                forward, right, up = step.places_m[index].tolist()
                found.setdefault((forward, right, up), (who, vehicle))
    return found


def _fence_heights(fence: Geofence, sampled: SampledPath, flyers: Places) -> Iterator[Violation]:
    lowest, highest = min(flyers, key=lambda place: place[2]), max(flyers, key=lambda place: place[2])
    for place, sign, limit_m, key in (
        (lowest, 1.0, fence.heights_m[0], "height_min_m"),
        (highest, -1.0, fence.heights_m[1], "height_max_m"),
    ):
        height_m = sampled.points.height_m + place[2]
        lack_m = np.maximum(sign * (limit_m - height_m), 0.0)
        for stretch in sampled.stretches(lack_m > OFF_M):
            worst = stretch.start + int(np.argmax(lack_m[stretch]))
            allowed = f"{limit_m:g} m or {'more' if sign > 0.0 else 'less'} (safety.fence.{key})"
            found, excess = f"{flyers[place][0]} is at {height_m[worst]:.1f} m", float(lack_m[worst]) / 10.0
            moves = sampled.raised(stretch, sign * lack_m)
            yield sampled.violation(worst, found, allowed, "fence height", excess, moves)


def _fence_sides(areas: FenceAreas, scenario: Scenario, sampled: SampledPath, flyers: Places) -> Iterator[Violation]:
    """Yield the farthest outside of each stretch; where none is, the place with the least room to turn."""
    points, (forward_m, right_m, _) = sampled.points, np.array(list(flyers)).T
    turn_rps = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])
    way = points.north_m, points.east_m, points.course_rad
    who = Flyers(forward_m, right_m, turn_rps, scenario.formation.slots_turn)
    places, room_m = room_along_m(areas, way, who, drift(scenario))
    within_m, names = areas.inside_m(places), [who for who, _ in flyers.values()]
    lack_m = np.maximum(CHECKED_M - room_m, 0.0)
    outside_m = np.maximum(-within_m, 0.0)
    for stretch in sampled.stretches(np.asarray(np.maximum(outside_m, lack_m).max(axis=0) > 0.0)):
        out = bool((outside_m[:, stretch] > 0.0).any())
        worst_m = outside_m if out else lack_m
        row, index = np.unravel_index(int(worst_m[:, stretch].argmax()), worst_m[:, stretch].shape)
        at, by_m = stretch.start + int(index), float(worst_m[row, stretch.start + int(index)])
        moves = _inwards(areas, sampled, stretch, places, np.maximum(outside_m, lack_m))
        if out:
            found, allowed = _outside(areas, places[row, at], by_m)
        else:
            area = areas.nearest(places[row, at])
            what = "fence" if area.inclusion else area
            found = f"{within_m[row, at]:.0f} m from the {what} and heads for it"
            allowed = f"{by_m:.0f} m more room to turn away ({area.key})"
        yield sampled.violation(at, f"{names[row]} is {found}", allowed, "fence", by_m / 10.0, moves)


def _inwards(areas: FenceAreas, sampled: SampledPath, stretch: slice, places: Array, lack_m: Array) -> dict[int, Move]:
    """Return the move of each waypoint near to a stretch that brings inside whom it brings farthest outside.

    `places` (F, K, 2) of all vehicles along the path, which lack room by `lack_m` (F, K).
    """
    moves, step_m = dict[int, Move](), 0.5
    worst = lack_m[:, stretch].max(axis=0)
    for waypoint in np.unique(sampled.waypoints[stretch]).tolist():
        near_m = np.where(sampled.waypoints[stretch] == waypoint, worst, -1.0)
        at = stretch.start + int(near_m.argmax())
        who, by_m = int(lack_m[:, at].argmax()), float(near_m.max())
        sides = step_m * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        north, south, east, west = areas.inside_m(places[who, at] + sides).tolist()
        slope_m = np.hypot(north - south, east - west)
        if by_m > 0.0 and slope_m > 0.0:
            moves[int(waypoint)] = (by_m * (north - south) / slope_m, by_m * (east - west) / slope_m, 0.0)
    return moves


class FenceDistance(NamedTuple):
    """The least distance of a vehicle to the fence: in which slot, in words, and where on the path, m."""

    who: str
    least_m: float
    at_m: float
    north_m: float
    """Place of the vehicle there; as all figures, infinite where there is nothing to be near to."""
    east_m: float
    height_m: float
    """Least distance to the fence's lowest and highest height."""
    area: str
    """The key of the polygon or circle that is so near; empty without any."""


def fence_distances(scenario: Scenario) -> list[FenceDistance]:
    """Return the least distance to the fence, m, negative outside, of the leader and of every slot, the nearest first.

    From the run-in to the path's end; empty without a fence.
    """
    fence = scenario.fence
    if fence is None:
        return []
    sampled, flyers = (
        SampledPath.along(scenario.leader_path, -scenario.run_in_m),
        _flyers(scenario, slot_schedule(scenario)),
    )
    points, (lowest_m, highest_m) = sampled.points, fence.heights_m
    turn_rps = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])
    forward_m, right_m, up_m = np.array(list(flyers)).T
    way = points.north_m, points.east_m, points.course_rad
    places = places_along(way, Flyers(forward_m, right_m, turn_rps, scenario.formation.slots_turn), drift(scenario))
    found = list[FenceDistance]()
    for row, (who, _) in enumerate(flyers.values()):
        height_m, area = points.height_m + up_m[row], ""
        minimum = math.inf, math.inf, math.inf, math.inf
        if fence.sides is not None:
            within_m = fence.sides.inside_m(places[row])
            index = int(within_m.argmin())
            north_m, east_m = places[row, index].tolist()
            minimum = float(within_m[index]), float(sampled.places_m[index]), north_m, east_m
            area = fence.sides.nearest(places[row, index]).key
        room_m = float(min(height_m.min() - lowest_m, highest_m - height_m.max()))
        found.append(FenceDistance(who, *minimum, room_m, area))
    return sorted(found, key=lambda each: min(each.least_m, each.height_m))


def drift(scenario: Scenario) -> Drift:
    """Return the drift of a formation at its path's speed in the scenario's wind; multirotors don't drift."""
    speed_mps = scenario.path.fastest_mps
    return Drift(speed_mps, *scenario.drift_mps, speed_mps + scenario.wind.speed_mps)
