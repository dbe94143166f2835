"""Reads a file that somebody named, in bounded time and memory: a device, a pipe no one writes to or a huge file ends.

Process substitution works: it is a pipe that somebody writes to.
"""

from __future__ import annotations

import errno
import math
import os
import select
import stat
import time
from pathlib import Path
from typing import Final

from formation_scenario.named_files import read_path

WAIT_S: Final = 8.0
"""How long to wait for what is written to a pipe, from its first byte to its end."""
CHUNK: Final = 1 << 16
MEGABYTE: Final = 1e6


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Return a file's bytes.

    Raises:
        OSError: it can't be read, is a device, is longer than `max_bytes`, or is a pipe in which nothing comes.
    """
    handle = os.open(read_path(path), os.O_RDONLY | os.O_NONBLOCK)
    try:
        return _read(handle, max_bytes)
    finally:
        os.close(handle)


def require_file(path: Path) -> None:
    """Refuse what isn't a regular file, for readers that open a path themselves, or seek in it.

    Raises:
        OSError: it doesn't exist, or is a directory, a device or a pipe.
    """
    mode = read_path(path).stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(0, "is a device or a pipe; allowed: a file")


def _read(handle: int, max_bytes: int) -> bytes:
    mode = os.fstat(handle).st_mode
    if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
        raise OSError(0, "is a device; allowed: a file, or a pipe that is written to")
    # The clock is read here, as files are read before a flight has one: a pipe may never end.
    ready = select.poll()
    ready.register(handle, select.POLLIN)
    parts, size, ends_s = list[bytes](), 0, time.monotonic() + WAIT_S
    while size <= max_bytes:
        if not stat.S_ISREG(mode) and not ready.poll(max(0, math.ceil(1e3 * (ends_s - time.monotonic())))):
            what = f"has given {size} bytes and no end" if size else "in which nothing has come"
            raise OSError(0, f"is a pipe {what} for {WAIT_S:.0f} s")
        part = os.read(handle, CHUNK)
        if not part:
            return b"".join(parts)
        parts.append(part)
        size += len(part)
    raise OSError(0, f"is longer than {max_bytes / MEGABYTE:g} MB, the most that is read")
