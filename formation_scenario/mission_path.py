"""The path, origin and fence of a scenario whose waypoints are a mission file's, or are latitudes and longitudes.

`path.file` and `path.waypoints_deg` become the keys that a scenario would have otherwise, before it is typed: a path of
legs through `waypoints_m`, the file's home as the origin, its fence as `safety.fence`. What the scenario itself says
wins. So everything after this, and `run.yaml`, knows one form of a path. What of a file isn't flown stands in
`path.not_flown`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeGuard

import numpy as np
from pydantic import ValidationError

from flight_model.arrays import Array
from flight_model.earth import GeodeticOrigin
from formation_scenario.feature_folders import brought
from formation_scenario.fields import MAX_DISTANCE_M, FileError, ScenarioError
from formation_scenario.mission_files import MissionFileError, RoutePoint, read_mission, route_of
from formation_scenario.mission_legs import DEFAULT_MPS, circles_of, named, stops_of, thinned_with_keys
from formation_scenario.path_plan import TOLERANCE_M
from formation_scenario.source import Key, Plain, Source, kind, plain_mapping
from formation_scenario.surroundings import Terrain
from formation_scenario.terrain import ground_of

FORMS: Final = ("waypoints_m", "waypoints_deg", "file")
"""Keys of which a path has one."""
_Points = list[tuple[float, float, float]]


def with_mission(source: Source, directory: Path, *, hovering: bool = False) -> Source:
    """Return the scenario with its waypoints in metres, whatever they were given as; others unchanged.

    Args:
        source: the scenario in plain values.
        directory: to which `path.file` is relative.
        hovering: whether its vehicles hover where a file says that they stay.

    Raises:
        ScenarioError: two forms of waypoints, a file that can't be read, or heights that can't be known.
    """
    path = source.data.get("path")
    given = [name for name in FORMS if isinstance(path, dict) and path.get(name) is not None]
    if not isinstance(path, dict) or given in ([], ["waypoints_m"]):
        return source
    if len(given) > 1:
        allowed = f"one of {', '.join(FORMS)}"
        raise ScenarioError([source.problem(("path", given[-1]), f"found {' and '.join(given)}", allowed)])
    if given == ["waypoints_deg"]:
        return _from_degrees(source, path)
    return _FromFile(source, path, directory, hovering=hovering).scenario()


def _from_degrees(source: Source, path: dict[Key, Plain]) -> Source:
    """Return the scenario with `waypoints_deg` [latitude, longitude, height above the origin] in metres."""
    points = path["waypoints_deg"]
    allowed = "a list of 2 or more [latitude, longitude, height], degrees and m above the origin"
    if not isinstance(points, list) or len(points) < 2:
        raise ScenarioError([source.problem(("path", "waypoints_deg"), f"found {kind(points)}", allowed)])
    triples = _Points()
    for index, point in enumerate(points):
        numbers = [each for each in point if _is_number(each)] if isinstance(point, list) else []
        if len(numbers) != 3 or abs(numbers[0]) > 90.0 or abs(numbers[1]) > 180.0:
            raise ScenarioError([source.problem(("path", "waypoints_deg", index), f"found {point}", allowed)])
        triples.append((numbers[0], numbers[1], numbers[2]))
    lat_deg, lon_deg, _ = triples[0]
    origin = _group(source, "origin") or {"lat_deg": lat_deg, "lon_deg": lon_deg}
    geodetic = _geodetic(origin)
    waypoints = [(*_north_east(geodetic, lat, lon), height) for lat, lon, height in triples]
    return _changed(source, path, "waypoints_deg", waypoints, {"origin": origin})


class _FromFile:
    """A scenario whose waypoints are a mission file's."""

    def __init__(self, source: Source, path: dict[Key, Plain], directory: Path, *, hovering: bool) -> None:
        self._source, self._hovering = source, hovering
        self._path = path
        file = path["file"]
        if not isinstance(file, str):
            raise self._refused(f"found {kind(file)}", "a mission file")
        try:
            self._mission = read_mission(directory / file)
            self._route = route_of(self._mission)
        except MissionFileError as error:
            found, _, allowed = str(error).partition("; allowed: ")
            raise self._refused(found, allowed) from error
        self._not_flown = list(self._route.remarks)

    def scenario(self) -> Source:
        origin = self._origin()
        geodetic, points = _geodetic(origin), self._route.points
        positions = np.array([_north_east(geodetic, each.lat_deg, each.lon_deg) for each in points])
        self._refuse_far(points, positions)
        heights = self._heights(points, positions, origin)
        waypoints = np.column_stack((positions, heights))
        path = self._speed()
        if self._path.get("kind", "legs") == "legs":
            path |= self._circles(path) | self._stops()
        elif circling := [each.where for each in points if each.circles is not None]:
            self._not_flown.append(f"{named(circling)}: circles aren't flown along a spline")
        if tolerance_m := self._tolerance_m():
            waypoints, path = thinned_with_keys(waypoints, path, tolerance_m)
        more: dict[Key, Plain] = {"origin": origin}
        if fence := self._fence(geodetic, origin):
            more["safety"] = _group(self._source, "safety") | {"fence": fence}
        path = path | self._path
        path |= {"read_from": self._mission.file, "not_flown": list[Plain](self._not_flown)}
        return _changed(self._source, path, "file", waypoints.tolist(), more)

    def _refuse_far(self, points: Sequence[RoutePoint], positions: Array) -> None:
        """Refuse points too far from the origin, before a path is planned through them."""
        away_m = np.hypot(positions[:, 0], positions[:, 1])
        far = int(away_m.argmax())
        if away_m[far] > MAX_DISTANCE_M:
            found = f"found {points[far].where} {away_m[far]:.3g} m from the origin"
            raise self._refused(found, f"up to {MAX_DISTANCE_M:g} m")

    def _origin(self) -> dict[Key, Plain]:
        """Return the scenario's origin, or else the file's home, or else its first point."""
        given, home = _group(self._source, "origin"), self._mission.home
        first = self._route.points[0]
        lat_deg, lon_deg = (first.lat_deg, first.lon_deg) if home is None else home[:2]
        origin: dict[Key, Plain] = {"lat_deg": lat_deg, "lon_deg": lon_deg}
        origin |= given
        if "alt_m" not in given:
            origin["alt_m"] = self._home_alt_m()
        return origin

    def _home_alt_m(self) -> float:
        """Return the height of home above sea level, m.

        A recorded track begins on the ground. If no height of the file is above sea level, it doesn't matter: 0.
        """
        home, points = self._mission.home, self._route.points
        if home is not None and math.isfinite(home[2]):
            return home[2]
        if all(each.datum != "sea level" or math.isnan(each.height_m) for each in points):
            return 0.0
        if self._mission.track:
            return points[0].height_m
        found = f"found heights above sea level in {self._mission.file}, which says nothing of the ground's"
        raise self._refused(found, "with `origin: {alt_m: …}`, the ground's height above sea level at its first point")

    def _heights(self, points: Sequence[RoutePoint], positions: Array, origin: dict[Key, Plain]) -> Array:
        """Return heights above the origin, (N,) m."""
        above = {"sea level": -float(str(origin["alt_m"])), "home": self._home_m(origin), "ground": 0.0}
        heights = np.array([each.height_m + above[each.datum] for each in points])
        on_ground = np.array([each.datum == "ground" for each in points])
        if on_ground.any():
            heights[on_ground] += self._ground(positions[on_ground], origin)
        unknown = np.isnan(heights)
        if unknown.any():
            instead = self._path.get("height_m")
            if not _is_number(instead):
                where = points[int(np.argmax(unknown))].where
                raise self._refused(f"found no height at {where}", "with `path: {height_m: …}`, above the origin")
            heights[unknown] = float(instead)
        return heights

    def _home_m(self, origin: dict[Key, Plain]) -> float:
        """Return the height of the file's home above the origin, m; 0 if the file doesn't say."""
        home = self._mission.home
        return home[2] - float(str(origin["alt_m"])) if home is not None and math.isfinite(home[2]) else 0.0

    def _ground(self, positions: Array, origin: dict[Key, Plain]) -> Array:
        """Return the ground's heights above the origin at positions (N, 2); a plain without terrain, as everywhere."""
        terrain = self._source.data.get("terrain")
        if terrain is None:
            self._not_flown.append(
                "heights above ground: without `terrain` the ground is a plain at the origin's height"
            )
        try:
            typed = None if terrain is None else Terrain.model_validate(terrain)
            return ground_of(typed, _geodetic(origin), positions).height(positions[:, 0], positions[:, 1])
        except ValidationError:
            return np.zeros(len(positions))  # its keys are refused when the scenario is typed
        except FileError as error:
            raise self._refused(str(error), "a terrain file that can be read") from error

    def _speed(self) -> dict[Key, Plain]:
        """Return the path's speed by the file, one a leg where they differ, if the scenario has none.

        Legs before the file's first speed are flown at the key's default.
        """
        speeds = [each.speed_mps for each in self._route.points[:-1]]
        if self._path.get("speed_mps") is not None or all(each is None for each in speeds):
            return {}
        each_mps = [DEFAULT_MPS if speed is None else speed for speed in speeds]
        if len(set(each_mps)) == 1:
            return {"speed_mps": each_mps[0]}
        if self._path.get("kind", "legs") == "legs":
            return {"speed_mps": list[Plain](each_mps)}
        self._not_flown.append("speeds that differ from leg to leg: a spline is flown at one, `path.speed_mps`")
        return {}

    def _circles(self, path: dict[Key, Plain]) -> dict[Key, Plain]:
        """Return the keys of the file's circles, at a path's speed, unless the scenario has some."""
        if self._path.get("circles") is not None:
            return {}
        speed, points = self._path.get("speed_mps", path.get("speed_mps")), self._route.points
        found, remarks = circles_of(points, speed, hovering=self._hovering)
        self._not_flown += remarks
        return {"circles": found} if found else {}

    def _stops(self) -> dict[Key, Plain]:
        """Return the keys of the file's stops, of vehicles that hover, unless the scenario has some."""
        if self._path.get("stops") is not None:
            return {}
        found, remarks = stops_of(self._route.points, hovering=self._hovering)
        self._not_flown += remarks
        return {"stops": found} if found else {}

    def _tolerance_m(self) -> float:
        tolerance = self._path.get("tolerance_m")
        return float(tolerance) if _is_number(tolerance) else TOLERANCE_M if self._mission.track else 0.0

    def _fence(self, geodetic: GeodeticOrigin, origin: dict[Key, Plain]) -> dict[Key, Plain]:
        """Return the keys of the file's fence and rally points, none if the scenario has a fence, which wins."""
        found = self._mission.fence
        counts = ((len(found.areas), "areas of a fence"), (len(found.rally), "rally points"))
        listed = " and ".join(f"{count} {what}" for count, what in counts if count)
        own = _group(self._source, "safety").get("fence") is not None
        kept = None if own else next(iter(brought("mission_keys")), None)
        if kept is not None:
            keys: dict[Key, Plain] = kept.fence_keys(found, geodetic, self._home_m(origin))
            return keys
        if listed:
            why = "the scenario has its safety.fence" if own else "no feature that keeps vehicles inside is there"
            self._not_flown.append(f"{self._mission.file}: {listed} aren't used: {why}")
        return {}

    def _refused(self, found: str, allowed: str) -> ScenarioError:
        return ScenarioError([self._source.problem(("path", "file"), found, allowed)])


