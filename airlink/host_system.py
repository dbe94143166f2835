"""What isn't the same on every operating system, and nowhere else: the rest needs POSIX, or nothing.

Linux has a system call for many datagrams, and names for what is open; other systems do without, or by a link. Locks
are those of POSIX. Where a system has none of these (Windows), the package doesn't run.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, Final

LINUX: Final = sys.platform == "linux"
STATUS_OF_PROCESS: Final = "/proc/{}/stat" if LINUX else ""
"""File with the state of a process of a number; empty where there is none."""


def recvmmsg() -> Any:  # noqa: ANN401 - a function of the C library
    """Return the system call that receives many datagrams, where its structures are known, else None."""
    if not LINUX or sys.maxsize <= 2**32 or sys.byteorder != "little":
        return None
    return getattr(ctypes.CDLL(None, use_errno=True), "recvmmsg", None)


def lock(file: IO[Any]) -> None:
    """Lock a file while it's open.

    Raises:
        BlockingIOError: another process has it locked; the file is closed.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise
    except OSError:
        pass  # the file system has no locks


def is_locked(path: Path) -> bool:
    """Return whether another process has a file locked; False for none, or where the file system has no locks."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


@contextmanager
def short_path(directory: Path) -> Generator[Path]:
    """Yield a short path of a directory: the path of a Unix socket in it may have a hundred bytes at most.

    Raises:
        OSError: it isn't there, or can't be opened.
    """
    if not LINUX:
        with TemporaryDirectory(prefix="gcs-") as temporary:
            link = Path(temporary) / "d"
            link.symlink_to(directory.absolute(), target_is_directory=True)
            yield link
        return
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield Path(f"/proc/self/fd/{handle}")
    finally:
        os.close(handle)
