"""Rules between the keys of the path: waypoints, speeds of legs, circles, stops."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flight_model.earth import SEMI_MAJOR_M
from flight_model.legs.path import MIN_LEG_M
from flight_model.path import PathError
from formation_scenario.fields import MAX_DISTANCE_M, distinct_texts
from formation_scenario.model import Scenario
from formation_scenario.sampled_path import WAYPOINTS
from formation_scenario.source import Finding

MAX_PATH_M = 1e6
"""Half a day's flight; a longer path would take too long to check, every few metres against every limit."""
MAX_LATITUDE_DEG = 89.0
"""Beyond this latitude a degree of longitude is less than 2 km long."""
MAX_HEIGHT_M = 30_000.0


def waypoint_positions(scenario: Scenario) -> Iterator[Finding]:
    """Yield the first waypoint too far from the origin, too near to a pole, or too high."""
    origin = scenario.origin
    for index, (north_m, east_m, height_m) in enumerate(scenario.path.waypoints_m):
        distance_m = math.hypot(north_m, east_m)
        latitude_deg = origin.lat_deg + math.degrees(north_m / SEMI_MAJOR_M)
        sea_m = abs(height_m + origin.alt_m)
        for size, maximum, found, allowed in (
            (distance_m, MAX_DISTANCE_M, f"{distance_m:.3g} m from the origin", f"{MAX_DISTANCE_M:g} m"),
            (abs(latitude_deg), MAX_LATITUDE_DEG, f"at latitude {latitude_deg:.1f}°", f"{MAX_LATITUDE_DEG:g}°"),
            (sea_m, MAX_HEIGHT_M, f"{height_m:.3g} m high", f"{MAX_HEIGHT_M:g} m above sea level"),
        ):
            if size > maximum:
                yield (*WAYPOINTS, index), f"found a waypoint {found}", f"up to {allowed}"
                return


def leg_speeds(scenario: Scenario) -> Iterator[Finding]:
    """Yield a list of speeds for a path without legs, or with another number of legs."""
    given, legs = scenario.path.speed_mps, len(scenario.path.waypoints_m) - 1
    if isinstance(given, tuple) and scenario.path.kind != "legs":
        yield ("path", "speed_mps"), "found a list, one a leg", "a number, or kind: legs"
    elif isinstance(given, tuple) and len(given) != legs:
        yield ("path", "speed_mps"), f"found {len(given)} speeds", f"{legs}, one a leg, or a number"


def circles(scenario: Scenario) -> Iterator[Finding]:
    """Yield circles without legs, beyond the last waypoint, or twice at one; and legs without room for theirs."""
    plan, seen = scenario.path, set[int]()
    for index, each in enumerate(plan.circles):
        key = ("path", "circles", index)
        if plan.kind != "legs":
            yield key, "found circles", "with path.kind: legs"
        elif each.waypoint >= len(plan.waypoints_m) or each.waypoint in seen:
            again = " again" if each.waypoint in seen else ""
            yield (*key, "waypoint"), f"found {each.waypoint}{again}", f"1 to {len(plan.waypoints_m) - 1}, once each"
        seen.add(each.waypoint)


def stops(scenario: Scenario) -> Iterator[Finding]:
    """Yield stops without legs, of vehicles that don't hover, at the path's ends, or twice at a waypoint."""
    plan, seen, last = scenario.path, set[int](), len(scenario.path.waypoints_m) - 2
    keys = [("path", "stops")] if plan.stops else []
    keys += [("path", "turn")] if plan.turn == "stop" else []
    for key in keys:
        if plan.kind != "legs":
            yield key, "found stops", "with path.kind: legs"
        elif not scenario.hovers:
            yield key, "found stops of vehicles that can't hover", "circles (path.circles), or vehicles that hover"
    for index, each in enumerate(plan.stops if plan.kind == "legs" and scenario.hovers else ()):
        if each.waypoint > last or each.waypoint in seen:
            again = " again" if each.waypoint in seen else ""
            allowed = f"1 to {last}, once each: the path is begun and ended in flight" if last else "a waypoint between"
            yield ("path", "stops", index, "waypoint"), f"found {each.waypoint}{again}", allowed
        seen.add(each.waypoint)


def path(scenario: Scenario) -> Iterator[Finding]:
    """Yield all waypoints through which no path leads, and paths that are too long."""
    allowed = "waypoints 1 m or more apart, without turning straight back"
    legs_m = np.hypot(*np.diff(np.array(scenario.path.waypoints_m)[:, :2], axis=0).T)
    for index in np.flatnonzero(legs_m < MIN_LEG_M).tolist():
        yield (*WAYPOINTS, index + 1), f"found a waypoint {legs_m[index]:.3g} m from the one before it", allowed
    if legs_m.min() < MIN_LEG_M:
        return
    try:
        length_m = scenario.written_path.length_m
    except PathError as error:
        yield (*WAYPOINTS, error.waypoint), str(error), allowed
    else:
        if length_m > MAX_PATH_M:
            found, maximum = distinct_texts(length_m, MAX_PATH_M)
            yield WAYPOINTS, f"found a path of {found} m", f"up to {maximum} m"
