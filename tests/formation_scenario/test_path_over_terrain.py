import numpy as np
import pytest

from flight_model.spline import SplinePath
from formation_scenario import load_scenario
from formation_scenario.source import read_text
from formation_scenario.start_states import start_states

HILL = "terrain={clearance_m: 60, hills: [{north_m: 2000, east_m: 0, height_m: 60, radius_m: 300}]}"
LOW = "path.waypoints_m=[[0, 0, 80], [4000, 0, 80]]"


def test_the_path_is_raised_over_the_hill_and_nowhere_else(load):
    scenario = load(HILL, LOW)
    path, ground = scenario.leader_path, scenario.ground
    at_m = np.arange(0.0, path.length_m, 2.0)
    points = path.at(at_m)
    clearance = points.height_m - ground.height(points.north_m, points.east_m)
    assert clearance.min() == pytest.approx(60.0, abs=0.05)
    assert 120.0 <= points.height_m.max() < 121.0
    assert np.abs(points.slope).max() * 22.0 <= 0.7 * 3.0 + 1e-6
    assert points.height_m[[0, -1]] == pytest.approx(80.0)
    assert path.at(-500.0).height_m == 80.0


def test_one_position_is_the_same_as_among_many(load):
    path = load(HILL, LOW).leader_path
    at_m = np.array([-10.0, 0.0, 1234.5, 2000.0, 3999.0, 5000.0])
    for i, s in enumerate(at_m.tolist()):
        assert path.at(s).values() == pytest.approx([column[i] for column in path.at(at_m)])


def test_a_path_clear_of_the_ground_stays_as_written(load):
    scenario = load(HILL, "path.waypoints_m=[[0, 0, 150], [2000, 300, 170], [4000, 0, 150]]")
    at_m = np.arange(-100.0, 4200.0, 7.0)
    as_written = SplinePath(scenario.path.waypoints_m).at(at_m)
    np.testing.assert_array_equal(scenario.leader_path.at(at_m), as_written)


def test_a_hill_too_steep_from_the_start_is_refused_with_its_position_and_figure(refusal):
    (line,) = refusal(LOW, HILL.replace("height_m: 60", "height_m: 300"))
    assert line.startswith("path.waypoints_m: path at 19")
    assert "m too low, with climbs of 2.1 m/s from its start on; 60 m or more (terrain.clearance_m)" in line


def test_a_start_or_a_path_to_it_too_near_the_ground_is_refused(refusal):
    assert refusal(HILL, "path.waypoints_m=[[0, 0, 50], [4000, 0, 80]]") == [
        "path.waypoints_m.0: north 0, east 0, height 50: 50.0 m above the ground at the path's start; "
        "60 m or more (terrain.clearance_m)"
    ]
    behind = HILL.replace("north_m: 2000", "north_m: -500")
    (line,) = refusal(behind, LOW, "start={in_air: true, run_in_s: 30}")
    assert "20.0 m above the ground at 500 m before the path's start" in line


def test_take_off_from_a_slope_is_refused_for_emulated_vehicles_only(refusal, load):
    (line,) = refusal(LOW, "terrain={base_m: 4, clearance_m: 60}")
    assert line.startswith("terrain: found ground at 4 m where emulated vehicle 1 would take off; the origin's height")
    assert load(LOW, "terrain={base_m: 4, clearance_m: 60}", "start.in_air=true")


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("terrain={file: x.hgt, hills: [{north_m: 0, east_m: 0, height_m: 1, radius_m: 1}]}", "terrain.hills: found h"),
        ("terrain={clearance_m: 2}", "safety.clearance_m: found 5; at most terrain.clearance_m, 2"),
        ("terrain={hills: [{north_m: 0, east_m: 0, height_m: 1, radius_m: 0}]}", "terrain.hills.0.radius_m: found 0;"),
        ("terrain={hills: [{shape: cone}]}", "terrain.hills.0.shape: found 'cone'; gaussian, cosine"),
        ("terrain={file: nowhere/N35E125.hgt}", "terrain.file: found "),
    ],
)
def test_wrong_keys_are_refused(refusal, override, said):
    assert any(line.startswith(said) for line in refusal(override))


