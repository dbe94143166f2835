"""GeoJSON (.geojson, .json): a line, several points, or a collection of them. Source: RFC 7946.

The third number of a position is taken as a height above sea level, as programs write it; RFC 7946 says above the
ellipsoid.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any, Final

from formation_scenario.mission_files.mission import (
    MAX_ITEMS,
    Mission,
    MissionFileError,
    MissionItem,
    degrees,
    number,
    waypoint,
)

ALLOWED: Final = "GeoJSON with a LineString, a MultiPoint, or Points"


def read_geojson(text: str, file: str) -> Mission:
    """Return the first line of a GeoJSON file; without one, its points in their order.

    Raises:
        MissionFileError: no GeoJSON, or nothing in it to fly.
    """
    try:
        data: object = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise MissionFileError(f"{file}: not JSON: {error}") from error
    geometries = list(_geometries(data))
    lines = [each for each in geometries if each.get("type") == "LineString"]
    multi = [each for each in geometries if each.get("type") == "MultiPoint"]
    points = [each.get("coordinates") for each in geometries if each.get("type") == "Point"]
    chosen = next((each.get("coordinates") for each in (*lines, *multi)), points)
    if not isinstance(chosen, list) or len(chosen) < 2:
        raise MissionFileError(f"{file}: nothing to fly; allowed: {ALLOWED}, 2 or more positions")
    if len(chosen) > MAX_ITEMS:
        raise MissionFileError(f"{file}: found {len(chosen)} positions; allowed: up to {MAX_ITEMS}")
    items = tuple(_item(each, f"{file}: position {index}") for index, each in enumerate(chosen, 1))
    others = len(lines) + len(multi) - 1
    remarks = (f"{file}: {others} other lines not flown",) if others > 0 else ()
    return Mission(file, items, tuple(range(1, 1 + len(items))), remarks=remarks)


def _geometries(data: object, depth: int = 0) -> Iterator[dict[str, Any]]:
    """Yield the geometries of a document in their order."""
    if not isinstance(data, dict) or depth > 10:
        return
    for key in ("features", "geometries"):
        inner = data.get(key)
        for each in inner if isinstance(inner, list) else ():
            yield from _geometries(each, depth + 1)
    if data.get("type") == "Feature":
        yield from _geometries(data.get("geometry"), depth + 1)
    elif "coordinates" in data:
        yield data


def _item(position: object, where: str) -> MissionItem:
    if not isinstance(position, list) or len(position) < 2:
        raise MissionFileError(f"{where}: found {position!r:.40}; allowed: [longitude, latitude, height]")
    height_m = number(position[2], where, "height") if len(position) > 2 else math.nan
    lat, lon = degrees(position[1], where, "latitude"), degrees(position[0], where, "longitude")
    return waypoint(where, lat, lon, height_m)
