"""Rules for the path's geometry, its place on the Earth, the air around it and the ground below it."""

from __future__ import annotations

import math
from collections.abc import Iterator

from flight_model.earth import SEMI_MAJOR_M
from flight_model.elevation import ALLOWED, ElevationError
from flight_model.path import PathError
from formation_scenario.errors import Problem
from formation_scenario.model import Scenario
from formation_scenario.source import KeyPath, Source

MAX_PATH_M = 1e6
"""Half a day's flight; every few metres of a path are checked against every limit."""
MAX_DISTANCE_M = 1e6
MAX_LATITUDE_DEG = 89.0
"""Beyond it a degree of longitude is less than 2 km long, and shrinks to nothing."""
MAX_HEIGHT_M = 30_000.0


def places(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield the first waypoint too far from the origin, too near to a pole, or too high."""
    origin = scenario.origin
    for index, (north_m, east_m, height_m) in enumerate(scenario.path.waypoints_m):
        distance_m = math.hypot(north_m, east_m)
        latitude_deg = origin.lat_deg + math.degrees(north_m / SEMI_MAJOR_M)
        found = allowed = ""
        if distance_m > MAX_DISTANCE_M:
            found, allowed = f"a waypoint {distance_m:.3g} m from the origin", f"up to {MAX_DISTANCE_M:g} m"
        elif abs(latitude_deg) > MAX_LATITUDE_DEG:
            found, allowed = f"a waypoint at latitude {latitude_deg:.1f}°", f"up to {MAX_LATITUDE_DEG:g}°"
        elif abs(height_m + origin.alt_m) > MAX_HEIGHT_M:
            found, allowed = f"a waypoint {height_m:.3g} m high", f"up to {MAX_HEIGHT_M:g} m above sea level"
        if found:
            yield source.problem(("path", "waypoints_m", index), f"found {found}", allowed)
            return


def row(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a row in the air, or one in which vehicles stand nearer than they may fly."""
    row_m, least_m = scenario.start.row_m, scenario.safety.separation_m
    if row_m is None:
        return
    if scenario.start.in_air:
        yield source.problem(
            ("start", "row_m"), "found a row of vehicles that begin in the air", "none with in_air: true"
        )
    elif row_m < least_m:
        yield source.problem(("start", "row_m"), f"found {row_m:g} m", f"safety.separation_m, {least_m:g} m, or more")


def fence(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a fence whose lowest height is above its highest."""
    lowest_m, highest_m = scenario.safety.fence.heights_m if scenario.safety.fence else (0.0, 1.0)
    if lowest_m > highest_m:
        path: KeyPath = ("safety", "fence", "height_min_m")
        yield source.problem(path, f"found {lowest_m:g} m", f"up to height_max_m, {highest_m:g} m")


def wind(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a wind at least as fast as the slowest vehicle's highest airspeed."""
    speed_mps = math.hypot(*scenario.wind.velocity_mps[:2])
    slowest = min(scenario.vehicles, key=lambda vehicle: vehicle.model.speed_max_mps)
    if speed_mps >= slowest.model.speed_max_mps:
        allowed = f"less than {slowest.model.speed_max_mps:g} m/s, vehicle {slowest.vehicle_id}'s speed_max_mps"
        yield source.problem(("wind", "velocity_mps"), f"found a wind of {speed_mps:.3g} m/s", allowed)


def path(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield waypoints that no spline can be flown through, and paths that are too long."""
    path: KeyPath = ("path", "waypoints_m")
    try:
        length_m = scenario.path.written.length_m
    except PathError as error:
        allowed = "waypoints 1 m or more apart, without turning straight back"
        yield source.problem((*path, error.waypoint), str(error), allowed)
    else:
        if length_m > MAX_PATH_M:
            yield source.problem(path, f"found a path of {length_m:.3g} m", f"up to {MAX_PATH_M:g} m")


def terrain(scenario: Scenario, source: Source) -> Iterator[Problem]:
    """Yield a ground given twice, a clearance that contradicts another, and a file that can't be read."""
    terrain = scenario.terrain
    if terrain is None:
        return
    if terrain.file is not None and terrain.hills:
        yield source.problem(("terrain", "hills"), "found hills beside a file", "one of them")
    if scenario.safety.clearance_m > terrain.clearance_m:
        found = f"found {scenario.safety.clearance_m:g}"
        allowed = f"at most terrain.clearance_m, {terrain.clearance_m:g}"
        yield source.problem(("safety", "clearance_m"), found, allowed)
    try:
        _ = scenario.ground
    except ElevationError as error:
        yield source.problem(("terrain", "file"), str(error), ALLOWED)
