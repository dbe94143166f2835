"""KML of Google Earth and GPX of GPS receivers: lines, routes and tracks as waypoints.

Sources: OGC 12-007r2 (KML 2.3; 9.2 "AltitudeMode"), Google's extension `gx:Track`; GPX 1.1 schema.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final
from xml.etree import ElementTree as ET

from formation_scenario.mission_files.mission import (
    MAX_ITEMS,
    Datum,
    Mission,
    MissionFileError,
    MissionItem,
    degrees,
    number,
    waypoint,
)

ALTITUDE_MODES: Final[dict[str, Datum]] = {"absolute": "sea level", "relativeToGround": "ground"}
"""KML's; `clampToGround`, its default, has no height."""
KML_ALLOWED: Final = "KML with a LineString, a gx:Track, or Points"


def read_kml(text: str, file: str) -> Mission:
    """Return the first line or track of a KML file; without one, its points in their order.

    Raises:
        MissionFileError: no XML, or nothing in it to fly.
    """
    root = _root(text, file, "kml", KML_ALLOWED)
    lines = [_line(each, file, index) for index, each in enumerate(_all(root, "LineString"), 1)]
    tracks = [_track(each, file, index) for index, each in enumerate(_all(root, "Track"), 1)]
    points = [item for index, each in enumerate(_all(root, "Point"), 1) for item in _line(each, file, index)]
    for found, kind, track in ((lines, "line", False), (tracks, "track", True), ([points], "point", False)):
        if found and len(found[0]) > 1:
            others = len(found) - 1
            remark = (f"{file}: {others} other {kind}{'s' if others > 1 else ''} not flown",) if others else ()
            return _mission(file, found[0], track=track, remarks=remark)
    raise MissionFileError(f"{file}: nothing to fly; allowed: {KML_ALLOWED}")


def read_gpx(text: str, file: str) -> Mission:
    """Return the first route of a GPX file; without one its first track, whole; without one its waypoints.

    Raises:
        MissionFileError: no XML, or nothing in it to fly.
    """
    root = _root(text, file, "gpx", "GPX with a route, a track, or waypoints")
    for around, inner, track in (("rte", "rtept", False), ("trk", "trkpt", True), ("gpx", "wpt", False)):
        found = [root] if around == "gpx" else _all(root, around)
        points = _gpx_points(_all(found[0], inner), file, inner) if found else []
        if len(points) > 1:
            others = len(found) - 1
            remark = (f"{file}: {others} other <{around}> not flown",) if others else ()
            return _mission(file, points, track=track, remarks=remark)
    raise MissionFileError(f"{file}: nothing to fly; allowed: 2 or more points of a route, a track, or waypoints")


def _mission(file: str, items: list[MissionItem], *, track: bool, remarks: tuple[str, ...]) -> Mission:
    return Mission(file, tuple(items), tuple(range(1, 1 + len(items))), track=track, remarks=remarks)


def _root(text: str, file: str, name: str, allowed: str) -> ET.Element:
    """Return the root of an XML document.

    A document type is refused: mission files have none, and its entities could expand to any size.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise MissionFileError(f"{file}: found a document type; allowed: {allowed}")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise MissionFileError(f"{file}: not XML: {error}") from error
    if _name(root) != name:
        raise MissionFileError(f"{file}: found <{_name(root)}>; allowed: {allowed}")
    return root


def _name(element: ET.Element) -> str:
    """Return a tag without its namespace."""
    return element.tag.rpartition("}")[2]


def _all(root: ET.Element, name: str) -> list[ET.Element]:
    return [each for each in root.iter() if _name(each) == name]


def _text(element: ET.Element, name: str) -> str | None:
    return next((each.text for each in element if _name(each) == name), None)


def _line(element: ET.Element, file: str, index: int) -> list[MissionItem]:
    datum = ALTITUDE_MODES.get((_text(element, "altitudeMode") or "").strip())
    triples = (_text(element, "coordinates") or "").split()
    return list(_kml_points((each.split(",") for each in triples), datum, f"{file}: {_name(element)} {index}"))


def _track(element: ET.Element, file: str, index: int) -> list[MissionItem]:
    datum = ALTITUDE_MODES.get((_text(element, "altitudeMode") or "").strip())
    coords = ((each.text or "").split() for each in element if _name(each) == "coord")
    return list(_kml_points(coords, datum, f"{file}: track {index}"))


def _kml_points(points: Iterable[list[str]], datum: Datum | None, within: str) -> Iterator[MissionItem]:
    for index, point in enumerate(points, 1):
        where = f"{within}, point {index}"
        if index > MAX_ITEMS:
            raise MissionFileError(f"{within}: more than {MAX_ITEMS} points")
        if not 2 <= len(point) <= 3:
            raise MissionFileError(f"{where}: found {','.join(point)!r}; allowed: longitude,latitude,height")
        height_m = number(point[2], where, "height") if datum is not None and len(point) == 3 else math.nan
        lat, lon = degrees(point[1], where, "latitude"), degrees(point[0], where, "longitude")
        yield waypoint(where, lat, lon, height_m, datum or "sea level")


def _gpx_points(points: list[ET.Element], file: str, kind: str) -> list[MissionItem]:
    if len(points) > MAX_ITEMS:
        raise MissionFileError(f"{file}: found {len(points)} points; allowed: up to {MAX_ITEMS}")
    items = list[MissionItem]()
    for index, point in enumerate(points, 1):
        where = f"{file}: {kind} {index}"
        height = _text(point, "ele")
        height_m = math.nan if height is None else number(height, where, "height")
        lat, lon = degrees(point.get("lat"), where, "latitude"), degrees(point.get("lon"), where, "longitude")
        items.append(waypoint(where, lat, lon, height_m))
    return items
