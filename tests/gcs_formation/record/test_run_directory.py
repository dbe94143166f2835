import errno
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest

from airlink.clock import Instant, after
from airlink.frame import FrameWriter
from airlink.messages.system import Statustext
from formation_scenario import load_scenario
from gcs_formation.errors import RecordError
from gcs_formation.phases import Cause
from gcs_formation.record.json_shape import mismatch
from gcs_formation.record.run_directory import RunDirectory, event_shape, recorded_in
from gcs_formation.record.timeseries import Spool
from gcs_formation.record.tlog import read_tlog
from gcs_formation.recorder import Event, Tick, VehicleLink

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


def beat(number: int) -> bytes:
    return FrameWriter(1, 1).encode(Statustext(6, f"frame {number}"))


def tick_at(at_s: float) -> Tick:
    links = [VehicleLink(Instant(0)) for _ in SCENARIO.vehicles]
    return Tick(after(Instant(0), at_s), math.nan, "flying", 0, links, [0.1, 0.1], [0.1, 0.1], [True, True])


def on_disk(path: Path) -> tuple[int, int]:
    """Return how many frames and how many ticks a crash would leave."""
    return len(list(read_tlog(path / "flight.tlog"))), Spool(path / "timeseries.ticks").ticks


def test_at_most_a_second_of_frames_and_ticks_is_lost_by_a_crash(tmp_path: Path) -> None:
    """Both are written together, whichever comes first."""
    made = record(tmp_path)
    for number, (at_s, found) in enumerate(
        ((0.0, (1, 0)), (0.5, (1, 0)), (0.999, (1, 0)), (1.0, (4, 0)), (1.9, (4, 0)))
    ):
        made.frames(after(Instant(0), at_s), [beat(number)])
        assert on_disk(tmp_path) == found, at_s
    for at_s, found in ((1.95, (4, 0)), (2.0, (5, 2)), (2.9, (5, 2)), (3.0, (5, 4))):
        made.tick(tick_at(at_s))
        assert on_disk(tmp_path) == found, at_s
    made.frames(after(Instant(0), 3.1), [beat(9)])
    made.close()
    assert on_disk(tmp_path) == (6, 4)


def test_files_are_flushed_as_often_as_is_asked_and_at_any_time(tmp_path: Path) -> None:
    identities = [vehicle.vehicle_id for vehicle in SCENARIO.vehicles]
    made = RunDirectory(tmp_path, SCENARIO, identities, 0, flush_s=10.0)
    for at_s in (0.0, 9.9):
        made.tick(tick_at(at_s))
    assert on_disk(tmp_path) == (0, 1)
    made.flush()
    assert on_disk(tmp_path) == (0, 2)
    made.close()


def test_a_run_without_a_telemetry_log_has_everything_else(tmp_path: Path) -> None:
    made = RunDirectory(tmp_path, SCENARIO, [vehicle.vehicle_id for vehicle in SCENARIO.vehicles], 0, frames=False)
    made.frames(Instant(0), [beat(1)])
    made.tick(tick_at(0.0))
    made.close()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["events.jsonl", "run.yaml", "timeseries.ticks"]
    assert Spool(tmp_path / "timeseries.ticks").ticks == 1


def test_events_are_lines_of_json_as_the_schema_has_them(tmp_path: Path) -> None:
    """Times are in seconds; a figure that isn't finite is null; a line is on the disk at once."""
    made, vehicle = record(tmp_path), SCENARIO.vehicles[1].vehicle_id
    details: dict[str, Any] = {"off_m": math.nan, "most": math.inf, "laps": 3, "held": True, "why": None, "share": 0.5}
    made.event(Event(after(Instant(0), 2.5), "lap", "höher", vehicle, details))
    lines = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert lines[0] == {"schema": 1, "t_s": 0.0, "kind": "recording", "text": "begins", "epoch_us": 0}
    known = {"off_m": None, "most": None, "laps": 3, "held": True, "why": None, "share": 0.5}
    assert lines[1] == {"schema": 1, "t_s": 2.5, "kind": "lap", "text": "höher", "vehicle": str(vehicle)} | known
    assert "höher" in (tmp_path / "events.jsonl").read_text()
    schema = json.loads((Path(__file__).parents[3] / "docs/events.schema.json").read_text())
    for line in lines:
        jsonschema.validate(line, schema)
    made.close()


