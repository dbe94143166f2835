"""Commands whose output can't be written, and names that can't be encoded."""

import os
import subprocess
from pathlib import Path

import pytest

from airlink.cli import Status
from airlink.cli.output_directory import refusal
from tests.processes import STATION, VEHICLES

FULL = Path("/dev/full")
SCHEMA = [*STATION, "schema"]


def ended(command, output):
    return subprocess.run(command, stdout=output, stderr=subprocess.PIPE, text=True, check=False, timeout=60)


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "command",
    [
        SCHEMA,
        [*STATION, "--version"],
        pytest.param([*VEHICLES, "fly", "--help"], marks=pytest.mark.slow),
        [*VEHICLES, "--count", "1"],
    ],
)
def test_a_full_disk_under_the_output_is_no_broken_expectation_and_no_traceback(command) -> None:
    with FULL.open("w") as full:
        done = ended(command, full)
    assert done.returncode == Status.COULD_NOT_GO_ON
    words = "cannot go on: standard output can't be written: No space left on device\n"
    assert done.stderr in {words, "[Errno 28] No space left on device\n"}  # the emulators' own
    assert "Traceback" not in done.stderr


def test_a_closed_pipe_is_no_broken_expectation_and_no_traceback() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        done = ended(SCHEMA, pipe)
    assert done.returncode == Status.COULD_NOT_GO_ON
    assert done.stderr == "cannot go on: standard output can't be written: Broken pipe\n"


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "words",
    [*(pytest.param(each, marks=pytest.mark.slow) for each in (["run", "nonexist.yaml"], ["runn"])), ["run", "--x"]],
)
def test_bad_usage_is_bad_usage_where_no_one_reads(words) -> None:
    with FULL.open("w") as full:
        done = subprocess.run([*STATION, *words], stderr=full, check=False, timeout=60)
    assert done.returncode == Status.BAD_USAGE


@pytest.mark.slow
def test_words_that_a_terminal_has_no_letters_for_are_written_all_the_same(tmp_path) -> None:
    """The dash in a table isn't in Latin-1."""
    path = tmp_path / "short.yaml"
    path.write_text("{name: dash –, vehicles: {count: 2}, path: {waypoints_m: [[0, 0, 100], [500, 0, 100]]}}", "utf-8")
    latin = os.environ | {"PYTHONIOENCODING": "latin-1"}
    done = subprocess.run([*STATION, "check", str(path)], env=latin, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (Status.FINE, b"")
    assert b"dash \\u2013" in done.stdout


@pytest.mark.parametrize(
    ("below_m", "status"),
    [(1e-5, Status.EXPECTATION_BROKEN), pytest.param(1e3, Status.FINE, marks=pytest.mark.slow)],
)
def test_a_finished_flight_keeps_its_status_where_no_one_reads_its_output(tmp_path, below_m, status) -> None:
    path = tmp_path / "short.yaml"
    path.write_text(
        "{schema: 1, name: short, duration_s: 2, start: {in_air: true, run_in_s: 5}, vehicles: {count: 2},"
        " path: {speed_mps: 22, waypoints_m: [[0, 0, 100], [500, 0, 100]]},"
        f" expect: [{{metric: error_x_m.max, below: {below_m}}}]}}"
    )
    reading, writing = os.pipe()
    os.close(reading)
    command = [*STATION, "run", str(path), "--clock", "virtual", "--out", str(tmp_path / "run")]
    with os.fdopen(writing, "w") as pipe:
        assert subprocess.run(command, stdout=pipe, stderr=pipe, check=False, timeout=60).returncode == status


def test_vehicles_fly_on_where_no_one_reads_their_greeting() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        done = ended([*VEHICLES, "--count", "1", "--until", "0.1"], pipe)
    assert (done.returncode, done.stderr) == (Status.FINE, "")


def test_a_name_that_isnt_utf_8_is_refused_before_anything_is_flown() -> None:
    assert refusal(Path(os.fsdecode(b"runs/\xff")), overwrite=True) == (
        "found 'runs/\\udcff'; allowed: a name whose bytes are UTF-8"
    )
