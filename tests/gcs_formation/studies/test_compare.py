"""Comparison of laws on one seed, in one window; each law's figures are those of its own record."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from gcs_formation.cli import main
from gcs_formation.report import load_run
from gcs_formation.report.error_figures import largest_around_m
from gcs_formation.studies.compare import LAWS

SHORT = {
    "schema": 1,
    "name": "short",
    "duration_s": 12,
    "start": {"in_air": True, "offset_m": [2.0, 0.0, 0.0]},
    "vehicles": {"count": 2},
    "path": {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]},
    "expect": [{"metric": "error_x_m.max", "from_s": 5, "to_s": 12, "below": 1e-6}],
}


@pytest.fixture
def scenario(tmp_path):
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump(SHORT))
    return str(file)


@pytest.mark.slow
def test_each_laws_figures_are_those_of_its_record(scenario, tmp_path):
    out = tmp_path / "laws"
    laws = ["--laws", "pid,fuzzy_pid", "--from", "2", "--to", "10", "--jobs", "2"]
    result = CliRunner().invoke(main, ["compare", scenario, *laws, "--json", "--out", str(out), "--seed", "7"])
    assert result.exit_code == 1, "the expectation can't be kept by any law"
    assert "pid: vehicle 2: error_x_m.max" in result.stderr
    found = json.loads(result.stdout)
    assert found == json.loads((out / "comparison.json").read_text())
    assert list(found["laws"]) == ["pid", "fuzzy_pid"]
    for law, figures in found["laws"].items():
        run = load_run(out / law)
        assert (run.summary["seed"], run.scenario.law.type) == (7, law)
        error_m = np.abs(run.flown.error(run.followers[0])[run.flown.window(2.0, 10.0)])
        for axis, name in enumerate("xyz"):
            assert figures[f"error_{name}_m"]["max"] == pytest.approx(error_m[:, axis].max(), abs=1e-12)
            assert figures[f"error_{name}_m"]["rms"] == pytest.approx(
                np.sqrt(np.mean(error_m[:, axis] ** 2)), abs=1e-12
            )
        assert figures["settled_at_s"] == run.summary["followers"]["2"]["settled_at_s"]
        assert_no_error_is_above_its_line(out, law)
    page = (out / "comparison.html").read_text()
    assert "data:image/png;base64,iVBOR" in page
    assert "http" not in page.replace("http-equiv", "")


def assert_no_error_is_above_its_line(out, law):
    run = load_run(out / law)
    line_m, error_m = largest_around_m(run), np.abs(run.flown.error(run.followers[0]))
    assert (line_m >= error_m).all()
    assert line_m.max(axis=0) == pytest.approx(error_m.max(axis=0))


@pytest.mark.slow
def test_a_law_that_does_not_stand_the_delay_says_so(scenario, tmp_path):
    far = ["--set", "links.default.delay_ms=450", "--set", "start.run_in_s=11", "--set", "expect=[]", "--until", "3"]
    laws = ["--laws", "pid,pid_uncompensated"]
    result = CliRunner().invoke(main, ["compare", scenario, *laws, *far, "--out", str(tmp_path / "laws")])
    assert result.exit_code == 0
    said = [line for line in result.stdout.splitlines() if line.startswith("pid_uncompensated: ")]
    assert any("margin" in line for line in said)
    assert "\npid: " not in result.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--laws", "fuzy_pid"], "found 'fuzy_pid' (did you mean 'fuzzy_pid'?); allowed: pid"),
        (["--laws", "pid,fuzzy_pid,pid"], "found 'pid' 2 times; allowed: each law once"),
        (["--from", "9", "--to", "3"], "found 9 s to 3 s; allowed: a window within 0 s to 12 s"),
        (["--from", "5", "--until", "4"], "found 5 s to 4 s; allowed: a window within 0 s to 4 s"),
        (["--set", "law.rate_hz=-1"], "law.rate_hz"),
    ],
)
def test_what_is_wrong_is_found_before_anything_flies(scenario, tmp_path, arguments, said):
    out = tmp_path / "laws"
    result = CliRunner().invoke(main, ["compare", scenario, "--out", str(out), *arguments])
    assert result.exit_code == 2
    assert said in result.stderr
    assert not out.exists()


def test_a_directory_that_cannot_be_written_is_refused(scenario, tmp_path):
    result = CliRunner().invoke(main, ["compare", scenario, "--out", f"{scenario}/laws"])
    assert result.exit_code == 2
    assert f"cannot write {scenario}/laws: Not a directory" in result.stderr


@pytest.mark.slow
def test_of_an_earlier_comparison_nothing_is_left(scenario, tmp_path):
    out = tmp_path / "laws"
    for name in ("comparison.json", "consensus/run.yaml", "own/run.yaml"):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).touch()
    short = ["--laws", "pid", "--until", "0.5", "--overwrite", "--out", str(out)]
    assert CliRunner().invoke(main, ["compare", scenario, *short]).exit_code == 0
    files = {"comparison.json", "comparison.png", "comparison.html"}
    assert {path.name for path in out.iterdir()} == files | {"pid", "own"}


@pytest.mark.slow
def test_errors_of_a_part_of_the_window_are_said_to_be_of_a_part(scenario, tmp_path):
    """The leader crashes in the middle of the window, and nobody takes over."""
    crash = "faults=[{at_s: 5, vehicles: [1], kind: crash}]"
    keys = ["--set", crash, "--set", "formation.succession=none", "--set", "expect=[]", "--set", "duration_s=8"]
    command = ["compare", scenario, "--laws", "pid", "--from", "2", *keys, "--out", str(tmp_path / "laws")]
    result = CliRunner().invoke(main, command)
    assert "pid: errors are of a part of the window: a follower had a leader for 5" in result.stdout
    assert "pid: errors are of a part of the window" in (tmp_path / "laws" / "comparison.html").read_text().replace(
        '</td><td class="text">', ": "
    )


def test_laws_differ_only_in_what_their_names_say():
    assert len({tuple(sorted(settings)) for settings in LAWS.values()}) == len(LAWS)
    assert all(("_uncompensated" in law) == ("law.delay_compensation=false" in LAWS[law]) for law in LAWS)
