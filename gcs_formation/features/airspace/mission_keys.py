"""Keys of the fence that a mission file's geofence and rally points are."""

from __future__ import annotations

import math

from flight_model.earth import GeodeticOrigin
from formation_scenario.mission_files.mission import FenceCircle, FencePolygon, FileFence, LatLon
from formation_scenario.source import Key, Plain


def fence_keys(fence: FileFence, origin: GeodeticOrigin, home_m: float) -> dict[Key, Plain]:
    """Return the keys of `safety.fence` that a file's geofence and rally points are.

    The first polygon to stay in is `corners_m`, everything else `areas`.

    Args:
        fence: the file's.
        origin: the scenario's.
        home_m: height of the file's home, from which rally points are measured, above the origin.
    """
    keys, areas = dict[Key, Plain](), list[Plain]()
    for each in fence.areas:
        if isinstance(each, FencePolygon) and each.inclusion and "corners_m" not in keys:
            keys["corners_m"] = _corners(each, origin)
        else:
            areas.append(_area(each, origin))
    if areas:
        keys["areas"] = areas
    if fence.any_inclusion and sum(each.inclusion for each in fence.areas) > 1:
        keys["inclusions"] = "any"
    if fence.rally:
        keys["rally_m"] = [[*_north_east(origin, (lat, lon)), up_m + home_m] for lat, lon, up_m in fence.rally]
    return keys


def _area(area: FenceCircle | FencePolygon, origin: GeodeticOrigin) -> Plain:
    kind: dict[Key, Plain] = {"kind": "inclusion" if area.inclusion else "exclusion"}
    if isinstance(area, FencePolygon):
        return kind | {"corners_m": _corners(area, origin)}
    return kind | {"centre_m": _north_east(origin, area.centre), "radius_m": area.radius_m}


def _corners(area: FencePolygon, origin: GeodeticOrigin) -> list[Plain]:
    return [_north_east(origin, each) for each in area.corners]


def _north_east(origin: GeodeticOrigin, position: LatLon) -> list[Plain]:
    lat_deg, lon_deg = position
    north_m, east_m, _ = origin.to_ned(math.radians(lat_deg), math.radians(lon_deg), 0.0)
    return [north_m, east_m]
