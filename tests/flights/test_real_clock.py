"""Flights over UDP: processes, sockets, signals and exit statuses as users and scripts see them."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner, Result

from gcs_formation.cli import main
from gcs_formation.record.parquet import read_parquet
from tests.flights.conftest import scenario
from tests.processes import LIMIT_S, STATION, VEHICLES, events_of, free_port, started, wait_for, wait_for_event

SPEED_MPS = 22


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a short scenario on a port of its own."""
    keys = scenario(duration_s=20, vehicles={"count": 3, "endpoint": f"udpin:127.0.0.1:{free_port()}"})
    file = tmp_path / "short.yaml"
    file.write_text(yaml.safe_dump(keys))
    return file


def said(*arguments: str) -> Result:
    """Run the command line with these arguments in this process."""
    return CliRunner().invoke(main, arguments)


def late_s(summary: dict[str, Any]) -> float:
    """Return how late this machine was, in seconds of flight: the station's ticks, and the links' answers."""
    period_ms, rate_hz = summary["control"]["period_ms"], summary["control"]["rate_hz"]
    slowest_ms = max(link["measured_delay_ms"]["p99"] for link in summary["links"].values())
    return (max(0.0, period_ms["max"] - 1e3 / rate_hz) + 2 * slowest_ms) / 1e3


def worst_rms_m(summary: dict[str, Any]) -> float:
    return max(f[f"error_{axis}_m"]["rms"] for f in summary["followers"].values() for axis in "xyz")


def emulators_of(path: Path) -> list[str]:
    """Return the command lines of running processes that name a file of this test."""
    lines: list[str] = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = entry.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if str(path) in line and "sim_vehicles" in line:
            lines.append(line)
    return lines


