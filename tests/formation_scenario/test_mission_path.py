"""A mission file, or latitudes and longitudes, become the keys that a scenario would have otherwise."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight_model.earth import GeodeticOrigin
from formation_scenario import Scenario, ScenarioError, dump_scenario, load_scenario

HOME = (47.4, 8.54, 488.0)
WAYPOINTS_M = [[0.0, 0.0, 100.0], [2500.0, 0.0, 100.0], [2500.0, 1800.0, 110.0]]
ORIGIN = GeodeticOrigin(math.radians(HOME[0]), math.radians(HOME[1]), HOME[2])


def lat_lon(north_m: float, east_m: float) -> list[float]:
    lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
    return [math.degrees(lat_rad), math.degrees(lon_rad)]


def item(number: int, waypoint_m: list[float], frame: int = 3, command: int = 16, *params: float) -> dict[str, Any]:
    first = [*params, 0, 0, 0, 0][:4]
    return {
        "type": "SimpleItem", "command": command, "frame": frame, "doJumpId": number,
        "params": [*first, *lat_lon(*waypoint_m[:2]), waypoint_m[2]],
    }  # fmt: skip


def plan(tmp_path: Path, frame: int = 3, up_m: float = 0.0, more: list[Any] | None = None, **parts: Any) -> Path:
    items = [item(number, [*waypoint[:2], waypoint[2] + up_m], frame) for number, waypoint in enumerate(WAYPOINTS_M, 1)]
    mission = {"items": items + (more or []), "plannedHomePosition": list(HOME)}
    (tmp_path / "tour.plan").write_text(json.dumps({"fileType": "Plan", "mission": mission, **parts}))
    return tmp_path


def load(directory: Path, path: dict[str, Any] | None = None, **keys: Any) -> Scenario:
    scenario = directory / "scenario.yaml"
    scenario.write_text(json.dumps({"vehicles": {"count": 2}, "path": {"file": "tour.plan"} | (path or {})} | keys))
    return load_scenario(scenario)


def refusal(directory: Path, path: dict[str, Any] | None = None, **keys: Any) -> str:
    with pytest.raises(ScenarioError) as refused:
        load(directory, path, **keys)
    return str(refused.value)


def test_a_plan_becomes_legs_from_its_home(tmp_path: Path) -> None:
    scenario = load(plan(tmp_path))
    assert scenario.path.kind == "legs"
    assert scenario.path.waypoints_m == pytest.approx(np.array(WAYPOINTS_M), abs=1e-3)
    origin = scenario.origin
    assert (origin.lat_deg, origin.lon_deg, origin.alt_m) == HOME
    assert scenario.path.read_from == "tour.plan"


def test_what_is_resolved_needs_the_file_no_more(tmp_path: Path) -> None:
    scenario = load(plan(tmp_path))
    (tmp_path / "tour.plan").unlink()
    (tmp_path / "run.yaml").write_text(dump_scenario(scenario))
    again = load_scenario(tmp_path / "run.yaml")
    assert again == scenario


@pytest.mark.parametrize(("frame", "up_m"), [(0, HOME[2]), (5, HOME[2]), (3, 0.0), (6, 0.0), (10, 0.0), (11, 0.0)])
def test_heights_are_from_where_their_frame_says(tmp_path: Path, frame: int, up_m: float) -> None:
    scenario = load(plan(tmp_path, frame, up_m))
    assert [each[2] for each in scenario.path.waypoints_m] == pytest.approx([100.0, 100.0, 110.0])


def test_heights_above_home_are_kept_above_an_origin_at_another_height(tmp_path: Path) -> None:
    origin = {"lat_deg": HOME[0], "lon_deg": HOME[1], "alt_m": 470.0}
    for frame, up_m in ((3, 0.0), (0, HOME[2])):
        scenario = load(plan(tmp_path, frame, up_m), origin=origin)
        assert [each[2] for each in scenario.path.waypoints_m] == pytest.approx([118.0, 118.0, 128.0])


def test_heights_above_ground_are_above_the_terrain_of_the_scenario(tmp_path: Path) -> None:
    hill = {"north_m": 2500, "east_m": 0, "height_m": 30, "radius_m": 700}
    scenario = load(plan(tmp_path, 10), terrain={"hills": [hill], "clearance_m": 30})
    heights = [each[2] for each in scenario.path.waypoints_m]
    assert heights[0] == pytest.approx(100.0 + 30 * math.exp(-((2500 / 700) ** 2) / 2))
    assert heights[1] == pytest.approx(130.0)


def test_what_the_scenario_says_wins(tmp_path: Path) -> None:
    keys = {"origin": {"lat_deg": 47.41, "lon_deg": HOME[1], "alt_m": 488.0}}
    scenario = load(plan(tmp_path), {"kind": "spline", "speed_mps": 20}, **keys)
    assert (scenario.path.kind, scenario.path.begin_mps) == ("spline", 20.0)
    assert scenario.path.waypoints_m[0][0] == pytest.approx(-0.01 * 111_178.0, rel=1e-3)


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"geoFence": {"polygons": [{"polygon": [[47.0, 8.0], [47.1, 8.0]]}]}}, "polygon 1: found 2 corners"),
        ({"geoFence": {"circles": [{"circle": {"center": [47.0, 8.0], "radius": 0}}]}}, "circle 1: found 0 as its"),
        ({"rallyPoints": {"points": [[47.0, 8.0]]}}, "rally point 1: found no height"),
    ],
)
def test_areas_without_an_inside_and_rally_points_without_a_height_are_refused(
    tmp_path: Path, part: dict[str, Any], said: str
) -> None:
    assert said in refusal(plan(tmp_path, **part))


def test_a_return_point_of_the_fence_is_said_to_be_unused(tmp_path: Path) -> None:
    scenario = load(plan(tmp_path, geoFence={"breachReturn": [*lat_lon(0.0, 0.0), 50]}))
    assert any("breachReturn isn't used" in each for each in scenario.path.not_flown)


def test_speeds_of_the_file_are_the_legs(tmp_path: Path) -> None:
    fast = {"type": "SimpleItem", "command": 178, "frame": 2, "params": [0, 24, -1, 0, 0, 0, 0]}
    first = item(0, WAYPOINTS_M[0])
    items = [fast, first, *[item(number, waypoint) for number, waypoint in enumerate(WAYPOINTS_M[1:], 2)]]
    mission = {"items": items, "plannedHomePosition": list(HOME)}
    (tmp_path / "tour.plan").write_text(json.dumps({"fileType": "Plan", "mission": mission}))
    assert load(tmp_path).path.begin_mps == 24.0
    assert load(tmp_path, {"speed_mps": 21}).path.begin_mps == 21.0
    mission["items"] = [first, items[2], fast, items[3]]
    (tmp_path / "tour.plan").write_text(json.dumps({"fileType": "Plan", "mission": mission}))
    scenario = load(tmp_path)
    assert scenario.path.speed_mps == (22.0, 24.0)
    assert scenario.path.not_flown == ()
    spline = load(tmp_path, {"kind": "spline"})
    assert spline.path.speed_mps == 22.0
    assert any("speeds that differ from leg to leg" in each for each in spline.path.not_flown)


def table(tmp_path: Path, header: str, rows: list[list[float]]) -> Path:
    text = "\n".join([header, *(",".join(map(str, row)) for row in rows)])
    (tmp_path / "tour.csv").write_text(text)
    return tmp_path


def test_points_without_heights_take_the_paths(tmp_path: Path) -> None:
    rows = [lat_lon(*waypoint[:2]) for waypoint in WAYPOINTS_M]
    directory = table(tmp_path, "lat,lon", rows)
    assert "found no height at tour.csv: line 2" in refusal(directory, {"file": "tour.csv"})
    scenario = load(directory, {"file": "tour.csv", "height_m": 130})
    assert [each[2] for each in scenario.path.waypoints_m] == [130.0] * 3
    assert (scenario.origin.lat_deg, scenario.origin.lon_deg) == (rows[0][0], rows[0][1])


def test_heights_above_sea_level_need_the_grounds(tmp_path: Path) -> None:
    rows = [[*lat_lon(*waypoint[:2]), HOME[2] + waypoint[2]] for waypoint in WAYPOINTS_M]
    directory = table(tmp_path, "lat,lon,alt_m", rows)
    words = refusal(directory, {"file": "tour.csv"})
    assert "found heights above sea level in tour.csv, which says nothing of the ground's" in words
    assert "origin: {alt_m: …}" in words
    scenario = load(directory, {"file": "tour.csv"}, origin={"lat_deg": HOME[0], "lon_deg": HOME[1], "alt_m": HOME[2]})
    assert scenario.path.waypoints_m == pytest.approx(np.array(WAYPOINTS_M), abs=1e-3)


def test_a_recorded_track_is_followed_within_its_tolerance(tmp_path: Path) -> None:
    s = np.linspace(0.0, 6000.0, 601)
    north, east = s, 400.0 * np.sin(s / 1500.0)
    deviation = 2.0 * np.sin(s * 7.0)
    points = "".join(
        f'<trkpt lat="{lat}" lon="{lon}"><ele>600</ele></trkpt>'
        for lat, lon in (lat_lon(n + w, e - w) for n, e, w in zip(north, east, deviation, strict=True))
    )
    (tmp_path / "tour.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    keys = {"origin": {"lat_deg": HOME[0], "lon_deg": HOME[1], "alt_m": 480.0}}
    scenario = load(tmp_path, {"file": "tour.gpx", "tolerance_m": 12}, **keys)
    waypoints = np.array(scenario.path.waypoints_m)
    assert 4 <= len(waypoints) <= 20
    away = np.abs(np.interp(north, waypoints[:, 0], waypoints[:, 1]) - east)
    assert away.max() < 12.0 + 4.0


def test_degrees_are_metres_from_the_first_or_from_the_origin(tmp_path: Path) -> None:
    degrees = [[*lat_lon(*waypoint[:2]), waypoint[2]] for waypoint in WAYPOINTS_M]
    scenario = load_scenario({"vehicles": {"count": 2}, "path": {"waypoints_deg": degrees}})
    assert scenario.path.waypoints_m == pytest.approx(np.array(WAYPOINTS_M), abs=1e-3)
    assert scenario.path.kind == "legs"
    assert scenario.origin.lat_deg == HOME[0]
    with_origin = {
        "vehicles": {"count": 2},
        "path": {"waypoints_deg": degrees},
        "origin": {"lat_deg": 47.39, "lon_deg": 8.54},
    }
    assert load_scenario(with_origin).path.waypoints_m[0][0] == pytest.approx(0.01 * 111_178.0, rel=1e-3)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ({"waypoints_m": WAYPOINTS_M, "file": "tour.plan"}, "path.file: found waypoints_m and file; allowed: one of"),
        ({"waypoints_deg": [[1, 2, 3]]}, "path.waypoints_deg: found a list; allowed: a list of 2 or more"),
        ({"waypoints_deg": [[1, 2, 3], [1, 2]]}, "path.waypoints_deg.1: found [1, 2]; allowed"),
        ({"waypoints_deg": [[1, 2, 3], [91, 2, 3]]}, "path.waypoints_deg.1: found [91, 2, 3]; allowed"),
        ({"file": "none.plan"}, "none.plan: No such file or directory"),
        ({"file": 3}, "path.file: found 3; allowed: a mission file"),
        ({"file": "tour.txt"}, "path.file: tour.txt: line 1: found 'hello'; allowed: 'QGC WPL 110'"),
    ],
)
def test_what_cannot_be_a_path_is_refused_at_its_key(tmp_path: Path, path: dict[str, Any], words: str) -> None:
    plan(tmp_path)
    (tmp_path / "tour.txt").write_text("hello")
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(json.dumps({"vehicles": {"count": 2}, "path": path}))
    with pytest.raises(ScenarioError) as refused:
        load_scenario(scenario)
    assert words in str(refused.value)
    assert "scenario.yaml:1" in str(refused.value)


def test_loiter_turns_time_and_height_of_a_file_are_circles_of_its_path(tmp_path: Path) -> None:
    commands = (16, [0.0] * 4), (18, [2.0, 0.0, -90.0, 0.0]), (19, [60.0, 0.0, 100.0, 0.0]), (31, [0.0, 80.0, 0.0, 0.0])
    waypoints = [*WAYPOINTS_M[:3], [WAYPOINTS_M[2][0] + 3000.0, WAYPOINTS_M[2][1], WAYPOINTS_M[2][2]]]
    items = [item(number, waypoint) for number, waypoint in enumerate(waypoints, 1)]
    for each, (command, params) in zip(items, commands, strict=True):
        each["command"], each["params"] = command, [*params, *each["params"][4:]]
    mission = {"items": items, "plannedHomePosition": list(HOME)}
    (tmp_path / "tour.plan").write_text(json.dumps({"fileType": "Plan", "mission": mission}))
    plan_ = load(tmp_path).path
    found = [(each.waypoint, each.turns, each.radius_m) for each in plan_.circles]
    assert found == [(1, 2, -90.0), (2, math.ceil(60.0 * 22.0 / (math.tau * 100.0)), 100.0), (3, 0, 80.0)]
    assert plan_.not_flown == ()


def test_points_too_far_from_home_are_refused_before_a_path_is_planned(tmp_path: Path) -> None:
    away = {"type": "SimpleItem", "command": 16, "frame": 3, "doJumpId": 9, "params": [0, 0, 0, 0, -33.0, 151.0, 100]}
    words = refusal(plan(tmp_path, more=[away]))
    assert "found tour.plan: item 4 1.8" in words
    assert "allowed: up to 1e+06 m" in words


def test_a_recorded_track_is_smoothed_in_height_apart_from_its_bends(tmp_path: Path) -> None:
    s = np.linspace(0.0, 6000.0, 601)
    east = np.abs(np.mod(s, 600.0) - 300.0)  # a bend every 300 m
    height = 650.0 + 0.02 * s + 4.0 * np.sin(s)  # a steady climb with scatter
    points = "".join(
        f'<trkpt lat="{lat}" lon="{lon}"><ele>{up}</ele></trkpt>'
        for (lat, lon), up in ((lat_lon(n, e), up) for n, e, up in zip(s, east, height, strict=True))
    )
    (tmp_path / "tour.gpx").write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    keys = {"origin": {"lat_deg": HOME[0], "lon_deg": HOME[1], "alt_m": 480.0}}
    waypoints = np.array(load(tmp_path, {"file": "tour.gpx", "tolerance_m": 12}, **keys).path.waypoints_m)
    assert len(waypoints) > 15
    slopes = np.diff(waypoints[:, 2]) / np.diff(waypoints[:, 0])
    assert slopes == pytest.approx(0.02, abs=0.002)
