"""What a mission file says of single legs, as keys of a path: circles at their ends, and which points are left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from flight_model.arrays import Array
from formation_scenario.mission_files import RoutePoint
from formation_scenario.mission_files.export import smoothed
from formation_scenario.path_plan import PathPlan
from formation_scenario.source import Key, Plain

DEFAULT_MPS: Final = float(PathPlan.model_fields["speed_mps"].default)
ALMOST: Final = 1e-6
"""A share of a circle that is none."""


def circles_of(points: Sequence[RoutePoint], speed: Plain) -> tuple[list[Plain], list[str]]:
    """Return `path.circles` for the circles of a route, and what of them isn't flown, in words.

    `speed`: the path's airspeed, or those of its legs, m/s; a time becomes the circles that take it.
    """
    found, remarks, legs = list[Plain](), list[str](), speed if isinstance(speed, list) else [speed]
    for index, point in enumerate(points):
        circles = point.circles
        if circles is None:
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


def thinned_with_keys(waypoints: Array, path: dict[Key, Plain], tolerance_m: float) -> tuple[Array, dict[Key, Plain]]:
    """Return waypoints (K, 3) that pass (N, 3) within a tolerance, and the keys of their speeds and circles."""
    legs, circles = path.get("speed_mps"), path.get("circles")
    each_mps = legs if isinstance(legs, list) else [legs] * (len(waypoints) - 1)
    circling = (
        {each["waypoint"]: each for each in circles if isinstance(each, dict)} if isinstance(circles, list) else {}
    )
    changes = {leg for leg in range(1, len(each_mps)) if each_mps[leg] != each_mps[leg - 1]}
    kept, speeds, moved = [waypoints[:1]], list[Plain](), list[Plain]()
    for begin, end in pairwise(sorted({0, len(each_mps)} | changes | {int(str(each)) for each in circling})):
        part = smoothed(waypoints[begin : end + 1], tolerance_m)[1:]
        kept.append(part)
        speeds += [each_mps[begin]] * len(part)
        moved += [circling[end] | {"waypoint": len(speeds)}] if end in circling else []
    path = path | ({"speed_mps": speeds} if isinstance(legs, list) else {})
    return np.concatenate(kept), path | ({"circles": moved} if moved else {})
