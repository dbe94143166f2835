"""Where vehicles must stay, as mission files have it: a geofence and rally points."""

from __future__ import annotations

import math

from flight_model.earth import GeodeticOrigin
from flight_model.fence_geometry import Circle
from formation_scenario.geofence import Geofence
from formation_scenario.mission_files.mission import FenceCircle, FencePolygon, FileFence, LatLon, RallyPoint


def file_fence(fence: Geofence | None, origin: GeodeticOrigin) -> FileFence:
    """Return a scenario's fence as mission files have it; its heights are no part of that."""
    if fence is None:
        return FileFence()
    areas = list[FenceCircle | FencePolygon]()
    for each in () if fence.sides is None else fence.sides.areas:
        if isinstance(each.shape, Circle):
            north_m, east_m = each.shape.centre_m.tolist()
            areas.append(FenceCircle(_lat_lon(origin, north_m, east_m), each.shape.radius_m, each.inclusion))
        else:
            corners = tuple(_lat_lon(origin, north_m, east_m) for north_m, east_m in each.shape.corners_m.tolist())
            areas.append(FencePolygon(corners, each.inclusion))
    rally = tuple[RallyPoint, ...]((*_lat_lon(origin, each[0], each[1]), each[2]) for each in fence.rally_positions_m)
    any_inclusion = fence.sides is not None and fence.sides.any_inclusion
    return FileFence(tuple(areas), rally, any_inclusion and sum(each.inclusion for each in areas) > 1)


def _lat_lon(origin: GeodeticOrigin, north_m: float, east_m: float) -> LatLon:
    lat_rad, lon_rad, _ = origin.from_ned(north_m, east_m, 0.0)
    return math.degrees(lat_rad), math.degrees(lon_rad)
