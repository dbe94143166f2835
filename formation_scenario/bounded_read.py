"""Reads a file that somebody named, in bounded time and memory: a device, a pipe nobody writes to or a huge file ends.

Process substitution works: it is a pipe that somebody writes to.
"""

from __future__ import annotations

import os
import select
import stat
from pathlib import Path
from typing import Final

WAIT_MS: Final = 8000
"""How long to wait for a pipe's next bytes."""
CHUNK: Final = 1 << 16
MEGABYTE: Final = 1e6


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """Return a file's bytes.

    Raises:
        OSError: it can't be read, is a device, is longer than `most_bytes`, or is a pipe in which nothing comes.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        return _read(handle, most_bytes)
    finally:
        os.close(handle)


def _read(handle: int, most_bytes: int) -> bytes:
    mode = os.fstat(handle).st_mode
    if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        raise OSError(0, "is a device; allowed: a file, or a pipe that is written to")
    ready = select.poll()
    ready.register(handle, select.POLLIN)
    parts, size = list[bytes](), 0
    while size <= most_bytes:
        if not stat.S_ISREG(mode) and not ready.poll(WAIT_MS):
            raise OSError(0, f"is a pipe in which nothing has come for {WAIT_MS / 1000:.0f} s")
        part = os.read(handle, CHUNK)
        if not part:
            return b"".join(parts)
        parts.append(part)
        size += len(part)
    raise OSError(0, f"is longer than {most_bytes / MEGABYTE:g} MB, the most that is read")
