"""Files that never end, or never begin, are refused; a pipe that somebody writes to is read."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from formation_scenario import bounded_read
from formation_scenario.bounded_read import read_bounded, require_file


def test_a_file_is_read_up_to_its_longest_length(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x" * 1000)
    assert read_bounded(tmp_path / "file", 1000) == b"x" * 1000
    with pytest.raises(OSError, match=r"is longer than 0\.000999 MB"):
        read_bounded(tmp_path / "file", 999)


def test_a_device_is_refused() -> None:
    with pytest.raises(OSError, match="is a device"):
        read_bounded(Path("/dev/zero"), 1000)


def test_a_pipe_none_writes_to_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_read, "WAIT_S", 0.01)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="nothing has come"):
        read_bounded(tmp_path / "pipe", 1000)


def test_a_pipe_that_is_written_to_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    writes = "import sys; open(sys.argv[1], 'w').write('key: ' + 'x' * 100_000)"
    with subprocess.Popen([sys.executable, "-c", writes, str(tmp_path / "pipe")]):
        assert read_bounded(tmp_path / "pipe", 1_000_000) == b"key: " + b"x" * 100_000


def test_a_pipe_that_trickles_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.mkfifo(tmp_path / "pipe")
    handle = os.open(tmp_path / "pipe", os.O_RDWR)
    read, passed_s, bytes_to_come = os.read, itertools.count(0.0, 0.25), iter(b"x" * 31)

    def trickle(opened: int, most: int) -> bytes:
        part = read(opened, most)
        os.write(handle, bytes(itertools.islice(bytes_to_come, 1)))
        return part

    os.write(handle, b"x")
    monkeypatch.setattr(time, "monotonic", lambda: next(passed_s))
    monkeypatch.setattr(os, "read", trickle)
    with pytest.raises(OSError, match="bytes and no end for 8 s"):
        read_bounded(tmp_path / "pipe", 1000)
    os.close(handle)


def test_process_substitution_is_read(tmp_path: Path) -> None:
    reads = "import sys; from pathlib import Path; from formation_scenario.bounded_read import read_bounded\n"
    reads += "print(read_bounded(Path(sys.argv[1]), 9))"
    (tmp_path / "reads.py").write_text(reads)
    said = subprocess.run(
        ["bash", "-c", f"{sys.executable} {tmp_path}/reads.py <(echo key: 1)"],
        check=False,
        capture_output=True,
        text=True,
    )
    assert said.stdout == "b'key: 1\\n'\n", said.stderr


@pytest.mark.parametrize("kind", ["device", "pipe", "directory"])
def test_records_are_regular_files(kind: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="directory" if kind == "directory" else "is a device or a pipe"):
        require_file({"device": Path("/dev/zero"), "pipe": tmp_path / "pipe", "directory": tmp_path}[kind])