def test_a_geotiff_without_the_extra_says_what_to_install(refusal, monkeypatch, tmp_path):
    (tmp_path / "a.tif").write_bytes(b"II*")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "rasterio", None)
    (line,) = refusal("terrain={file: a.tif}")
    assert "found a.tif, and rasterio isn't installed: pip install 'gcs-formation[terrain]'" in line


def write_tile(directory) -> None:
    values = np.full((1201, 1201), 30, dtype=">i2")
    values[0:599, :] = -32768  # north of 35.5
    values.tofile(directory / "N35E125.hgt")


def test_a_file_beside_the_scenario_is_found_and_where_it_ends_is_said(tmp_path):
    write_tile(tmp_path)
    text = (
        "{terrain: {file: N35E125.hgt}, start: {in_air: true}, vehicles: {count: 2}, origin: {lat_deg: 35.49, "
        "lon_deg: 125.5}, path: {waypoints_m: [[0, 0, 100], [%d, 0, 100]]}}"
    )
    (tmp_path / "a.yaml").write_text(text % 900)
    scenario = load_scenario(tmp_path / "a.yaml")
    assert scenario.terrain is not None
    assert scenario.terrain.file == str(tmp_path / "N35E125.hgt")
    assert scenario.ground.height(np.zeros(1), np.zeros(1))[0] == 30.0
    with pytest.raises(Exception, match=r"no elevation under the leader at \d+ m of the path \(north \d+, east 0\)"):
        load_scenario(read_text(text.replace("N35E125.hgt", str(tmp_path / "N35E125.hgt")) % 3000).data)


def test_the_first_leader_needs_elevations_under_the_slot_it_has_behind_another(tmp_path):
    """The tile's values end 1202 m north of the origin; north of that they are missing 60 m to the left of the path."""
    write_tile(tmp_path)
    keys = {
        "terrain": {"file": str(tmp_path / "N35E125.hgt")},
        "start": {"in_air": True},
        "vehicles": {"count": 3},
        "origin": {"lat_deg": 35.49, "lon_deg": 125.5},
        "path": {"waypoints_m": [[1150, 0, 100], [1150, 900, 100]]},
        "formation": {"shape": "custom", "slots_m": {2: [-60, 60, 0], 3: [-60, 120, 0]}},
    }
    assert load_scenario(keys)
    change = "{at_s: 20, leader: 2, slots_m: {2: [-60, -60, 0], 3: [-60, 120, 0]}}"
    with pytest.raises(Exception, match="no elevation under vehicle 1 in shape custom at "):
        load_scenario(keys, [f"formation.changes=[{change}]"])


def test_followers_in_the_air_begin_clear_of_the_ground(load):
    alongside = "terrain={clearance_m: 60, hills: [{north_m: -220, east_m: 150, height_m: 80, radius_m: 60}]}"
    scenario = load(alongside, LOW, "start={in_air: true, run_in_s: 10}", "formation={shape: line, spacing_m: 100}")
    start = start_states(scenario)
    north_m, east_m, height_m = np.array([(each.north_m, each.east_m, each.height_m) for each in start]).T
    assert height_m[0] == 80.0
    assert (height_m - scenario.ground.height(north_m, east_m) >= 60.0 - 1e-9).all()
    assert height_m.max() > 85.0


def test_path_and_ground_are_built_once_and_again_for_other_keys(load):
    scenario = load(HILL, LOW)
    assert scenario.leader_path is scenario.leader_path
    assert scenario.ground is scenario.ground
    longer = scenario.path.model_copy(update={"waypoints_m": ((0.0, 0.0, 80.0), (5000.0, 0.0, 80.0))})
    other = scenario.model_copy(update={"path": longer, "terrain": None})
    assert other.leader_path.length_m == pytest.approx(5000.0)
    assert other.ground.height(np.array([2000.0]), np.zeros(1))[0] == 0.0