@pytest.mark.slow
def test_run_over_udp_is_as_good_as_under_the_virtual_clock(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    keys = ["--set", "duration_s=10"]
    command = [*STATION, "run", str(path), *keys, "--out", str(out), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert worst_rms_m(summary) < 0.3 + SPEED_MPS * late_s(summary)
    assert summary["truth"] is True
    assert not emulators_of(tmp_path)


@pytest.mark.slow
def test_fly_against_vehicles_started_by_hand(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    low = "path.waypoints_m=[[0, 0, 50], [2000, 0, 50]]"
    on_the_ground = ["--set", "start.in_air=false", "--set", low, "--set", "duration_s=8"]
    with started([*VEHICLES, str(path), *on_the_ground]) as vehicles:
        assert vehicles.stdout is not None
        assert "vehicle 1 sends to 127.0.0.1" in vehicles.stdout.readline()
        command = [*STATION, "fly", str(path), *on_the_ground, "--out", str(out), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["truth"] is False
    assert worst_rms_m(summary) < 1.0 + SPEED_MPS * late_s(summary)  # as the law saw it: stamps may be late, too


@pytest.mark.slow
def test_ctrl_c_has_the_vehicles_loiter_and_leaves_a_whole_record(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--speedup", "4", "--out", str(out)]) as station:
        wait_for_event(out, "flying")
        station.send_signal(signal.SIGINT)
        assert station.wait(LIMIT_S) == 130
    events = events_of(out)
    assert sum(event["kind"] == "mode" and event["text"] == "LOITER" for event in events) == 3
    assert len(read_parquet(out / "timeseries.parquet")["t_s"]) > 0
    assert json.loads((out / "summary.json").read_text())["followers"]
    assert not emulators_of(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "fly"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_one_that_is_stopped_before_any_has_flown_leaves_a_whole_record_too(
    command: str, number: signal.Signals, foreground: None, path: Path, tmp_path: Path
) -> None:
    """On the ground, or nobody answers; its report says so."""
    out = tmp_path / "run"
    words = [command, str(path), "--set", "start.in_air=false", "--out", str(out)]
    with started([*STATION, *words]) as station:
        wait_for_event(out, "begins")
        station.send_signal(number)
        assert station.wait(LIMIT_S) == 130
        assert station.stderr is not None
        assert "Traceback" not in station.stderr.read()
    assert json.loads((out / "summary.json").read_text())["duration_s"] == 0.0
    report = said("report", str(out))
    assert (report.exit_code, "nothing was flown" in report.output) == (2, True)
    assert not emulators_of(tmp_path)


@pytest.mark.slow
def test_killed_the_station_takes_its_vehicles_along(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with started([*STATION, "run", str(path), "--out", str(out)]) as station:
        wait_for_event(out, "connected")
        assert emulators_of(tmp_path)
        os.kill(station.pid, signal.SIGKILL)
        station.wait(LIMIT_S)
        wait_for(lambda: not emulators_of(tmp_path))


@pytest.mark.slow
def test_a_running_flight_is_ordered_another_shape_and_to_end(path: Path, tmp_path: Path) -> None:
    out = tmp_path / ("a-directory-with-a-long-name-" * 4)
    with started(
        [*STATION, "run", str(path), "--speedup", "2", "--set", "duration_s=170", "--out", str(out)]
    ) as station:
        wait_for_event(out, "flying")
        reported: list[tuple[int, str]] = []
        for order in ("shape line", "speed 40", "shape blob", "loiter"):
            done = said("tell", str(out), *order.split())
            reported.append((done.exit_code, done.output.strip()))
        assert reported[0] == (0, "shape line: accepted")
        assert reported[1] == (1, "speed 40: refused: found 40 m/s; allowed: 16 to 28 m/s, leader 1's limits")
        assert reported[2][0] == 2
        assert reported[3] == (0, "loiter: accepted")
        assert station.wait(LIMIT_S) == 0
    again = said("tell", str(out), "loiter")
    assert again.exit_code == 3
    assert "no flight answers in" in again.stderr


@pytest.mark.slow
def test_a_leader_lost_over_udp_is_succeeded_within_5_s(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    keys = ["--set", "duration_s=12", "--set", "faults=[{at_s: 4, vehicles: [1], kind: crash}]"]
    keys += ["--set", "formation.shape=follower"]  # one vehicle is the nearest by more than a busy machine's jitter
    command = [*STATION, "run", str(path), *keys, "--out", str(out)]
    subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    events = events_of(out)
    begun_s = next(event["t_s"] for event in events if event["text"] == "flying")
    (leader,) = [event for event in events if event["kind"] == "leader"]
    assert leader["vehicle"] == "2"
    summary = json.loads((out / "summary.json").read_text())
    assert 4.0 < leader["t_s"] - begun_s < 9.0 + late_s(summary)
    assert summary["safety"]["min_separation_m"] > 15.0


def test_a_taken_port_ends_with_3_and_its_name(path: Path, tmp_path: Path) -> None:
    """It has commanded nobody: its record may be replaced, but doesn't replace an earlier run's."""
    endpoint, out = yaml.safe_load(path.read_text())["vehicles"]["endpoint"], tmp_path / "run"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as occupier:
        occupier.bind(("127.0.0.1", int(endpoint.rpartition(":")[2])))
        for _ in range(2):
            done = said("run", str(path), "--out", str(out))
            assert done.exit_code == 3
            assert done.stderr.strip().endswith("is taken by another program")
            assert endpoint in done.stderr
        (out / "events.jsonl").write_text("earlier")
        for command in ("run", "fly"):
            assert said(command, str(path), "--out", str(out), "--overwrite").exit_code == 3
            assert (out / "events.jsonl").read_text() == "earlier"


def test_no_vehicle_there_ends_with_3_and_which_was_missed(path: Path, tmp_path: Path) -> None:
    done = said("fly", str(path), "--speedup", "50", "--out", str(tmp_path / "run"))
    assert done.exit_code == 3
    assert "no vehicle 1, 2, 3 answered at udpin:127.0.0.1" in done.stderr


def test_an_expectation_window_beyond_until_is_not_judged_says_so_and_does_not_fail(path: Path, tmp_path: Path) -> None:
    expect = "expect=[{metric: error_x_m.max, from_s: 15, to_s: 20, below: 0.0}]"
    keys = ["--clock", "virtual", "--until", "5", "--set", expect, "--json"]
    done = said("run", str(path), *keys, "--out", str(tmp_path / "run"))
    assert done.exit_code == 0
    judged = [(entry["held"], entry["judged"]) for entry in json.loads(done.stdout)["expect"]]
    assert judged == [(None, False), (None, False)]
    assert done.stderr.count("not judged: flown to 5.0 s of 20 s") == 2


def test_an_expectation_window_that_the_path_s_end_cuts_short_is_broken(path: Path, tmp_path: Path) -> None:
    expect = "expect=[{metric: error_x_m.max, followers: [2], from_s: 2, below: 1}]"
    short = ["--set", "vehicles.count=2", "--set", "path.waypoints_m=[[0, 0, 100], [220, 0, 100]]"]
    keys = ["--clock", "virtual", *short, "--set", expect]
    done = said("run", str(path), *keys, "--quiet", "--out", str(tmp_path / "run"))
    assert done.exit_code == 1
    assert "broken: flown to 10." in done.stderr


def test_a_broken_expectation_ends_with_1_and_its_figure(path: Path, tmp_path: Path) -> None:
    expect = "expect=[{metric: min_separation_m, above: 100}]"
    keys = ["--clock", "virtual", "--set", expect, "--set", "duration_s=5", "--set", "vehicles.count=2"]
    done = said("run", str(path), *keys, "--out", str(tmp_path / "run"))
    assert done.exit_code == 1
    assert "min_separation_m from 0 s to 5 s: found 42.4" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "nowhere.yaml"],
        ["run", "nowhere.yaml"],
        ["report", "nowhere"],
        ["fly"],
        ["run", "x.yaml", "--until", "nan"],
        ["run", "x.yaml", "--speedup", "nan"],
        ["fly", "x.yaml", "--seed", str(2**63)],
        ["compare", "x.yaml", "--from", "inf"],
        ["stress", "--count", "1", "--out", "/proc/nowhere"],
        ["run", "x.yaml", "--out", ""],
        ["run", "configs/quickstart.yaml", "--clock", "virtual", "--speedup", "5"],
        ["run", "configs/quickstart.yaml", "--clock", "virtual", "--out", "configs", "--overwrite"],
        ["compare", "configs/quickstart.yaml", "--laws", "pid", "--out", "gcs_formation", "--overwrite"],
    ],
)
def test_bad_usage_ends_with_2_and_words(arguments: list[str]) -> None:
    done = said(*arguments)
    assert done.exit_code == 2
    assert done.stderr


def test_a_process_ends_with_the_status_of_its_command_and_no_traceback() -> None:
    done = subprocess.run([*STATION, "run", "nowhere.yaml"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "nowhere.yaml" in done.stderr
    assert "Traceback" not in done.stderr
