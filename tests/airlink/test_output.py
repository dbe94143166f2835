"""Commands whose words nobody takes, and names that no file format holds."""

import os
import subprocess
from pathlib import Path

import pytest

from airlink.cli import Status, refusal
from tests.processes import STATION, VEHICLES

FULL = Path("/dev/full")
SCHEMA = [*STATION, "schema"]


def ended(command, output):
    return subprocess.run(command, stdout=output, stderr=subprocess.PIPE, text=True, check=False, timeout=60)


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize(
    "command", [SCHEMA, [*STATION, "--version"], [*VEHICLES, "fly", "--help"], [*VEHICLES, "--count", "1"]]
)
def test_a_full_disk_under_the_output_is_no_broken_expectation_and_no_traceback(command) -> None:
    with FULL.open("w") as full:
        done = ended(command, full)
    assert done.returncode == Status.COULD_NOT_GO_ON
    assert done.stderr == "[Errno 28] No space left on device\n" or "cannot go on: [Errno 28]" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_reader_that_has_gone_is_none_either() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as pipe:
        done = ended(SCHEMA, pipe)
    assert done.returncode == Status.COULD_NOT_GO_ON
    assert done.stderr == "cannot go on: [Errno 32] Broken pipe\n"


def test_a_name_that_isnt_utf_8_is_refused_before_anything_is_flown() -> None:
    assert refusal(Path(os.fsdecode(b"runs/\xff")), overwrite=True) == (
        "found 'runs/\\udcff'; allowed: a name whose bytes are UTF-8"
    )
