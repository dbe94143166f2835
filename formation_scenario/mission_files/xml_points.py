"""KML of Google Earth and GPX of GPS receivers: lines, routes and tracks as waypoints.

Sources: OGC 12-007r2 (KML 2.3; 9.2 "AltitudeMode"), Google's extension `gx:Track`; GPX 1.1 schema.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.etree import ElementTree as ET

from formation_scenario.mission_files.mission import Datum, Mission, MissionFileError
from formation_scenario.mission_files.points import Lines, Point, first_line

ALTITUDE_MODES: Final[dict[str, Datum]] = {"absolute": "sea level", "relativeToGround": "ground"}
"""KML's; `clampToGround`, its default, has no height."""
KML_ALLOWED: Final = "KML with a LineString, a gx:Track, or Points"
GPX_ALLOWED: Final = "GPX with a route, a track, or waypoints"


def read_kml(text: str, file: str) -> Mission:
    """Return the first line or track of a KML file; without one, its points in their order.

    Raises:
        MissionFileError: no XML, or nothing in it to fly.
    """
    root = _root(text, file, "kml", KML_ALLOWED)
    lines = [_line(each, file, index) for index, each in enumerate(_all(root, "LineString"), 1)]
    tracks = [_track(each, file, index) for index, each in enumerate(_all(root, "Track"), 1)]
    points = (point for index, each in enumerate(_all(root, "Point"), 1) for point in _line(each, file, index))
    return first_line(
        file, (Lines("line", lines), Lines("track", tracks, track=True), Lines("point", [points])), KML_ALLOWED
    )


def read_gpx(text: str, file: str) -> Mission:
    """Return the first route of a GPX file; without one its first track, whole; without one its waypoints.

    Raises:
        MissionFileError: no XML, or nothing in it to fly.
    """
    root = _root(text, file, "gpx", GPX_ALLOWED)
    routes = [_gpx_points(_all(each, "rtept"), f"{file}: rtept") for each in _all(root, "rte")]
    tracks = [_gpx_points(_all(each, "trkpt"), f"{file}: trkpt") for each in _all(root, "trk")]
    points = _gpx_points(_all(root, "wpt"), f"{file}: wpt")
    return first_line(
        file, (Lines("route", routes), Lines("track", tracks, track=True), Lines("waypoint", [points])), GPX_ALLOWED
    )


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


def _line(element: ET.Element, file: str, index: int) -> Iterator[Point]:
    triples = (each.split(",") for each in (_text(element, "coordinates") or "").split())
    return _kml_points(element, triples, f"{file}: {_name(element)} {index}")


def _track(element: ET.Element, file: str, index: int) -> Iterator[Point]:
    coords = ((each.text or "").split() for each in element if _name(each) == "coord")
    return _kml_points(element, coords, f"{file}: track {index}")


def _kml_points(element: ET.Element, points: Iterator[list[str]], within: str) -> Iterator[Point]:
    datum = ALTITUDE_MODES.get((_text(element, "altitudeMode") or "").strip())
    for index, point in enumerate(points, 1):
        where = f"{within}, point {index}"
        if not 2 <= len(point) <= 3:
            raise MissionFileError(f"{where}: found {','.join(point)!r}; allowed: longitude,latitude,height")
        height = point[2] if datum is not None and len(point) == 3 else None
        yield Point(where, point[1], point[0], height, datum or "sea level")


def _gpx_points(points: list[ET.Element], within: str) -> Iterator[Point]:
    for index, point in enumerate(points, 1):
        yield Point(f"{within} {index}", point.get("lat"), point.get("lon"), _text(point, "ele"))
