"""Telemetry logs as MAVProxy and Mission Planner write them: microseconds since 1970, big-endian, before each frame."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from airlink.clock import Instant

_stamp = struct.Struct(">Q").pack


class TlogWriter:
    """Appends frames to a file."""

    def __init__(self, path: Path, epoch_us: int) -> None:
        """Create the file; `epoch_us` is instant 0 in microseconds since 1970."""
        self._file: BinaryIO = path.open("wb")
        self._epoch_us = epoch_us

    def write(self, now: Instant, raw: bytes) -> None:
        """Append a frame."""
        self._file.write(_stamp(self._epoch_us + now // 1000) + raw)

    def flush(self) -> None:
        """Hand what was written to the system, so that it survives us."""
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
