"""What differs between operating systems."""

import re
import socket
from pathlib import Path

import pytest

from airlink import host_system
from airlink.host_system import lock, recvmmsg, short_path

ROOT = Path(__file__).parents[2]
HOME = "airlink/host_system.py"
ELSEWHERE = re.compile(r"^\s*(import|from)\b.*\b(fcntl|msvcrt|winreg|termios|pty)\b", re.MULTILINE)


@pytest.mark.parametrize("linux", [True, False])
def test_a_socket_in_a_directory_with_a_long_name_is_reached_by_a_short_one(tmp_path, monkeypatch, linux):
    monkeypatch.setattr(host_system, "LINUX", linux)
    directory = tmp_path / ("long" * 40)
    directory.mkdir()
    with socket.socket(socket.AF_UNIX) as listening, socket.socket(socket.AF_UNIX) as calling:
        with short_path(directory) as short:
            listening.bind(str(short / "orders.sock"))
        listening.listen()
        with short_path(directory) as short:
            calling.connect(str(short / "orders.sock"))
    assert (directory / "orders.sock").exists()
    assert not short.exists(), "removed, or closed"


def test_a_file_is_locked_once(tmp_path):
    with (tmp_path / "a").open("w") as first:
        lock(first)
        second = (tmp_path / "a").open("w")
        with pytest.raises(BlockingIOError):
            lock(second)
        assert second.closed


def test_other_systems_receive_one_datagram_at_a_time(monkeypatch):
    monkeypatch.setattr(host_system, "LINUX", False)
    assert recvmmsg() is None


def test_what_one_operating_system_has_is_behind_one_module():
    """Only it imports what others lack, asks which system it is, or names Linux's /proc."""
    found = list[str]()
    for top in ("airlink", "flight_model", "formation_scenario", "sim_vehicles", "gcs_formation"):
        for file in (ROOT / top).rglob("*.py"):
            name, text = file.relative_to(ROOT).as_posix(), file.read_text(encoding="utf-8")
            if name != HOME and (ELSEWHERE.search(text) or "/proc/" in text or "sys.platform" in text):
                found.append(name)
    assert found == []
