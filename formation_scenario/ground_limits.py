"""Clearance of the ground, along the path and at take-off: the worst violations of each kind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array, offset_points
from flight_model.offset_curve import STEP_M
from flight_model.path import PathPoints
from flight_model.path_offsets import SAMPLE_M, sample_distances
from formation_scenario.model import Scenario
from formation_scenario.sampled_path import WAYPOINTS, SampledPath, position_text
from formation_scenario.slot_assignment import names_by_index, slot_schedule
from formation_scenario.slot_frame import axis_rad
from formation_scenario.start_states import start_positions_m
from formation_scenario.surroundings import Terrain
from formation_scenario.terrain import LEADER_SHARE, ClearPath, Ground
from formation_scenario.violations import HEIGHT_TOLERANCE_M, Violation

LEVEL_M = 1.0
"""Largest height of the ground at a take-off relative to the origin, m: the emulators' ground is level."""


def check_terrain(scenario: Scenario) -> list[Violation]:
    """Return the reasons why the formation can't clear the ground, each with the position where it is worst."""
    terrain = scenario.terrain
    if terrain is None:
        return list(_over_plain(scenario))
    ground, flat = scenario.ground, scenario.written_path
    begin_m = -scenario.run_in_m
    at_m = np.concatenate((np.arange(begin_m, 0.0, SAMPLE_M), sample_distances(0.0, int(flat.length_m / STEP_M))))
    points = flat.at(at_m)
    unknown = list(_unknown_ground(scenario, ground, at_m, points))
    if unknown:
        return unknown
    height_m = ground.height(points.north_m, points.east_m)
    return [
        *_take_off(scenario, ground),
        *_run_in(terrain, at_m, points, height_m),
        *_clearance(scenario, terrain, ground),
    ]


def _over_plain(scenario: Scenario) -> Iterator[Violation]:
    """Yield the lowest points of any vehicle that are below the clearance: without terrain, paths aren't raised."""
    sampled, min_m = SampledPath.along(scenario.written_path), scenario.safety.clearance_m
    below_m, who = min((float(step.positions_m[:, 2].min()), step.shape) for step in slot_schedule(scenario))
    height_m = sampled.points.height_m + min(below_m, 0.0)
    whose = f"the lowest slot of shape {who}" if below_m < 0.0 else "the leader"
    for stretch in sampled.stretches(height_m < min_m - HEIGHT_TOLERANCE_M):
        worst = stretch.start + int(np.argmin(height_m[stretch]))
        found, lack_m = f"{whose} is {height_m[worst]:.1f} m above the ground", min_m - height_m
        moves = sampled.raised(stretch, np.maximum(lack_m, 0.0))
        allowed = f"{min_m:g} m or more (safety.clearance_m)"
        yield sampled.violation(worst, found, allowed, "clearance", lack_m[worst] / 10.0, moves)


def _unknown_ground(scenario: Scenario, ground: Ground, at_m: Array, points: PathPoints) -> Iterator[Violation]:
    """Yield the first point of the path where the file has no value below the leader or a slot."""
    everyone, slots = names_by_index(scenario), {(0.0, 0.0, 0.0): "the leader"}
    for step in slot_schedule(scenario):
        for who, (forward, right, up) in zip(everyone, step.positions_m.tolist(), strict=True):
            slots.setdefault((forward, right, up), f"{who} in shape {step.shape}")
    axis = axis_rad(scenario.formation.frame, points.course_rad, points.course_rad)
    for slot, who in slots.items():
        north, east = offset_points(points.north_m, points.east_m, axis, slot[0], slot[1])
        void = np.flatnonzero(np.isnan(ground.height(north, east)))
        if void.size:
            first = int(void[0])
            position = f"north {north[first]:.0f}, east {east[first]:.0f}"
            found = f"found no elevation under {who} at {at_m[first]:.0f} m of the path ({position})"
            allowed = "a file that covers the path and every slot, without voids"
            yield Violation(("terrain", "file"), found, allowed, "ground")
            return


def _take_off(scenario: Scenario, ground: Ground) -> Iterator[Violation]:
    """Yield the first take-off of an emulated vehicle on ground that isn't as high as the origin."""
    if scenario.start.in_air:
        return
    north_m, east_m, _ = start_positions_m(scenario).T
    height_m = ground.height(north_m, east_m)
    for vehicle, ground_m in zip(scenario.vehicles, height_m.tolist(), strict=True):
        if vehicle.autopilot == "emulator" and not abs(ground_m) <= LEVEL_M:
            found = f"found ground at {ground_m:.0f} m where emulated vehicle {vehicle.vehicle_id} would take off"
            yield Violation(("terrain",), found, "the origin's height there, 0 ± 1 m, or start.in_air: true", "start")
            return


def _run_in(terrain: Terrain, at_m: Array, points: PathPoints, height_m: Array) -> Iterator[Violation]:
    """Yield the lowest clearance on the level run-in, which isn't raised, and at the path's start."""
    before = np.flatnonzero(at_m <= 0.0)
    clearance = points.height_m[before] - height_m[before]
    worst = int(np.argmin(clearance))
    if clearance[worst] < terrain.clearance_m - HEIGHT_TOLERANCE_M:
        where = "the path's start" if at_m[worst] == 0.0 else f"{-at_m[worst]:.0f} m before the path's start"
        found = f"{position_text(points, worst)}: {clearance[worst]:.1f} m above the ground at {where}"
        lack_m = terrain.clearance_m - float(clearance[worst])
        moves = {0: (0.0, 0.0, lack_m)}
        yield Violation((*WAYPOINTS, 0), found, _min(terrain), "clearance", lack_m / 10.0, 0.0, 0, moves)


def _clearance(scenario: Scenario, terrain: Terrain, ground: Ground) -> Iterator[Violation]:
    """Yield the lowest clearances of a path that can't be raised sufficiently."""
    path = scenario.leader_path
    assert isinstance(path, ClearPath)
    if path.clearance_offset.short_m <= HEIGHT_TOLERANCE_M:
        return
    sampled = SampledPath.along(path)
    points, at_m = sampled.points, sampled.at_m
    clearance = points.height_m - ground.height(points.north_m, points.east_m)
    lack_m = np.maximum(terrain.clearance_m - clearance, 0.0)
    climb_mps = LEADER_SHARE * min(vehicle.model.climb_max_mps for vehicle in scenario.vehicles)
    for stretch in sampled.stretches(lack_m > HEIGHT_TOLERANCE_M):
        worst = stretch.start + int(np.argmax(lack_m[stretch]))
        if worst == 0:  # the run-in's end, which is said
            continue
        found = (
            f"path at {at_m[worst]:.0f} m ({position_text(points, worst)}): {clearance[worst]:.1f} m above the ground, "
            f"{lack_m[worst]:.1f} m too low, with climbs of {climb_mps:.3g} m/s from its start on"
        )
        allowed, waypoint = f"{_min(terrain)}, or a higher start", int(sampled.waypoints[worst])
        excess, moves = float(lack_m[worst]) / 10.0, {0: (0.0, 0.0, float(lack_m[worst]))}
        yield Violation(WAYPOINTS, found, allowed, "clearance", excess, float(at_m[worst]), waypoint, moves)


def _min(terrain: Terrain) -> str:
    return f"{terrain.clearance_m:g} m or more (terrain.clearance_m)"
