import json
from pathlib import Path

import pytest

from airlink.clock import Instant
from formation_scenario import load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.phases import Cause
from gcs_formation.record.run_directory import RunDirectory, recorded_in
from gcs_formation.recorder import Event

SCENARIO = load_scenario({"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}})


def record(path: Path, *, overwrite: bool = True) -> RunDirectory:
    return RunDirectory(path, SCENARIO, [vehicle.vehicle_id for vehicle in SCENARIO.vehicles], 0, overwrite=overwrite)


def test_a_directory_that_another_run_records_into_is_left_alone(tmp_path: Path) -> None:
    first = record(tmp_path)
    kept = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(RecordError, match="found another run that is recording into"):
        record(tmp_path)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == kept
    first.close()
    record(tmp_path).close()


def test_an_earlier_run_and_any_elses_files_are_left_alone_unless_overwriting(tmp_path: Path) -> None:
    run, other = tmp_path / "run", tmp_path / "other"
    record(run, overwrite=False).close()
    other.mkdir()
    (other / "notes.txt").write_text("mine")
    kept = (run / "run.yaml").stat()
    with pytest.raises(RecordError, match=r"found an earlier run in .*--overwrite"):
        record(run, overwrite=False)
    assert (run / "run.yaml").stat() == kept
    for overwrite in (False, True):
        with pytest.raises(RecordError, match=r"found files in .*, and no run\.yaml"):
            record(other, overwrite=overwrite)
    assert [file.name for file in other.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("causes", "replaced"),
    [
        ([], False),
        ([Cause.NOT_BEGUN], True),
        ([Cause.REHEARSED], True),
        ([Cause.CALLED_OFF], True),
        ([Cause.FAILURE], False),
        ([Cause.LEADER_READY, Cause.NOT_BEGUN], False),
    ],
)
def test_a_run_that_ended_before_it_commanded_any_is_replaced(
    tmp_path: Path, causes: list[Cause], replaced: bool
) -> None:
    """Although it has a summary, of nothing."""
    first = record(tmp_path, overwrite=False)
    first.write_summary({})
    for cause in causes:
        first.event(Event(Instant(1), "phase", "failed", None, {"cause": cause.value}))
    first.close()
    if replaced:
        record(tmp_path, overwrite=False).close()
        assert "phase" not in (tmp_path / "events.jsonl").read_text()
    with pytest.raises(RecordError, match="found an earlier run"):
        record(tmp_path, overwrite=False)


def test_an_earlier_runs_report_goes_with_its_record(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()
    for name in ("run.yaml", "report.html", "figures/errors.png", "summary.json", "notes.txt"):
        (tmp_path / name).write_text("earlier")
    again = record(tmp_path)
    again.replace_earlier()
    again.close()
    assert not any((tmp_path / name).exists() for name in ("report.html", "figures/errors.png", "summary.json"))
    assert (tmp_path / "notes.txt").read_text() == "earlier"


def contents(path: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()}


def test_an_earlier_runs_record_stays_until_the_run_has_begun(tmp_path: Path) -> None:
    first = record(tmp_path)
    first.event(Event(Instant(1), "mode", "GUIDED"))
    first.write_summary({"schema": 1})
    first.close()
    earlier = contents(tmp_path)

    unflown = record(tmp_path)
    unflown.event(Event(Instant(1), "failure", "nobody answered"))
    unflown.close()
    assert contents(tmp_path) == earlier
    assert recorded_in(tmp_path) == tmp_path / "unflown"
    assert "nobody answered" in (tmp_path / "unflown" / "events.jsonl").read_text()

    flown = record(tmp_path)
    flown.event(Event(Instant(1), "mode", "before"))
    assert contents(tmp_path) == earlier
    flown.replace_earlier()
    flown.event(Event(Instant(2), "mode", "after"))
    flown.close()
    words = (tmp_path / "events.jsonl").read_text()
    assert ("before" in words, "after" in words, "GUIDED" in words, "answered" in words) == (True, True, False, False)
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(set(earlier) - {"summary.json"})
    assert recorded_in(tmp_path) == flown.path == tmp_path


def test_a_resumed_runs_events_go_on_after_the_last_whole_line(tmp_path: Path) -> None:
    """Of the line that was being written when the machine lost its power, nothing stays."""
    first, identities = record(tmp_path), [vehicle.vehicle_id for vehicle in SCENARIO.vehicles]
    for text in ("before", "last before"):
        first.event(Event(Instant(1), "mode", text))
    first.close()
    with (tmp_path / "events.jsonl").open("a") as file:
        file.write('{"schema": 1, "t_s"')
    resumed = RunDirectory(tmp_path, SCENARIO, identities, 0, resume=True)
    resumed.event(Event(Instant(2), "mode", "after"))
    resumed.close()
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["text"] for line in lines if '"mode"' in line] == ["before", "last before", "after"]
    assert all(json.loads(line) for line in lines)


def test_no_other_run_records_where_one_is_about_to_begin(tmp_path: Path) -> None:
    record(tmp_path).close()
    beside = record(tmp_path)
    for other in ({"overwrite": True}, {"resume": True}):
        with pytest.raises(RecordError, match="found another run that is recording into"):
            RunDirectory(tmp_path, SCENARIO, [vehicle.vehicle_id for vehicle in SCENARIO.vehicles], 0, **other)
    beside.replace_earlier()
    with pytest.raises(RecordError, match="found another run that is recording into"):
        record(tmp_path)
    beside.close()
