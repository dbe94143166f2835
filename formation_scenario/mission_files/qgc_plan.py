"""QGroundControl's plan files (.plan): JSON with simple and complex items, fence and rally points.

Source: QGroundControl developer guide, "Plan File Format"; of structure scans, its mission manager's behaviour.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final, cast

from formation_scenario.mission_files.mission import (
    FenceCircle,
    FencePolygon,
    FileFence,
    LatLon,
    Mission,
    MissionFileError,
    MissionItem,
    RallyPoint,
    degrees,
    number,
)
from formation_scenario.mission_files.structure_scan import structure_scan

JsonObject = dict[str, Any]
PX4: Final = 12
"""MAV_AUTOPILOT_PX4 at `firmwareType`."""
NOT_FLOWN = ("fwLandingPattern", "vtolLandingPattern")


def read_plan(text: str, file: str) -> Mission:
    """Return the mission of a plan file's text; `file` names it in messages.

    Raises:
        MissionFileError: no JSON, no plan, or an item that isn't complete.
    """
    try:
        plan: object = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise MissionFileError(f"{file}: not JSON: {error}") from error
    if not isinstance(plan, dict) or plan.get("fileType") != "Plan" or not isinstance(plan.get("mission"), dict):
        raise MissionFileError(f"{file}: no plan; allowed: JSON with `fileType: Plan` and `mission`, of QGroundControl")
    mission = cast("JsonObject", plan["mission"])
    reader = _Items(file)
    reader.read(_list(mission, "items", file))
    home, fence = mission.get("plannedHomePosition"), plan.get("geoFence")
    if isinstance(fence, dict) and fence.get("breachReturn") is not None:
        reader.remarks.append(f"{file}: geoFence: breachReturn isn't used: who is held at the fence flies on")
    return Mission(
        file,
        tuple(reader.items),
        tuple(reader.jump_targets),
        None if home is None else _position(home, f"{file}: plannedHomePosition"),
        FileFence(
            tuple(_fence(fence, file)),
            tuple(_rally(plan.get("rallyPoints"), file)),
            any_inclusion=mission.get("firmwareType") == PX4,
        ),
        remarks=tuple(reader.remarks),
    )


class _Items:
    """Flattens simple and complex items."""

    def __init__(self, file: str) -> None:
        self.items = list[MissionItem]()
        self.jump_targets = list[int]()
        self.remarks = list[str]()
        self._file = file

    def read(self, entries: list[Any], within: str = "") -> None:
        for index, entry in enumerate(entries, 1):
            where = f"{self._file}: {within}item {index}"
            if not isinstance(entry, dict):
                raise MissionFileError(f"{where}: found {type(entry).__name__}; allowed: a mission item")
            if entry.get("type") == "ComplexItem":
                self._complex(entry, where, f"{within}item {index}, ")
            else:
                self._simple(entry, where)

    def _simple(self, entry: JsonObject, where: str) -> None:
        params = _list(entry, "params", where)
        if len(params) == 4:  # plans of 2017 have the position separately
            params = [*params, *_list(entry, "coordinate", where)]
        if len(params) != 7:
            raise MissionFileError(f"{where}: found {len(params)} params; allowed: 7")
        frame = int(number(entry.get("frame"), where, "frame"))
        command = int(number(entry.get("command"), where, "command"))
        values = [math.nan if each is None else number(each, where, f"param {i}") for i, each in enumerate(params, 1)]
        first, second, third, fourth, lat, lon, height = values
        if frame == 2:
            lat = lon = height = math.nan
        self.items.append(MissionItem(where, command, frame, (first, second, third, fourth), lat, lon, height))
        target = entry.get("doJumpId")
        self.jump_targets.append(target if isinstance(target, int) else len(self.items))

    def _complex(self, entry: JsonObject, where: str, within: str) -> None:
        kind = str(entry.get("complexItemType"))
        if kind == "StructureScan":
            for item in structure_scan(entry, where):
                self.items.append(item)
                self.jump_targets.append(-1)
            return
        transects = entry.get("TransectStyleComplexItem")
        if isinstance(transects, dict):  # surveys and corridors hold the items that QGroundControl made of them
            begin = len(self.items)
            if items := transects.get("Items"):
                self.read(items, within)
                self._fill_heights(begin, transects)
            else:
                self._transects(transects, where)
        elif kind in NOT_FLOWN:
            self.remarks.append(f"{where}: {kind} isn't flown: the path ends before it")
            self.items.append(MissionItem(where, 189, 2, (math.nan,) * 4, math.nan, math.nan, math.nan))
            self.jump_targets.append(-1)
        else:
            known = ("survey", "CorridorScan", "StructureScan", *NOT_FLOWN)
            raise MissionFileError(f"{where}: found a complex item '{kind}'; allowed: {', '.join(known)}")

    def _fill_heights(self, begin: int, transects: JsonObject) -> None:
        """Give items without a height that of the survey above the ground, as some programs leave it to it."""
        height = _surface_m(transects)
        for index, item in enumerate(self.items[begin:], begin):
            if item.placed and math.isnan(item.height_m) and isinstance(height, int | float):
                self.items[index] = replace(item, height_m=float(height))

    def _transects(self, transects: JsonObject, where: str) -> None:
        """Take the turning points as drawn, where a plan was saved without the items made of them."""
        points = _list(transects, "VisualTransectPoints", where)
        height_m = number(_surface_m(transects), where, "CameraCalc.DistanceToSurface")
        for point in points:
            lat, lon = _lat_lon(point, where)
            self.items.append(MissionItem(where, 16, 3, (math.nan,) * 4, lat, lon, height_m))
            self.jump_targets.append(-1)


def _surface_m(transects: JsonObject) -> object:
    """Return the distance of a survey to what it photographs, if the file has one."""
    camera = transects.get("CameraCalc")
    return camera.get("DistanceToSurface") if isinstance(camera, dict) else None


def _fence(fence: object, file: str) -> Iterator[FenceCircle | FencePolygon]:
    if not isinstance(fence, dict):
        return
    for index, circle in enumerate(_list(fence, "circles", file, optional=True), 1):
        where = f"{file}: geoFence circle {index}"
        shape = circle.get("circle") if isinstance(circle, dict) else None
        if not isinstance(shape, dict):
            raise MissionFileError(f"{where}: no circle")
        radius_m = number(shape.get("radius"), where, "radius")
        if radius_m <= 0.0:
            raise MissionFileError(f"{where}: found {radius_m:g} as its radius; allowed: a number > 0")
        yield FenceCircle(_lat_lon(shape.get("center"), where), radius_m, circle.get("inclusion") is not False)
    for index, polygon in enumerate(_list(fence, "polygons", file, optional=True), 1):
        where = f"{file}: geoFence polygon {index}"
        yield _polygon(_list(polygon, "polygon", where), where, inclusion=polygon.get("inclusion") is not False)
    if only := _list(fence, "polygon", file, optional=True):  # version 1: one polygon to stay in
        yield _polygon(only, f"{file}: geoFence polygon", inclusion=True)


def _polygon(corners: list[Any], where: str, *, inclusion: bool) -> FencePolygon:
    if len(corners) < 3:
        raise MissionFileError(f"{where}: found {len(corners)} corners; allowed: 3 or more")
    return FencePolygon(tuple(_lat_lon(each, where) for each in corners), inclusion)


def _rally(rally: object, file: str) -> Iterator[RallyPoint]:
    if isinstance(rally, dict):
        for index, point in enumerate(_list(rally, "points", file, optional=True), 1):
            where = f"{file}: rally point {index}"
            lat, lon, height_m = _position(point, where)
            if math.isnan(height_m):
                raise MissionFileError(f"{where}: found no height; allowed: [latitude, longitude, height above home]")
            yield lat, lon, height_m


def _position(point: object, where: str) -> tuple[float, float, float]:
    """Return latitude, longitude and height; the height is NaN where there is none."""
    height = point[2] if isinstance(point, list) and len(point) > 2 else None
    return (*_lat_lon(point, where), math.nan if height is None else number(height, where, "height"))


def _lat_lon(point: object, where: str) -> LatLon:
    if not isinstance(point, list) or len(point) < 2:
        raise MissionFileError(f"{where}: found {point!r:.40}; allowed: [latitude, longitude]")
    return degrees(point[0], where, "latitude"), degrees(point[1], where, "longitude")


def _list(mapping: object, key: str, where: str, *, optional: bool = False) -> list[Any]:
    found = mapping.get(key) if isinstance(mapping, dict) else None
    if found is None and optional:
        return []
    if not isinstance(found, list):
        raise MissionFileError(f"{where}: found {type(found).__name__} at `{key}`; allowed: a list")
    return found