def test_who_listens_is_told_every_event_and_tick_also_of_a_run_that_records_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first reason stays; of a full disk no more ticks and frames are tried, events are."""
    made, events, ticks = record(tmp_path), list[Event](), list[Tick]()
    made.tell_events_to(events.append)
    made.tell_ticks_to(ticks.append)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(made._spool, "add", full)
    given = [tick_at(0.0), tick_at(0.1)]
    for each in given:
        made.tick(each)
    assert made.failure == f"cannot go on recording in {tmp_path}: No space left on device"
    made.frames(Instant(5), [beat(1)])
    made.event(Event(Instant(7), "mode", "GUIDED"))
    made._give_up(OSError("another"))
    assert "No space left" in made.failure
    assert (ticks, [each.text for each in events]) == (given, ["GUIDED"])
    made.close()
    assert on_disk(tmp_path) == (0, 0)
    assert "GUIDED" in (tmp_path / "events.jsonl").read_text()


def test_a_flush_or_a_close_that_fails_is_the_reason_why_recording_stops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError("gone")

    for number, method in enumerate(("flush", "close")):
        made = record(tmp_path / str(number))
        with monkeypatch.context() as patch:
            patch.setattr(made._spool, method, fails)
            made.frames(Instant(0), [beat(1)])
            if method == "close":
                made.close()
        assert made.failure == f"cannot go on recording in {tmp_path / str(number)}: gone"
        made.close()


def test_a_line_or_a_file_that_cannot_be_written_is_the_reason_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError("gone")

    record(tmp_path / "replace_earlier").close()
    given: dict[str, tuple[Any, ...]] = {
        "event": (Event(Instant(1), "mode", "GUIDED"),),
        "record_scenario": (SCENARIO,),
        "replace_earlier": (),
    }
    for method, arguments in given.items():
        made = record(tmp_path / method)
        where = made.path
        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", fails)
            if method == "event":
                made._events.close()
                patch.setattr(made, "_events", SimpleNamespace(write=fails, close=lambda: None))
            getattr(made, method)(*arguments)
            assert made.failure == f"cannot go on recording in {where}: gone"
            made.close()


def test_a_summary_is_whole_or_not_there_and_has_no_number_that_json_does_not_know(tmp_path: Path) -> None:
    made = record(tmp_path)
    made.write_summary({"name": "größer", "value": 1.5})
    assert json.loads((tmp_path / "summary.json").read_text()) == {"name": "größer", "value": 1.5}
    assert (tmp_path / "summary.json").read_text() == '{\n  "name": "größer",\n  "value": 1.5\n}\n'
    with pytest.raises(ValueError, match="JSON"):
        made.write_summary({"value": math.nan})
    assert json.loads((tmp_path / "summary.json").read_text())["value"] == 1.5
    assert not (tmp_path / "summary.json.part").exists()
    changed = SCENARIO.model_copy(update={"name": "another"})
    made.record_scenario(changed)
    assert load_scenario(tmp_path / "run.yaml").name == "another"
    made.close()


def test_the_shape_of_an_event_follows_from_its_kind() -> None:
    port = {"t_s": 0.0, "kind": "port", "text": "", "endpoint": "udpout:a:1", "port": 14550}
    assert mismatch(port, event_shape(port), "f") is None
    assert mismatch(port | {"port": "x"}, event_shape(port), "f") is not None
    other = {"t_s": 0.0, "kind": "mode", "text": ""}
    assert mismatch(other, event_shape(other), "f") is None
    wrongs: list[Any] = [other | {"kind": 3}, [], other | {"t_s": "0"}, {"kind": "design", "t_s": 0, "text": ""}]
    for wrong in wrongs:
        assert mismatch(wrong, event_shape(wrong), "f") is not None


def test_a_directory_is_recorded_into_only_if_a_run_lies_there_that_commanded_none(tmp_path: Path) -> None:
    """What isn't JSON, or another program's, isn't such a run."""
    for text in ('{"kind": "phase"}', "[]", "{", '{"kind": "phase", "cause": "none of ours"}'):
        (tmp_path / "run.yaml").write_text("earlier")
        (tmp_path / "events.jsonl").write_text(text)
        with pytest.raises(RecordError, match="found an earlier run"):
            record(tmp_path, overwrite=False)
        assert (tmp_path / "run.yaml").read_text() == "earlier"


def test_a_record_says_which_extensions_its_scenario_uses(tmp_path: Path) -> None:
    """Without any the file isn't there."""
    record(tmp_path / "plain").close()
    assert not (tmp_path / "plain/extensions.json").exists()
    file = tmp_path / "own.py"
    code = "from gcs_formation.extend import Metric, register_metric\n\n@register_metric('own')\nclass Own(Metric):\n"
    file.write_text(f"{code}    def measure(self, flight):\n        return 1.0\n")
    keys = {"vehicles": {"count": 2}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}}
    scenario = load_scenario(keys | {"expect": [{"metric": "own", "below": 2}]}, plugins=[file])
    RunDirectory(tmp_path / "own", scenario, [each.vehicle_id for each in scenario.vehicles], 0).close()
    (found,) = json.loads((tmp_path / "own/extensions.json").read_text())
    assert (found["name"], found["kind"], found["file"]) == ("own", "metric", str(file))
