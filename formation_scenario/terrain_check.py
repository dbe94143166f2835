"""Checks that the path and every slot can be flown over the ground."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from flight_model.displacement import SAMPLE_M, STEP_M, sample_places
from flight_model.path import PathPoints
from formation_scenario.arrangement import slot_schedule
from formation_scenario.environment import Terrain
from formation_scenario.errors import Problem
from formation_scenario.ground import LEADER_SHARE, Ground, LiftedPath
from formation_scenario.model import Scenario
from formation_scenario.placement import start_states
from formation_scenario.reconfiguration import column_names
from formation_scenario.source import KeyPath, Source

SHORT_M = 0.01
"""Shortfall of clearance that is tolerated."""
LEVEL_M = 1.0
"""Largest height of the ground at a take-off, above or below the origin: the emulators' ground is level."""
WAYPOINTS: KeyPath = ("path", "waypoints_m")
FILE: KeyPath = ("terrain", "file")


def check_terrain(scenario: Scenario, source: Source) -> list[Problem]:
    """Return the reasons why the formation can't clear the ground, each with the place where it is worst."""
    terrain = scenario.terrain
    if terrain is None:
        return list(_over_plain(scenario, source))
    ground, flat = scenario.ground, scenario.path.written
    begin_m = -scenario.start.run_in_s * scenario.path.speed_mps
    places = np.concatenate((np.arange(begin_m, 0.0, SAMPLE_M), sample_places(0.0, int(flat.length_m / STEP_M))))
    points = flat.at(places)
    unknown = list(_unknown(scenario, source, ground, places, points))
    if unknown:
        return unknown
    height_m = ground.height(points.north_m, points.east_m)
    begun = [*_take_off(scenario, source, ground), *_run_in(terrain, source, places, points, height_m)]
    return begun or list(_path(scenario, terrain, source, ground))


def _over_plain(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield the lowest point of any vehicle if it is below the clearance: over a plain, paths aren't lifted."""
    path, least_m = scenario.path.written, scenario.safety.clearance_m
    points = path.at(sample_places(0.0, int(path.length_m / STEP_M)))
    worst = int(np.argmin(points.height_m))
    below_m, who = min((float(step.places_m[:, 2].min()), step.shape) for step in slot_schedule(scenario))
    height_m = float(points.height_m[worst]) + min(below_m, 0.0)
    if height_m < least_m - SHORT_M:
        whose = f"the lowest slot of shape {who}" if below_m < 0.0 else "the leader"
        found = f"{_place(points, worst)}: {whose} is {height_m:.1f} m above the ground"
        yield source.problem(WAYPOINTS, found, f"{least_m:g} m or more (safety.clearance_m)")


def _unknown(
    scenario: Scenario, source: Source, ground: Ground, places: Array, points: PathPoints
) -> Iterator[Problem]:
    """Yield the first point of the path below which, or below a slot at which, the file has no value."""
    cosine, sine = np.cos(points.course_rad), np.sin(points.course_rad)
    everyone, slots = column_names(scenario), {(0.0, 0.0, 0.0): "the leader"}
    for step in slot_schedule(scenario):
        for column in step.following:
            forward, right, up = step.places_m[column].tolist()
            slots.setdefault((forward, right, up), f"{everyone[column]} in shape {step.shape}")
    for slot, who in slots.items():
        north = points.north_m + slot[0] * cosine - slot[1] * sine
        east = points.east_m + slot[0] * sine + slot[1] * cosine
        void = np.flatnonzero(np.isnan(ground.height(north, east)))
        if void.size:
            first = int(void[0])
            place = f"north {north[first]:.0f}, east {east[first]:.0f}"
            found = f"found no elevation under {who} at {places[first]:.0f} m of the path ({place})"
            yield source.problem(FILE, found, "a file that covers the path and every slot, without voids")
            return


def _take_off(scenario: Scenario, source: Source, ground: Ground) -> Iterator[Problem]:
    if scenario.start.in_air:
        return
    start = start_states(scenario)
    height_m = ground.height(start.north_m, start.east_m)
    for vehicle, ground_m in zip(scenario.vehicles, height_m.tolist(), strict=True):
        if vehicle.autopilot == "emulator" and not abs(ground_m) <= LEVEL_M:
            found = f"found ground at {ground_m:.0f} m where emulated vehicle {vehicle.vehicle_id} would take off"
            yield source.problem(("terrain",), found, "the origin's height there, 0 ± 1 m, or start.in_air: true")
            return


def _run_in(terrain: Terrain, source: Source, places: Array, points: PathPoints, height_m: Array) -> Iterator[Problem]:
    """Yield the lowest clearance on the level run-in, which isn't lifted, and at the path's start."""
    before = np.flatnonzero(places <= 0.0)
    clearance = points.height_m[before] - height_m[before]
    worst = int(np.argmin(clearance))
    if clearance[worst] < terrain.clearance_m - SHORT_M:
        where = "the path's start" if places[worst] == 0.0 else f"{-places[worst]:.0f} m before the path's start"
        found = f"{_place(points, worst)}: {clearance[worst]:.1f} m above the ground at {where}"
        yield source.problem((*WAYPOINTS, 0), found, _least(terrain))


def _path(scenario: Scenario, terrain: Terrain, source: Source, ground: Ground) -> Iterator[Problem]:
    path = scenario.leader_path
    assert isinstance(path, LiftedPath)
    if path.lift.short_m <= SHORT_M:
        return
    places = np.arange(0.0, path.length_m, SAMPLE_M)
    points = path.at(places)
    clearance = points.height_m - ground.height(points.north_m, points.east_m)
    worst = int(np.argmin(clearance))
    climb_mps = LEADER_SHARE * min(vehicle.model.climb_max_mps for vehicle in scenario.vehicles)
    found = (
        f"path at {places[worst]:.0f} m ({_place(points, worst)}): {clearance[worst]:.1f} m above the ground, "
        f"{terrain.clearance_m - clearance[worst]:.1f} m too low, with climbs of {climb_mps:.3g} m/s from its start on"
    )
    yield source.problem(WAYPOINTS, found, f"{_least(terrain)}, or a higher start")


def _place(points: PathPoints, index: int) -> str:
    return f"north {points.north_m[index]:.0f}, east {points.east_m[index]:.0f}, height {points.height_m[index]:.0f}"


def _least(terrain: Terrain) -> str:
    return f"{terrain.clearance_m:g} m or more (terrain.clearance_m)"
