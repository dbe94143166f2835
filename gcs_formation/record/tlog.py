"""The telemetry log, a .tlog file: every frame with the time at which it was written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from librt.strings import BytesWriter, read_i64_be, write_i64_be

from airlink.clock import Instant
from airlink.frame import HEADER_V2, frame_length
from airlink.signing.signature import SETUP_SIGNING, without_key
from formation_scenario.bounded_read import require_file

_STAMP_BYTES: Final = 8
"""Length of the stamp before each frame: microseconds since 1970, 64 bits, big-endian."""
SETS_KEY_AT: Final = 8
SETS_KEY: Final = SETUP_SIGNING >> 8
"""Where the second byte of a frame's message id is, and what it is in SETUP_SIGNING and few others."""


class TlogWriter:
    """Appends frames to a telemetry log."""

    def __init__(self, path: Path, epoch_us: int) -> None:
        """Create the file, or continue after its last whole frame; `epoch_us`: instant 0, microseconds since 1970."""
        self._file: BinaryIO = path.open("ab")
        self._file.truncate(sum(_STAMP_BYTES + len(raw) for _, raw in read_tlog(path)))
        self._epoch_us = epoch_us
        self._waiting = BytesWriter()
        self._is_closed = False

    def write(self, now: Instant, raws: list[bytes]) -> None:
        """Append frames to the buffer that `flush` writes."""
        waiting, stamp_us = self._waiting, self._epoch_us + now // 1000
        for raw in raws:
            write_i64_be(waiting, stamp_us)
            waiting.write(raw if len(raw) < HEADER_V2 or raw[SETS_KEY_AT] != SETS_KEY else without_key(raw))

    def flush(self) -> None:
        """Pass the buffer to the operating system, so that a crash of this process doesn't lose it."""
        data = self._waiting.getvalue()
        self._waiting.truncate(0)
        self._file.write(data)
        self._file.flush()

    def close(self) -> None:
        """Write the buffer and close the file, once."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self.flush()
        finally:
            self._file.close()


def read_tlog(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield a log's complete frames, each with the time of writing, microseconds since 1970."""
    require_file(path)
    data = path.read_bytes()
    begin = 0
    while begin + _STAMP_BYTES < len(data):
        frame = begin + _STAMP_BYTES
        end = frame + frame_length(data, frame)
        if end == frame or end > len(data):
            return
        yield read_i64_be(data, begin), data[frame:end]
        begin = end
