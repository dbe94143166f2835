"""Telemetry logs as MAVProxy and Mission Planner write them: microseconds since 1970, big-endian, before each frame."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from airlink.clock import Instant
from airlink.frame import frame_length

_STAMP = struct.Struct(">Q")


class LoggedFrame(NamedTuple):
    """A frame of a log and when it was written, microseconds since 1970."""

    time_us: int
    raw: bytes


class TlogWriter:
    """Appends frames to a file."""

    def __init__(self, path: Path, epoch_us: int) -> None:
        """Create the file, or go on after its last whole frame; `epoch_us`: instant 0, microseconds since 1970."""
        self._file: BinaryIO = path.open("ab")
        self._file.truncate(sum(_STAMP.size + len(frame.raw) for frame in read_tlog(path)))
        self._epoch_us = epoch_us

    def write(self, now: Instant, raw: bytes) -> None:
        """Append a frame."""
        self._file.write(_STAMP.pack(self._epoch_us + now // 1000) + raw)

    def flush(self) -> None:
        """Flush to the operating system, so that a crash of this process loses nothing."""
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_tlog(path: Path) -> Iterator[LoggedFrame]:
    """Yield a log's frames up to its end, or to where it was cut off."""
    data = path.read_bytes()
    begin = 0
    while begin + _STAMP.size < len(data):
        frame = begin + _STAMP.size
        end = frame + frame_length(data, frame)
        if end == frame or end > len(data):
            return
        yield LoggedFrame(_STAMP.unpack_from(data, begin)[0], data[frame:end])
        begin = end