def _changed(
    source: Source, path: dict[Key, Plain], form: str, waypoints: Sequence[Sequence[float]], more: dict[Key, Plain]
) -> Source:
    """Return the scenario with a path of legs through waypoints instead of another form of them."""
    kept = {name: value for name, value in path.items() if name != form}
    kept = {"kind": "legs", **kept, "waypoints_m": [list(each) for each in waypoints]}
    return replace(source, data=source.data | plain_mapping(more | {"path": kept}))


def _north_east(origin: GeodeticOrigin, *position: float) -> tuple[float, float]:
    lat_deg, lon_deg = position
    north_m, east_m, _ = origin.to_ned(math.radians(lat_deg), math.radians(lon_deg), 0.0)
    return north_m, east_m


def _geodetic(origin: dict[Key, Plain]) -> GeodeticOrigin:
    """Return the origin; values that will be refused count as the default's."""
    defaults = {"lat_deg": 35.0, "lon_deg": 125.0, "alt_m": 0.0}
    lat_deg, lon_deg, alt_m = (
        float(given) if _is_number(given := origin.get(name)) else default for name, default in defaults.items()
    )
    return GeodeticOrigin(math.radians(lat_deg), math.radians(lon_deg), alt_m)


def _group(source: Source, name: str) -> dict[Key, Plain]:
    group = source.data.get(name)
    return dict(group) if isinstance(group, dict) else {}


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
