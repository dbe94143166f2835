"""What a viewer reads: a run under way, killed, finished; any telemetry log, also one with garbage in it."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from airlink.frame import FrameWriter
from airlink.messages.system import Heartbeat, RadioStatus, Timesync
from gcs_formation.errors import RecordError
from gcs_formation.record.parquet import read_parquet
from gcs_formation.view.log import LogRecording
from gcs_formation.view.recording import COLUMN, COLUMNS, chosen, described, packed, state_at
from gcs_formation.view.run import CONCLUDES_S, SILENT_S, RunRecording
from tests.gcs_formation.view.conftest import Flown


def read_whole(path: Path) -> RunRecording:
    recording = RunRecording(path)
    for _ in range(4):
        recording.poll(0.0)
    return recording


def test_a_run_under_way_is_live_and_grows(flown: Flown) -> None:
    assert flown.state_in_flight == "live"
    assert 0 < flown.ticks_in_flight < read_whole(flown.finished).times.time_s.size


def test_a_finished_runs_rows_are_its_time_series(flown: Flown) -> None:
    recording, series = read_whole(flown.finished), read_parquet(flown.finished / "timeseries.parquet")
    assert recording.state == "ended"
    ticks = np.flatnonzero(np.isin(recording.times.time_s, series["t_s"]))
    assert ticks.size == series["t_s"].size // 3
    rows = recording.rows(ticks)
    for name, own in (("north_m", "true_north_m"), ("error_x_m", "error_x_m"), ("delay_s", "delay_s")):
        np.testing.assert_allclose(rows[:, :, COLUMN[name]], series[own].reshape(-1, 3), rtol=1e-6, atol=1e-4)


def test_a_follower_is_in_its_slot_when_its_error_is_nought(flown: Flown) -> None:
    recording = read_whole(flown.finished)
    rows = recording.rows(np.arange(recording.times.time_s.size))[:, 1:]
    error = np.linalg.norm([rows[:, :, COLUMN[f"error_{axis}_m"]] for axis in "xy"], axis=0)
    difference = np.hypot(
        *(rows[:, :, COLUMN[f"slot_{way}_m"]] - rows[:, :, COLUMN[f"{way}_m"]] for way in ("north", "east"))
    )
    known = np.isfinite(error)
    assert known.any()
    np.testing.assert_allclose(difference[known], error[known], atol=1e-3)


def test_frames_tell_what_ticks_do_not(flown: Flown) -> None:
    recording = read_whole(flown.finished)
    last = recording.rows(np.array([recording.times.time_s.size - 1]))[0]
    assert (last[:, COLUMN["armed"]] == 1.0).all()
    assert (last[:, COLUMN["loss"]] == 0.0).all()
    assert (last[:, COLUMN["battery"]] > 0.5).all()
    assert (last[:, COLUMN["rate_down_kbps"]] > 1.0).all()


def test_a_killed_run_shows_as_such_and_up_to_where_it_got(flown: Flown) -> None:
    recording = read_whole(flown.killed)
    assert recording.state == "killed"
    assert recording.times.time_s.size >= flown.ticks_in_flight
    recording.poll(CONCLUDES_S)
    assert recording.state == "killed"


def test_a_run_that_takes_the_place_of_an_earlier_one_is_followed_there(flown: Flown, tmp_path: Path) -> None:
    """Until it commands a vehicle, a run is recorded beside the earlier one that it replaces."""
    beside = tmp_path / "unflown"
    shutil.copytree(flown.killed, beside)
    spool = beside / "timeseries.ticks"
    data = spool.read_bytes()
    spool.write_bytes(data[: len(data) // 2])
    recording = RunRecording(tmp_path)
    before = recording.times.time_s.size
    spool.write_bytes(data)
    for each in beside.iterdir():
        each.replace(tmp_path / each.name)
    beside.rmdir()
    recording.poll(0.1)
    assert 0 < before < recording.times.time_s.size


def test_a_station_that_writes_nothing_is_silent(flown: Flown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs_formation.view.run.is_locked", lambda _: True)
    recording = read_whole(flown.killed)
    assert recording.state == "live"
    recording.poll(SILENT_S + 0.1)
    assert recording.state == "silent"


def test_a_state_has_the_contracts_keys(flown: Flown) -> None:
    recording = read_whole(flown.finished)
    newest = state_at(recording, None)
    assert {"time_s", "mission_time_s", "phase", "live", "vehicles"} <= newest.keys()
    assert newest["vehicles"].keys() == {"1", "2", "3"}
    assert {"north_m", "east_m", "height_m", "error_m", "delay_ms", "margin_used"} <= newest["vehicles"]["2"].keys()
    assert newest["live"] is False
    json.dumps(newest, allow_nan=False)
    at = state_at(recording, 3.0)
    assert at["time_s"] == pytest.approx(3.0, abs=0.1)
    assert at["time_s"] < newest["time_s"]
    assert all(isinstance(error, float) for error in at["vehicles"]["2"]["error_m"])
    assert at["vehicles"]["1"]["error_m"] == [None, None, None]


@pytest.mark.parametrize(("count", "vehicles", "begin", "end", "rows"), [(1000, 10, 0, 1000, 200), (7, 3, 2, 99, 1e9)])
def test_chosen_ticks_include_the_first_and_the_last(count, vehicles, begin, end, rows) -> None:
    ticks = chosen(count, vehicles, begin, end, int(rows))
    assert (ticks[0], ticks[-1]) == (begin, min(end, count) - 1)
    assert ticks.size * vehicles <= rows
    assert (np.diff(ticks) > 0).all()


def test_packed_ticks_are_aligned_numbers(flown: Flown) -> None:
    recording = read_whole(flown.finished)
    data, ticks = packed(recording, np.array([0, 5, 9])), np.array([0, 5, 9])
    length = int.from_bytes(data[:4], "little")
    head = json.loads(data[4 : 4 + length])
    assert (4 + length) % 8 == 0
    assert (head["count"], head["vehicles"], head["columns"]) == (3, 3, len(COLUMNS))
    three = np.frombuffer(data, "<f8", 9, 4 + length).reshape(3, 3)
    np.testing.assert_array_equal(three[:, 0], recording.times.time_s[ticks])
    values = np.frombuffer(data, "<f4", offset=4 + length + 72).reshape(3, 3, len(COLUMNS))
    np.testing.assert_array_equal(values, recording.rows(ticks))


def test_a_log_shows_where_vehicles_were(flown: Flown) -> None:
    run, log = read_whole(flown.finished), LogRecording(flown.finished / "flight.tlog")
    assert (log.state, log.vehicles) == ("log", ["1", "2", "3"])
    at = state_at(log, 5.0)["vehicles"]
    true = state_at(run, 5.0)["vehicles"]
    for other in ("2", "3"):  # positions in a log count from its first one
        for way in ("north_m", "east_m"):
            assert at[other][way] - at["1"][way] == pytest.approx(true[other][way] - true["1"][way], abs=1.0)
    assert {event["kind"] for event in log.events} >= {"mode", "arming"}
    assert described(log)["scene"]["name"] == "flight.tlog"


def test_garbage_in_a_log_is_skipped(flown: Flown, tmp_path: Path) -> None:
    data = (flown.finished / "flight.tlog").read_bytes()
    middle = data.index(b"\xfd", len(data) // 2) - 8
    broken = tmp_path / "broken.tlog"
    broken.write_bytes(data[:middle] + bytes(range(256)) * 3 + b"\xfd\xfe" * 50 + data[middle:])
    whole, skipped = LogRecording(flown.finished / "flight.tlog"), LogRecording(broken)
    assert skipped.vehicles == whole.vehicles
    assert skipped.times.time_s[-1] == pytest.approx(whole.times.time_s[-1], abs=1.0)
    places = [state_at(each, 5.0)["vehicles"]["2"]["north_m"] for each in (whole, skipped)]
    assert places[0] == pytest.approx(places[1], abs=3.0)


@pytest.mark.parametrize("data", [b"", b"nothing", bytes(10_000), b"\xfd" * 5000, bytes(range(256)) * 40])
def test_what_is_no_log_is_refused_in_words(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "some.tlog"
    file.write_bytes(data)
    with pytest.raises(RecordError, match="allowed: a telemetry log"):
        LogRecording(file)


def test_what_is_no_run_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="allowed: the directory of a run"):
        RunRecording(tmp_path)


def test_round_trips_are_read_from_the_frames(tmp_path: Path) -> None:
    """A request at 1.0 s, its answer at 1.3 s: a delay of 150 ms each way."""
    station, vehicle = FrameWriter(255, 25), FrameWriter(7, 1)
    frames = [
        (0, vehicle.encode(Heartbeat(1, 3, 128, 15))),
        (1_000_000, station.encode(Timesync(0, 12345))),
        (1_300_000, vehicle.encode(Timesync(999, 12345))),
        (3_000_000, vehicle.encode(Heartbeat(1, 3, 128, 15))),
    ]
    file = tmp_path / "round.tlog"
    file.write_bytes(b"".join((10**15 + at).to_bytes(8, "big") + raw for at, raw in frames))
    log = LogRecording(file)
    assert log.vehicles == ["7"]
    found = state_at(log, None)["vehicles"]["7"]["delay_ms"]
    assert not math.isnan(found)
    assert found == pytest.approx(150.0, abs=0.01)


def test_what_radios_report_is_read_from_the_frames_and_is_no_traffic_to_vehicles(tmp_path: Path) -> None:
    """A radio has no heartbeat. Its levels are there for 5 s; 255 is unknown."""
    radio, vehicle = FrameWriter(51, 68), FrameWriter(7, 1)
    frames = [(0, vehicle.encode(Heartbeat(1, 3, 128, 15)))]
    frames += [(1_000_000, radio.encode(RadioStatus(180, 170, 60, 40, 255, 0, 0)))]
    frames += [(at * 1_000_000, vehicle.encode(Heartbeat(1, 3, 128, 15))) for at in (2, 4, 9)]
    file = tmp_path / "radio.tlog"
    file.write_bytes(b"".join((10**15 + at).to_bytes(8, "big") + raw for at, raw in frames))
    log = LogRecording(file)
    found = state_at(log, 3.0)["vehicles"]["7"]
    assert [found[f"radio_{name}"] for name in ("rssi", "remrssi", "noise", "txbuf_percent")] == [180, 170, 40, 60]
    assert found["radio_remnoise"] is None
    assert found["rate_up_kbps"] == 0.0
    assert state_at(log, 9.0)["vehicles"]["7"]["radio_rssi"] is None


def test_a_request_for_a_clock_counts_for_its_vehicle_alone(tmp_path: Path) -> None:
    station, frames = FrameWriter(255, 190), list[tuple[int, bytes]]()
    vehicles = {system: FrameWriter(system, 1) for system in (7, 8)}
    for at in range(4):
        frames += [(at * 1_000_000, each.encode(Heartbeat(1, 3, 128, 15))) for each in vehicles.values()]
        frames.append((at * 1_000_000 + 1, station.encode(Timesync(0, at + 1, 7, 1))))
    file = tmp_path / "asked.tlog"
    file.write_bytes(b"".join((10**15 + at).to_bytes(8, "big") + raw for at, raw in frames))
    found = state_at(LogRecording(file), None)["vehicles"]
    assert found["7"]["rate_up_kbps"] > 0.0
    assert found["8"]["rate_up_kbps"] == 0.0
