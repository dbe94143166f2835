"""Files that never end, or never begin, are refused; a pipe that somebody writes to is read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from formation_scenario import bounded_read
from formation_scenario.bounded_read import read_bounded


def test_a_file_is_read_up_to_its_longest_length(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x" * 1000)
    assert read_bounded(tmp_path / "file", 1000) == b"x" * 1000
    with pytest.raises(OSError, match=r"is longer than 0\.000999 MB"):
        read_bounded(tmp_path / "file", 999)


def test_a_device_is_refused() -> None:
    with pytest.raises(OSError, match="is a device"):
        read_bounded(Path("/dev/zero"), 1000)


def test_a_pipe_nobody_writes_to_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_read, "WAIT_MS", 10)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="nothing has come"):
        read_bounded(tmp_path / "pipe", 1000)


def test_a_pipe_that_is_written_to_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    writes = "import sys; open(sys.argv[1], 'w').write('key: ' + 'x' * 100_000)"
    with subprocess.Popen([sys.executable, "-c", writes, str(tmp_path / "pipe")]):
        assert read_bounded(tmp_path / "pipe", 1_000_000) == b"key: " + b"x" * 100_000
