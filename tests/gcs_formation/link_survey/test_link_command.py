"""The command `gcs-formation link`: over real UDP, its exit statuses, and what it leaves behind."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from airlink.cli import Status
from gcs_formation.cli import main
from gcs_formation.link_survey.text import lines


def run(*arguments: str) -> tuple[int, str, str]:
    found = CliRunner().invoke(main, ["link", *arguments])
    return found.exit_code, found.stdout, found.stderr


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@contextmanager
def emulated(port: int) -> Iterator[None]:
    with subprocess.Popen(
        [sys.executable, "-m", "sim_vehicles", "--count", "1", "--base-port", str(port)], stdout=subprocess.PIPE
    ) as fleet:
        try:
            assert fleet.stdout is not None
            fleet.stdout.readline()
            yield
        finally:
            fleet.terminate()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "Missing argument"),
        (("pigeon:1",), "udpin:HOST:PORT"),
        (("udpin:127.0.0.1:1", "--minutes", "0"), "0.05"),
        (("udpin:127.0.0.1:1", "--probe-capacity", "nan"), "finite"),
    ],
)
def test_bad_usage_is_status_2_and_says_what_is_allowed(arguments: tuple[str, ...], said: str) -> None:
    status, _, error = run(*arguments)
    assert status == Status.BAD_USAGE
    assert said in error


def test_a_survey_of_before_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    status, _, error = run("udpin:127.0.0.1:1", "--out", str(tmp_path))
    assert status == Status.BAD_USAGE
    assert str(tmp_path) in error


def test_a_port_that_is_taken_is_status_3() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        status, _, error = run(f"udpin:127.0.0.1:{taken.getsockname()[1]}")
    assert status == Status.COULD_NOT_GO_ON
    assert "cannot listen" in error


@pytest.mark.slow
def test_none_there_is_status_3() -> None:
    status, _, error = run(f"udpin:127.0.0.1:{free_port()}", "--minutes", "0.05")
    assert status == Status.COULD_NOT_GO_ON
    assert "found no autopilot" in error


@pytest.mark.slow
def test_a_vehicle_over_udp_is_measured_and_its_trace_written(tmp_path: Path) -> None:
    port, out = free_port(), tmp_path / "survey"
    with emulated(port):
        status, text, _ = run(f"udpin:127.0.0.1:{port}", "--minutes", "0.15", "--out", str(out), "--json")
    assert status == Status.FINE
    found = json.loads(text)
    assert found == json.loads((out / "link.json").read_text(encoding="utf-8"))
    vehicle = found["vehicles"]["1"]
    assert vehicle["answers"] > 0.9 * vehicle["requests"] > 50
    assert vehicle["loss"]["down"] == 0.0
    assert (out / vehicle["trace"]).read_text(encoding="utf-8").startswith("t_s,rtt_ms,up_ms,down_ms\n0.0000,")
    assert found["meaning"]["flies"]
    assert found["meaning"]["vehicles"] == 4
    assert (out / "rehearsal.yaml").exists()
    assert any("spacing from" in line for line in lines(found))
