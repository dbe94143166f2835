"""Writes paths in the formats of other programs: .plan, .waypoints, .kml, .gpx, .geojson, .csv.

Missions (.plan, .waypoints) hold one path, as items that an autopilot takes; the others hold one line per path. A
path's points are thinned to those that a polyline needs to stay within `TOLERANCE_M` of it (Douglas and Peucker, 1973).
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from formation_scenario.mission_files.mission import FenceCircle, FileFence, LatLon, MissionFileError
from formation_scenario.mission_files.thinning import kept

TOLERANCE_M: Final = 0.5
"""Greatest distance of an exported line from the path. Autopilots accept a waypoint from ten times as far."""
KML: Final = "http://www.opengis.net/kml/2.2"
GPX: Final = "http://www.topografix.com/GPX/1/1"


@dataclass(frozen=True)
class NamedPath:
    """A path to write: north, east and height above the origin, (N, 3) m."""

    name: str
    points_m: Array
    holds_s: Mapping[int, float] = field(default_factory=dict[int, float])
    """Times for which a vehicle hovers at points, by their index; missions alone have them."""


@dataclass(frozen=True)
class _Point:
    lat_deg: float
    lon_deg: float
    above_sea_m: float
    above_origin_m: float
    hold_s: float = 0.0


@dataclass(frozen=True)
class _Content:
    """What is written: lines by their names, and what missions have beside theirs."""

    lines: Mapping[str, Sequence[_Point]]
    origin: GeodeticOrigin
    fence: FileFence
    hovering: bool = False


def export(
    path: Path,
    paths: Sequence[NamedPath],
    origin: GeodeticOrigin,
    fence: FileFence | None = None,
    *,
    hovering: bool = False,
) -> None:
    """Write paths to a file in the format of its suffix.

    Args:
        path: the file.
        paths: one for missions, one or more for other formats.
        origin: of the paths.
        fence: geofence and rally points; of these formats `.plan` alone has them.
        hovering: whether they are multirotors' paths, which `.plan` says.

    Raises:
        MissionFileError: another suffix, several paths for a format that holds one, or a file that can't be written.
    """
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise MissionFileError(f"{path}: found a file '{path.suffix}'; allowed: {', '.join(WRITERS)}")
    if writer in (_plan, _waypoints) and len(paths) != 1:
        raise MissionFileError(f"{path}: found {len(paths)} paths; allowed: one in a mission ({path.suffix})")
    content = _Content({each.name: _line(each, origin) for each in paths}, origin, fence or FileFence(), hovering)
    try:
        path.write_text(writer(content), encoding="utf-8")
    except OSError as error:
        raise MissionFileError(f"{path}: {error.strerror or error}") from error


def _line(path: NamedPath, origin: GeodeticOrigin) -> list[_Point]:
    """Return the points of a path that a line needs, and those at which a vehicle hovers."""
    ends = sorted({0, *path.holds_s, len(path.points_m) - 1})
    needed = np.zeros(len(path.points_m), dtype=np.bool_)
    for begin, end in pairwise(ends):
        needed[begin : end + 1] |= kept(path.points_m[begin : end + 1], TOLERANCE_M)
    return [
        _point(path.points_m[each], origin, path.holds_s.get(each, 0.0)) for each in np.flatnonzero(needed).tolist()
    ]


def _point(point: Array, origin: GeodeticOrigin, hold_s: float = 0.0) -> _Point:
    north_m, east_m, height_m = point.tolist()
    lat_rad, lon_rad, above_sea_m = origin.from_ned(north_m, east_m, -height_m)
    return _Point(math.degrees(lat_rad), math.degrees(lon_rad), above_sea_m, height_m, hold_s)


def _home(origin: GeodeticOrigin) -> _Point:
    return _Point(math.degrees(origin.lat_rad), math.degrees(origin.lon_rad), origin.alt_m, 0.0)


def _plan(content: _Content) -> str:
    home, (points,) = _home(content.origin), content.lines.values()
    items = [
        {
            "AMSLAltAboveTerrain": None,
            "Altitude": round(point.above_origin_m, 3),
            "AltitudeMode": 1,
            "autoContinue": True,
            "command": 16,
            "doJumpId": number,
            "frame": 3,
            "params": [round(point.hold_s, 1), 0, 0, None, *_degrees(point), round(point.above_origin_m, 3)],
            "type": "SimpleItem",
        }
        for number, point in enumerate(points, 1)
    ]
    mission = {
        "cruiseSpeed": 15,
        "firmwareType": 12 if content.fence.any_inclusion else 3,
        "globalPlanAltitudeMode": 1,
        "hoverSpeed": 5,
        "items": items,
        "plannedHomePosition": [*_degrees(home), round(home.above_sea_m, 3)],
        "vehicleType": 2 if content.hovering else 1,
        "version": 2,
    }
    plan = {"fileType": "Plan", "groundStation": "gcs-formation", "mission": mission, "version": 1}
    return json.dumps(plan | _plan_fence(content.fence), indent=1) + "\n"


def _plan_fence(fence: FileFence) -> dict[str, object]:
    circles, polygons = list[object](), list[object]()
    for each in fence.areas:
        area: dict[str, object] = {"inclusion": each.inclusion, "version": 1}
        if isinstance(each, FenceCircle):
            circles.append(area | {"circle": {"center": _rounded(each.centre), "radius": each.radius_m}})
        else:
            polygons.append(area | {"polygon": [_rounded(corner) for corner in each.corners]})
    points = [[*_rounded((lat, lon)), round(up_m, 3)] for lat, lon, up_m in fence.rally]
    return {
        "geoFence": {"circles": circles, "polygons": polygons, "version": 2},
        "rallyPoints": {"points": points, "version": 2},
    }


def _waypoints(content: _Content) -> str:
    home, (points,) = _home(content.origin), content.lines.values()
    rows = [
        "QGC WPL 110",
        f"0\t1\t0\t16\t0\t0\t0\t0\t{home.lat_deg:.8f}\t{home.lon_deg:.8f}\t{home.above_sea_m:.3f}\t1",
    ]
    for number, point in enumerate(points, 1):
        lat, lon = _degrees(point)
        rows.append(
            f"{number}\t0\t3\t16\t{point.hold_s:.4g}\t0\t0\t0\t{lat:.8f}\t{lon:.8f}\t{point.above_origin_m:.3f}\t1"
        )
    return "\n".join(rows) + "\n"


def _kml(content: _Content) -> str:
    root = ET.Element("kml", xmlns=KML)
    document = ET.SubElement(root, "Document")
    for name, points in content.lines.items():
        placemark = ET.SubElement(document, "Placemark")
        ET.SubElement(placemark, "name").text = name
        line = ET.SubElement(placemark, "LineString")
        ET.SubElement(line, "altitudeMode").text = "absolute"
        triples = (f"{each.lon_deg:.8f},{each.lat_deg:.8f},{each.above_sea_m:.3f}" for each in points)
        ET.SubElement(line, "coordinates").text = " ".join(triples)
    return _xml(root)


def _gpx(content: _Content) -> str:
    root = ET.Element("gpx", xmlns=GPX, version="1.1", creator="gcs-formation")
    for name, points in content.lines.items():
        route = ET.SubElement(root, "rte")
        ET.SubElement(route, "name").text = name
        for each in points:
            point = ET.SubElement(route, "rtept", lat=f"{each.lat_deg:.8f}", lon=f"{each.lon_deg:.8f}")
            ET.SubElement(point, "ele").text = f"{each.above_sea_m:.3f}"
    return _xml(root)


def _geojson(content: _Content) -> str:
    features = []
    for name, points in content.lines.items():
        positions = [[*reversed(_degrees(each)), round(each.above_sea_m, 3)] for each in points]
        geometry = {"type": "LineString", "coordinates": positions}
        features.append({"type": "Feature", "properties": {"name": name}, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n"


def _csv(content: _Content) -> str:
    written = io.StringIO()
    table = csv.writer(written, lineterminator="\n")
    table.writerow(["path", "lat_deg", "lon_deg", "alt_m"])
    for name, points in content.lines.items():
        table.writerows([name, *_degrees(each), round(each.above_sea_m, 3)] for each in points)
    return written.getvalue()


def _degrees(point: _Point) -> LatLon:
    """Return latitude and longitude to 1e-8 degrees, 1 mm."""
    return _rounded((point.lat_deg, point.lon_deg))


def _rounded(point: LatLon) -> LatLon:
    return round(point[0], 8), round(point[1], 8)


def _xml(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


WRITERS: Final[Mapping[str, Callable[[_Content], str]]] = MappingProxyType(
    {
        ".plan": _plan,
        ".waypoints": _waypoints,
        ".kml": _kml,
        ".gpx": _gpx,
        ".geojson": _geojson,
        ".csv": _csv,
    }
)
