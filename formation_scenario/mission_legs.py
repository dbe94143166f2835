"""What a mission file says of single legs, as keys of a path: circles at their ends, and which points are left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from flight_model.arrays import Array
from formation_scenario.mission_files import RoutePoint
from formation_scenario.mission_files.thinning import smoothed
from formation_scenario.path_plan import PathPlan
from formation_scenario.source import Key, Plain

DEFAULT_MPS: Final = float(PathPlan.model_fields["speed_mps"].default)
ALMOST: Final = 1e-6
"""A share of a circle that is none."""


def circles_of(points: Sequence[RoutePoint], speed: Plain, *, hovering: bool = False) -> tuple[list[Plain], list[str]]:
    """Return `path.circles` for the circles of a route, and what of them isn't flown, in words.

    Args:
        points: of the route.
        speed: the path's airspeed, or those of its legs, m/s; a time becomes the circles that take it.
        hovering: whether the vehicles hover for a time, and climb to a height along the leg, instead of circling.
    """
    found, remarks, legs = list[Plain](), list[str](), speed if isinstance(speed, list) else [speed]
    for index, point in enumerate(points):
        circles = point.circles
        if circles is None or (hovering and not circles.turns > 0.0):
            continue
        if index == 0:
            remarks.append(f"{point.where}: circles where the path begins aren't flown")
            continue
        leg_mps, turns = legs[min(index, len(legs)) - 1], circles.turns
        speed_mps = float(leg_mps) if isinstance(leg_mps, int | float) else DEFAULT_MPS
        if math.isfinite(circles.seconds):
            turns = circles.seconds * speed_mps / (2.0 * math.pi * abs(circles.radius_m))
        found.append({"waypoint": index, "turns": math.ceil(turns - ALMOST), "radius_m": circles.radius_m})
    return found, remarks


def stops_of(points: Sequence[RoutePoint], *, hovering: bool) -> tuple[list[Plain], list[str]]:
    """Return `path.stops` for the times that vehicles stay at points of a route, and what isn't flown, in words.

    Fixed wings circle for the time of a loiter; that of a waypoint they ignore, as autopilots do.
    """
    found, ends, ignored = list[Plain](), list[str](), list[str]()
    for index, point in enumerate(points):
        seconds = point.hover_s if hovering else point.hold_s or None
        if seconds is None:
            continue
        if not hovering:
            ignored.append(point.where)
        elif index in (0, len(points) - 1):
            ends.append(point.where)
        else:
            found.append({"waypoint": index, "hold_s": seconds})
    remarks = [f"{named(ends)}: a stop where the path begins or ends isn't flown"] if ends else []
    remarks += [f"{named(ignored)}: vehicles that can't hover don't stop"] if ignored else []
    return found, remarks


def named(names: Sequence[str]) -> str:
    """Return names as a list, of many the first."""
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def thinned_with_keys(waypoints: Array, path: dict[Key, Plain], tolerance_m: float) -> tuple[Array, dict[Key, Plain]]:
    """Return waypoints (K, 3) that pass (N, 3) within a tolerance, and the keys of their speeds, circles and stops."""
    legs = path.get("speed_mps")
    each_mps = legs if isinstance(legs, list) else [legs] * (len(waypoints) - 1)
    of_waypoints = {name: _by_waypoint(path.get(name)) for name in ("circles", "stops") if path.get(name)}
    changes = {leg for leg in range(1, len(each_mps)) if each_mps[leg] != each_mps[leg - 1]}
    kept, speeds = [waypoints[:1]], list[Plain]()
    moved: dict[Key, Plain] = {name: list[Plain]() for name in of_waypoints}
    fixed = {0, len(each_mps)} | changes | {int(str(each)) for known in of_waypoints.values() for each in known}
    for begin, end in pairwise(sorted(fixed)):
        part = smoothed(waypoints[begin : end + 1], tolerance_m)[1:]
        kept.append(part)
        speeds += [each_mps[begin]] * len(part)
        for name, known in of_waypoints.items():
            now = moved[name]
            if end in known and isinstance(now, list):
                now.append(known[end] | {"waypoint": len(speeds)})
    path = path | ({"speed_mps": speeds} if isinstance(legs, list) else {})
    return np.concatenate(kept), path | moved


def _by_waypoint(keys: Plain) -> dict[Plain, dict[Key, Plain]]:
    return {each["waypoint"]: each for each in keys if isinstance(each, dict)} if isinstance(keys, list) else {}
