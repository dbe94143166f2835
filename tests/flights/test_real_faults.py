"""Processes that are killed, interrupted, or out of disk space, under the real clock."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.timeseries import Spool
from tests.flights.test_real_clock import emulators_of, late_s, path
from tests.processes import LIMIT_S, STATION, events_of, started, wait_for, wait_for_event

__all__ = ["path"]
FILE_BYTES = 150_000


def last_stamp_s(tlog: Path) -> float:
    """Return the span of a telemetry log, read frame by frame up to where it was cut off."""
    data, at, first, last = tlog.read_bytes(), 0, None, 0
    while at + 8 + 12 <= len(data):
        stamp = int.from_bytes(data[at : at + 8], "big")
        assert data[at + 8] == 0xFD
        length = 8 + 12 + data[at + 9]
        if at + length > len(data):
            break
        first, last, at = first or stamp, stamp, at + length
    assert first is not None
    return (last - first) / 1e6


def flown_s(out: Path) -> float:
    """Return how much of the flight along the path has been recorded so far, s."""
    begun_s = [event["t_s"] for event in events_of(out) if event["text"] == "flying"]
    spool = out / "timeseries.ticks"
    recorded_s = Spool(spool).read()["t_s"] if spool.exists() else np.zeros(0)
    return float(recorded_s[-1]) - begun_s[0] if begun_s and recorded_s.size else 0.0


@pytest.mark.slow
def test_a_killed_station_leaves_a_record_of_what_it_had_flown(path: Path, tmp_path: Path) -> None:
    """The record is written at least once a second: three seconds are in it long before the end."""
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--out", str(out)]) as station:
        wait_for_event(out, "flying")
        wait_for(lambda: flown_s(out) >= 3.0)
        seen_s = flown_s(out)
        os.kill(station.pid, signal.SIGKILL)
        station.wait(LIMIT_S)
    assert seen_s <= flown_s(out) < 20.0, "killed before its end"
    received_s = next(event["t_s"] for event in events_of(out) if event["text"] == "connected")
    flying_s = next(event["t_s"] for event in events_of(out) if event["text"] == "flying")
    # Both are written at least once a second by the station's clock; its own lateness shows in its ticks.
    late = float(np.diff(np.unique(Spool(out / "timeseries.ticks").read()["t_s"])).max())
    assert received_s + last_stamp_s(out / "flight.tlog") > flying_s + flown_s(out) - 1.0 - late
    assert not (out / "summary.json").exists()


@pytest.mark.slow
def test_a_station_that_was_stopped_for_a_while_processes_what_came_before_it_judges_any_vehicle(
    path: Path, tmp_path: Path
) -> None:
    """It is stopped for eight seconds; vehicles without setpoints fly on."""
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--set", "duration_s=14", "--out", str(out)]) as station:
        wait_for_event(out, "flying")
        station.send_signal(signal.SIGSTOP)
        time.sleep(8.0)  # the fault itself: it is stopped for this time of the clock that all go by
        station.send_signal(signal.SIGCONT)
        _, said = station.communicate(timeout=LIMIT_S)
        assert station.returncode == 0, said
    assert json.loads((out / "summary.json").read_text())["control"]["period_ms"]["max"] > 7000.0
    begun = [event["text"] for event in events_of(out)].index("flying")
    assert {event["kind"] for event in events_of(out)[begun + 1 :]} == {"phase", "mode"}  # events of the end only


@pytest.mark.slow
def test_emulators_that_are_killed_end_the_run_with_3_and_a_whole_record(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--speedup", "4", "--out", str(out)]) as station:
        wait_for_event(out, "flying")
        children = Path(f"/proc/{station.pid}/task/{station.pid}/children").read_text().split()
        for child in children:
            os.kill(int(child), signal.SIGKILL)
        _, said = station.communicate(timeout=LIMIT_S)
        assert station.returncode == 3
    assert "the emulated vehicles' process has ended" in said
    assert "Traceback" not in said
    assert [event["kind"] for event in events_of(out)].count("failure") == 1
    assert events_of(out)[-1]["text"] == "failed"
    assert len(read_parquet(out / "timeseries.parquet")["t_s"]) > 0


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.0, 0.3, 0.7, 1.2, 2.0])
def test_interrupted_at_any_moment_of_its_start_up_it_ends_with_130(path: Path, tmp_path: Path, after_s: float) -> None:
    out = tmp_path / "run"
    on_the_ground = ["--set", "start.in_air=false", "--out", str(out)]
    with started([*STATION, "run", str(path), *on_the_ground]) as station:
        wait_for(lambda: _imports(station.pid), every_s=0.005)
        time.sleep(after_s)  # the moment is the parameter; no event marks it
        station.send_signal(signal.SIGINT)
        _, said = station.communicate(timeout=LIMIT_S)
    assert station.returncode == 130, said
    assert "Traceback" not in said
    if (out / "events.jsonl").exists():
        assert all(event["schema"] == 1 for event in events_of(out))
    assert not emulators_of(tmp_path)


def _imports(pid: int) -> bool:
    """Whether a process has begun to import our modules: before that, it's Python's own start-up."""
    return "numpy" in Path(f"/proc/{pid}/maps").read_text()


@pytest.mark.slow
def test_a_full_disk_ends_with_3_and_words(path: Path, tmp_path: Path) -> None:
    """A limit on the file size stands in for a full disk: writing beyond it fails in the same way."""
    out = tmp_path / "run"
    done = subprocess.run(
        [*STATION, "run", str(path), "--speedup", "4", "--quiet", "--out", str(out)],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES)),
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 3, done.stderr
    assert done.stderr.startswith(f"cannot go on recording in {out}: File too large")
    assert (out / "flight.tlog").stat().st_size <= FILE_BYTES
    events = events_of(out)
    assert sum(event["kind"] == "mode" and event["text"] == "LOITER" for event in events) == 3


FAULTS = """[
 {at_s: 4, vehicles: [2], kind: crash},
 {at_s: 4, until_s: 12, vehicles: [3], kind: freeze},
 {at_s: 4, vehicles: [4], kind: restart},
 {at_s: 4, until_s: 8, vehicles: [5], kind: pilot},
 {at_s: 15, vehicles: [1], kind: crash}]"""


@pytest.mark.slow
def test_faults_over_udp_lead_to_what_they_lead_to_under_the_virtual_clock(path: Path, tmp_path: Path) -> None:
    """Faults begin at mission times, which vehicles are sent once a second."""
    out, endpoint = tmp_path / "run", yaml.safe_load(path.read_text())["vehicles"]["endpoint"]
    vehicles = f"vehicles={{count: 6, endpoint: '{endpoint}'}}"
    keys = ["duration_s=24", "formation.shape=circle", "formation.spacing_m=40", f"faults={FAULTS}", vehicles]
    command = [*STATION, "run", str(path), *(f"--set={key}" for key in keys), "--quiet", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    said = [line for line in done.stderr.splitlines() if not line.startswith("late ticks:")]
    assert (done.returncode, said) == (0, []), "a machine that is loaded is said"
    events = events_of(out)
    begun_s = next(event["t_s"] for event in events if event["text"] == "flying")
    late = late_s(json.loads((out / "summary.json").read_text()))

    def about(at_s: float, within_s: float = 0.5) -> Any:
        return pytest.approx(at_s, abs=within_s + late)

    def when(vehicle: int, text: str) -> list[float]:
        those = [event for event in events if event.get("vehicle") == str(vehicle) and event["t_s"] > begun_s]
        return [event["t_s"] - begun_s for event in those if text in (event["text"], event["kind"])]

    assert when(2, "lost") == [about(9.0)]
    silent = "not heard: told nothing until it is"
    assert when(2, silent) == [about(9.0)]
    assert when(3, silent) == [about(9.0)]
    assert when(3, "flying in formation")[0] == about(12.0, 2.0)
    assert when(4, "restarted") == [about(4.0, 1.0)]
    assert when(4, "ready") == [about(6.0, 2.0)]
    assert when(5, "parted by its pilot") == [about(4.0)]
    assert when(5, "flying in formation") == [about(8.0)]
    (heir,) = [event for event in events if event["kind"] == "leader"]
    assert heir["t_s"] - begun_s == about(18.0)
    assert not when(6, "told to loiter")
