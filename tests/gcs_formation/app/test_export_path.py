"""`check --export` writes the path that is flown, and every slot's, so that other programs and `path.file` read it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from formation_scenario import load_scenario
from formation_scenario.mission_files import read_mission
from gcs_formation.cli import main

KEYS = {
    "vehicles": {"count": 3},
    "formation": {"shape": "custom", "slots_m": {2: [-40, 30, 5], 3: [-40, -30, 0]}},
    "path": {"kind": "legs", "waypoints_m": [[0, 0, 100], [3000, 0, 100], [3000, 3000, 120]]},
    "origin": {"lat_deg": 47.4, "lon_deg": 8.54, "alt_m": 488},
}


def check(tmp_path: Path, *options: str) -> tuple[int, str]:
    (tmp_path / "scenario.json").write_text(json.dumps(KEYS))
    result = CliRunner().invoke(main, ["check", str(tmp_path / "scenario.json"), "--no-fly", *options])
    return result.exit_code, result.output


@pytest.mark.parametrize(("vehicle", "right_m", "up_m"), [("1", 0.0, 0.0), ("2", 30.0, 5.0), ("3", -30.0, 0.0)])
def test_a_slots_path_is_beside_the_leaders(tmp_path: Path, vehicle: str, right_m: float, up_m: float) -> None:
    file = tmp_path / "path.waypoints"
    assert check(tmp_path, "--export", str(file), "--export-vehicle", vehicle)[0] == 0
    scenario, mission = load_scenario(KEYS), read_mission(file)
    for item in mission.items:
        north, east, _ = scenario.origin.geodetic.to_ned(math.radians(item.lat_deg), math.radians(item.lon_deg), 0.0)
        if north < 2000.0 and east < 500.0:  # on the first leg, which leads north
            assert east == pytest.approx(right_m, abs=0.02)
            assert item.height_m == pytest.approx(100.0 + up_m, abs=0.01)


def test_what_was_exported_is_flown_again_as_a_file(tmp_path: Path) -> None:
    assert check(tmp_path, "--export", str(tmp_path / "path.plan"))[0] == 0
    scenario = load_scenario(KEYS)
    exported = {"file": str(tmp_path / "path.plan"), "tolerance_m": 3}
    again = load_scenario(KEYS | {"path": exported, "origin": KEYS["origin"]})
    s = np.linspace(0.0, scenario.leader_path.length_m, 200)
    one, other = (each.leader_path.at(s * each.leader_path.length_m / s[-1]) for each in (scenario, again))
    away = np.hypot(one.north_m - other.north_m, one.east_m - other.east_m)
    assert away.max() < 10.0


def test_a_line_for_the_leader_and_each_slot(tmp_path: Path) -> None:
    assert check(tmp_path, "--export", str(tmp_path / "path.geojson"))[0] == 0
    features = json.loads((tmp_path / "path.geojson").read_text())["features"]
    assert [each["properties"]["name"] for each in features] == ["vehicle 1", "vehicle 2", "vehicle 3"]


def test_what_cannot_be_written_is_bad_usage(tmp_path: Path) -> None:
    assert check(tmp_path, "--export", str(tmp_path / "path.shp"))[0] == 2
    status, output = check(tmp_path, "--export", str(tmp_path / "path.kml"), "--export-vehicle", "9")
    assert (status, "found no vehicle 9; allowed: 1, 2, 3" in output) == (2, True)
    assert check(tmp_path, "--export-vehicle", "1")[0] == 2
