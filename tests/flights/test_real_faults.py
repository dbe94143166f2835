"""Processes that are killed, interrupted, or out of room, under the real clock."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import pytest
import yaml

from gcs_formation.record.timeseries import read_spool
from tests.flights.test_real_clock import LIMIT_S, STATION, emulators_of, path, started, wait_for

__all__ = ["path"]
FILE_BYTES = 150_000


def events_of(out: Path) -> list[dict]:
    return [json.loads(line) for line in (out / "events.jsonl").read_text().splitlines()]


def last_stamp_s(tlog: Path) -> float:
    """Return the span of a telemetry log that is read frame by frame, up to what was cut off."""
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


@pytest.mark.slow
def test_a_killed_station_leaves_a_record_up_to_the_last_second(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--out", str(out)]) as station:
        wait_for(out / "events.jsonl", '"flying"')
        began = time.monotonic()
        time.sleep(3.0)
        os.kill(station.pid, signal.SIGKILL)
        flown_s = time.monotonic() - began
        station.wait(LIMIT_S)
    flying_s = next(event["t_s"] for event in events_of(out) if event["text"] == "flying")
    columns = read_spool(out / "timeseries.arrows")
    assert columns["t_s"][-1] - flying_s > flown_s - 1.5
    assert last_stamp_s(out / "flight.tlog") > flying_s + flown_s - 1.5 - 1.0
    assert not (out / "summary.json").exists()


@pytest.mark.slow
def test_a_station_that_was_stopped_for_a_while_hears_what_came_before_it_judges_anybody(
    path: Path, tmp_path: Path
) -> None:
    """Two wall seconds, eight of flight; vehicles whose setpoints stop fly on."""
    out = tmp_path / "run"
    with started(
        [*STATION, "run", str(path), "--speedup", "4", "--set", "duration_s=14", "--out", str(out)]
    ) as station:
        wait_for(out / "events.jsonl", '"flying"')
        station.send_signal(signal.SIGSTOP)
        time.sleep(2.0)
        station.send_signal(signal.SIGCONT)
        _, said = station.communicate(timeout=LIMIT_S)
        assert station.returncode == 0, said
    assert json.loads((out / "summary.json").read_text())["control"]["period_ms"]["max"] > 4000.0
    begun = [event["text"] for event in events_of(out)].index("flying")
    assert {event["kind"] for event in events_of(out)[begun + 1 :]} == {"phase", "mode"}  # those of the end


@pytest.mark.slow
def test_emulators_that_are_killed_end_the_run_with_3_and_a_whole_record(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--speedup", "4", "--out", str(out)]) as station:
        wait_for(out / "events.jsonl", '"flying"')
        children = Path(f"/proc/{station.pid}/task/{station.pid}/children").read_text().split()
        for child in children:
            os.kill(int(child), signal.SIGKILL)
        _, said = station.communicate(timeout=LIMIT_S)
        assert station.returncode == 3
    assert "the emulated vehicles' process has ended" in said
    assert "Traceback" not in said
    assert events_of(out)[-1]["text"] == "failed"
    assert len(read_spool(out / "timeseries.arrows")["t_s"]) > 0


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.0, 0.3, 0.7, 1.2, 2.0])
def test_interrupted_at_any_moment_of_its_start_up_it_ends_with_130(path: Path, tmp_path: Path, after_s: float) -> None:
    out = tmp_path / "run"
    on_the_ground = ["--set", "start.in_air=false", "--out", str(out)]
    with started([*STATION, "run", str(path), *on_the_ground]) as station:
        while not _imports(station.pid):
            time.sleep(0.005)
        time.sleep(after_s)
        station.send_signal(signal.SIGINT)
        _, said = station.communicate(timeout=LIMIT_S)
    assert station.returncode == 130, said
    assert "Traceback" not in said
    if (out / "events.jsonl").exists():
        assert all(event["schema"] == 1 for event in events_of(out))
    assert not emulators_of(tmp_path)


def _imports(pid: int) -> bool:
    """Whether a process has begun to import what it needs: before that, it's Python's own start-up."""
    return "numpy" in Path(f"/proc/{pid}/maps").read_text()


@pytest.mark.slow
def test_a_full_disk_ends_with_3_and_words(path: Path, tmp_path: Path) -> None:
    """The limit on a file's size stands for the disk's: what is written beyond it fails likewise."""
    out = tmp_path / "run"
    done = subprocess.run(
        [*STATION, "run", str(path), "--speedup", "4", "--out", str(out)],
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
    """Twice as fast as real time; faults strike by the mission time, of which vehicles are told once a second."""
    out, endpoint = tmp_path / "run", yaml.safe_load(path.read_text())["vehicles"]["endpoint"]
    vehicles = f"vehicles={{count: 6, endpoint: '{endpoint}'}}"
    keys = ["duration_s=24", "formation.shape=circle", "formation.spacing_m=40", f"faults={FAULTS}", vehicles]
    command = [*STATION, "run", str(path), "--speedup", "2", *(f"--set={key}" for key in keys), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    events = events_of(out)
    begun_s = next(event["t_s"] for event in events if event["text"] == "flying")

    def when(vehicle: int, text: str) -> list[float]:
        those = [event for event in events if event.get("vehicle") == str(vehicle) and event["t_s"] > begun_s]
        return [event["t_s"] - begun_s for event in those if text in (event["text"], event["kind"])]

    assert when(2, "lost") == [pytest.approx(9.0, abs=0.5)]
    unheard = "not heard: told nothing until it is"
    assert when(2, unheard) == [pytest.approx(9.0, abs=0.5)]
    assert when(3, unheard) == [pytest.approx(9.0, abs=0.5)]
    assert when(3, "flying in formation")[0] == pytest.approx(12.0, abs=2.0)
    assert when(4, "restarted") == [pytest.approx(4.0, abs=1.0)]
    assert when(4, "ready") == [pytest.approx(6.0, abs=2.0)]
    assert when(5, "parted by its pilot") == [pytest.approx(4.0, abs=0.5)]
    assert when(5, "flying in formation") == [pytest.approx(8.0, abs=0.5)]
    (heir,) = [event for event in events if event["kind"] == "leader"]
    assert heir["t_s"] - begun_s == pytest.approx(18.0, abs=0.5)
    assert not when(6, "told to loiter")
