"""`sim-vehicles sins`, as a script calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

from sim_vehicles.cli import main
from sim_vehicles.inertial.experiment import ANGLES, AXES

PATH = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 700, 120]]}


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """Return a short experiment."""
    vehicle = {"id": 1, "role": "leader", "navigation": {"source": "ins", "alignment_s": 20}}
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump({"schema": 1, "duration_s": 30, "vehicles": [vehicle], "path": PATH}))
    return file


def sins(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["sins", *map(str, arguments)])


@pytest.mark.slow
def test_it_writes_a_summary_by_the_contract_figures_and_a_scenario_that_gives_the_same(
    scenario: Path, tmp_path: Path
) -> None:
    out, again = tmp_path / "out", tmp_path / "again"
    done = sins(scenario, "--out", out, "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    summary = json.loads(done.stdout)
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary["alignment"]["duration_s"] == 20
    assert all(set(summary["alignment"][part]) == set(ANGLES) for part in ("sigma", "error"))
    assert set(summary["flight"]["error_m"]) == set(AXES)
    assert all(set(row) == {"max", "final"} for row in summary["flight"]["error_m"].values())
    assert {figure.name for figure in (out / "figures").iterdir()} == {"alignment.png", "navigation.png", "track.png"}
    assert sins(out / "run.yaml", "--out", again, "--quiet").output == ""
    assert all((again / name).read_bytes() == (out / name).read_bytes() for name in ("summary.json", "flight.parquet"))


def test_an_aid_and_a_seed_by_option_and_gyroscopes_that_do_not_find_north_are_warned_of(
    scenario: Path, tmp_path: Path
) -> None:
    options = ("--set", "vehicles.0.navigation.aiding=gnss", "--set", "vehicles.0.navigation.grade=tactical")
    aided = sins(scenario, *options, "--set", "duration_s=12", "--seed", 2, "--out", tmp_path / "out", "--json")
    assert aided.exit_code == 0
    assert "47° off" in aided.stderr
    again = sins(scenario, *options, "--out", tmp_path / "out")
    assert (again.exit_code, again.stderr.startswith("found an earlier run in")) == (2, True)
    summary = json.loads(aided.stdout)
    assert (summary["aiding"], summary["seed"]) == ("gnss", 2)
    assert summary["flight"]["sigma_m"]["east"] < 1.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--set", "vehicles.0.navigation={source: truth}"), "found none with navigation: {source: ins}"),
        (("--vehicle", "2"), "--vehicle: found '2'; allowed: those with navigation: {source: ins}: 1"),
        (("--set", "vehicles.0.navigation.grade=tacticl"), "did you mean 'tactical'"),
        (("--set", "vehicles.0.navigation.sensors={gyro_bias_deg_per_h: [1, 2]}"), "a list of 3 numbers"),
        (("--set", "vehicles.0.navigation.sensors.accel_bias_ug=1e6"), "up to ±100000"),
        (("--set", "vehicles.0.navigation.alignment_s=5"), "a whole number from 10 to 7200"),
        (("--out", "/dev/null/here"), "cannot write the directory /dev/null/here"),
    ],
)
def test_what_can_not_be_done_is_refused_with_2(scenario: Path, arguments: tuple[str, ...], words: str) -> None:
    refused = sins(scenario, *arguments)
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert words in refused.stderr


@pytest.mark.slow
def test_a_flight_that_inertia_alone_can_not_compute_ends_with_3(scenario: Path, tmp_path: Path) -> None:
    biased = "vehicles.0.navigation={source: ins, alignment_s: 10, sensors: {accel_bias_ug: [0, 0, 1e5]}}"
    far = ("--set", "path.waypoints_m=[[0, 0, 100], [1e5, 0, 100]]", "--set", "duration_s=1500")
    ended = sins(scenario, "--set", biased, *far, "--out", tmp_path / "out")
    assert (ended.exit_code, ended.stdout) == (3, "")
    assert "by inertia the computed height diverges: 1e+06 m after 12" in ended.stderr
