"""GeoJSON (.geojson, .json): a line, several points, or a collection of them. Source: RFC 7946.

The third number of a position is taken as a height above sea level, as programs write it; RFC 7946 says above the
ellipsoid.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from formation_scenario.mission_files.mission import Mission, MissionFileError
from formation_scenario.mission_files.points import Lines, Point, first_line

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
    found: dict[str, list[Any]] = {"LineString": [], "MultiPoint": [], "Point": []}
    for each in geometries:
        found.get(str(each.get("type")), []).append(each.get("coordinates"))
    lines = [_points(each, file) for each in (*found["LineString"], *found["MultiPoint"])]
    return first_line(file, (Lines("line", lines), Lines("point", [_points(found["Point"], file)])), ALLOWED)


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


def _points(positions: object, file: str) -> Iterator[Point]:
    for index, position in enumerate(positions if isinstance(positions, list) else (), 1):
        where = f"{file}: position {index}"
        if not isinstance(position, list) or len(position) < 2:
            raise MissionFileError(f"{where}: found {position!r:.40}; allowed: [longitude, latitude, height]")
        yield Point(where, position[1], position[0], position[2] if len(position) > 2 else None)
