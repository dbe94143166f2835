"""The report of a run that was killed or whose disk was full."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import gcs_formation
from gcs_formation.cli import main
from gcs_formation.record.run_directory import SPOOL, RunDirectory
from gcs_formation.report import load_run
from tests.flights.conftest import scenario


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of a run whose disk was full at its end; a complete one is beside it."""
    directory = tmp_path_factory.mktemp("runs")
    keys = scenario(vehicles={"count": 2})
    gcs_formation.run(keys, clock="virtual", until=3.0, out=directory / "whole")

    def full(self: RunDirectory, summary: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunDirectory, "write_summary", full)
        with pytest.raises(gcs_formation.RunAbortedError, match="No space left"):
            gcs_formation.run(keys, clock="virtual", until=3.0, out=directory / "killed")
    return directory / "killed"


def cut(directory: Path, to: Path, **shares: float) -> Path:
    """Return a copy of a run directory in which files end at a share of their lengths."""
    to.mkdir()
    for file in directory.iterdir():
        data = file.read_bytes()
        (to / file.name).write_bytes(data[: round(len(data) * shares.get(file.stem, 1.0))])
    return to


def test_all_that_was_flown_is_reported_as_by_a_whole_record_and_what_is_missing_is_said(killed: Path) -> None:
    run, whole = load_run(killed), load_run(killed.parent / "whole")
    assert run.summary["followers"] == whole.summary["followers"]
    assert run.summary["safety"] == whole.summary["safety"]
    assert run.whole.truth
    assert run.begun
    assert (run.time_s == whole.time_s).all()
    assert run.missing[0].startswith("summary.json: ")
    assert run.missing[1].startswith("whatever came after t = ")
    assert (run.summary["links"]["2"]["frames_in"], run.summary["control"]["late_ticks"]) == (None, None)
    json.dumps(run.summary, allow_nan=False)
    assert whole.missing == ()


@pytest.mark.parametrize(
    "shares", [{"timeseries": 0.5}, {"truth": 0.6}, {"events": 0.7, "timeseries": 0.8, "truth": 0.9}]
)
def test_files_that_end_anywhere_are_read_as_far_as_they_go_together(
    killed: Path, tmp_path: Path, shares: dict[str, float]
) -> None:
    run = load_run(cut(killed, tmp_path / "cut", **shares))
    assert 0 < run.whole_time_s.size < load_run(killed).whole_time_s.size
    assert run.summary["duration_s"] <= 3.0


def test_without_ground_truth_errors_are_from_telemetry_and_that_is_said(killed: Path, tmp_path: Path) -> None:
    run = load_run(cut(killed, tmp_path / "cut", truth=0.0))
    assert not run.whole.truth
    assert any(text.startswith("ground truth") for text in run.missing)


@pytest.mark.parametrize("share", [0.0, 0.01])
def test_a_run_that_never_flew_is_refused_with_its_last_phase(killed: Path, tmp_path: Path, share: float) -> None:
    with pytest.raises(gcs_formation.RecordError, match=r"found no control tick in .*: the last phase"):
        load_run(cut(killed, tmp_path / "cut", timeseries=share * 0.2))


@pytest.mark.parametrize("command", [["report"], ["fly", "--resume"]])
def test_a_record_of_a_version_with_other_values_is_refused_in_a_line(
    killed: Path, tmp_path: Path, command: list[str]
) -> None:
    older = cut(killed, tmp_path / "older")
    head, _, ticks = (older / SPOOL).read_bytes().partition(b"\n")
    (older / SPOOL).write_bytes(json.dumps({"vehicles": json.loads(head)["vehicles"]}).encode() + b"\n" + ticks)
    done = CliRunner().invoke(main, [*command, str(older)])
    assert done.exit_code == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert f"found other values than this version's in {older / SPOOL}" in line
