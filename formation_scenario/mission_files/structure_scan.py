"""QGroundControl's structure scan: loops round a building, layer by layer, at a distance from its walls.

A plan holds what the user drew, not the items that come of it. They are made here as QGroundControl makes them: an
entrance above the first corner of the flown polygon, one closed loop per layer half a camera footprint inside the
structure's top or bottom, the exit where the entrance was.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

from flight_model.earth import GeodeticOrigin
from formation_scenario.mission_files.mission import LatLon, MissionFileError, MissionItem, degrees, number

MAX_LAYERS: Final = 200
SHARPEST: Final = 0.1
"""Least cosine of half the angle between neighbouring walls' normals: a sharper corner is cut, not followed out."""


def structure_scan(entry: dict[str, Any], where: str) -> Iterator[MissionItem]:
    """Yield the waypoints of a structure scan, heights above home.

    Raises:
        MissionFileError: it lacks something, or its polygon has no area.
    """
    camera = entry.get("CameraCalc")
    if not isinstance(camera, dict) or not isinstance(corners := entry.get("polygon"), list) or len(corners) < 3:
        raise MissionFileError(f"{where}: a structure scan without `CameraCalc`, or a polygon of 3 corners")
    walls = [(degrees(lat, where, "latitude"), degrees(lon, where, "longitude")) for lat, lon, *_ in corners]
    loop = offset(walls, number(camera.get("DistanceToSurface"), where, "CameraCalc.DistanceToSurface"), where)
    layer_m = number(camera.get("AdjustedFootprintFrontal"), where, "CameraCalc.AdjustedFootprintFrontal")
    layers = int(number(entry.get("Layers"), where, "Layers"))
    if not 1 <= layers <= MAX_LAYERS:
        raise MissionFileError(f"{where}: found {layers} layers; allowed: 1 to {MAX_LAYERS}")
    down = entry.get("StartFromTop") is True
    first_m = number(entry.get("StructureHeight" if down else "ScanBottomAlt"), where, "height")
    step_m = -layer_m if down else layer_m
    entrance_m = number(entry.get("EntranceAltitude"), where, "EntranceAltitude")
    yield _waypoint(where, loop[0], entrance_m)
    for layer in range(layers):
        for corner in (*loop, loop[0]):
            yield _waypoint(where, corner, first_m + (layer + 0.5) * step_m)
    yield _waypoint(where, loop[0], entrance_m)


def offset(polygon: Sequence[LatLon], distance_m: float, where: str) -> list[LatLon]:
    """Return a polygon whose walls lie this far outside those of another, each corner moved along its bisector.

    Raises:
        MissionFileError: a polygon without area.
    """
    origin = GeodeticOrigin(math.radians(polygon[0][0]), math.radians(polygon[0][1]), 0.0)
    flat = [origin.to_ned(math.radians(lat), math.radians(lon), 0.0)[:2] for lat, lon in polygon]
    pairs = [(one, other) for one, other in zip(flat, [*flat[1:], flat[0]], strict=True) if math.dist(one, other) > 0]
    area = sum(one[0] * other[1] - other[0] * one[1] for one, other in pairs)
    if abs(area) < 1.0 or len(pairs) < 3:
        raise MissionFileError(f"{where}: its polygon has no area")
    outward = -math.copysign(1.0, area)
    normals = [_normal(one, other, outward) for one, other in pairs]
    moved = list[LatLon]()
    for (corner, _), before, after in zip(pairs, [normals[-1], *normals[:-1]], normals, strict=True):
        north, east = before[0] + after[0], before[1] + after[1]
        half = math.hypot(north, east) / 2.0
        reach_m = distance_m / max(half, SHARPEST) / (2.0 * max(half, SHARPEST))
        lat, lon, _ = origin.from_ned(corner[0] + reach_m * north, corner[1] + reach_m * east, 0.0)
        moved.append((math.degrees(lat), math.degrees(lon)))
    return moved


def _normal(one: tuple[float, float], other: tuple[float, float], outward: float) -> tuple[float, float]:
    """Return the unit normal of a wall."""
    north, east = other[0] - one[0], other[1] - one[1]
    length = math.hypot(north, east)
    return -outward * east / length, outward * north / length


def _waypoint(where: str, position: LatLon, height_m: float) -> MissionItem:
    return MissionItem(where, 16, 3, (math.nan,) * 4, *position, height_m)
