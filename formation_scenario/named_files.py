"""The files that keys name: where each is read, and which were read.

A study's flights may be flown on machines that share no disk with its author's. Their copies of the files lie below a
directory of their own there. A key keeps the name that its author wrote, so that records and messages are the same
wherever a flight is flown. What is in force belongs to the block that set it, in its own thread: nothing is global.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Final

_COPIES: Final[ContextVar[Path | None]] = ContextVar("copies", default=None)
_READ: Final[ContextVar[set[Path] | None]] = ContextVar("read", default=None)


@contextmanager
def copies_below(root: Path) -> Generator[None]:
    """Read within, for every named file that has a copy below `root`, that copy instead."""
    token = _COPIES.set(root)
    try:
        yield
    finally:
        _COPIES.reset(token)


@contextmanager
def files_read() -> Generator[set[Path]]:
    """Give the files that are read within, as absolute paths; those that can't be read are among them."""
    found = set[Path]()
    token = _READ.set(found)
    try:
        yield found
    finally:
        _READ.reset(token)


def read_path(path: Path) -> Path:
    """Return where a named file is read: at its copy if there is one, else at its own path."""
    whole = Path(os.path.normpath(path.absolute()))
    if (found := _READ.get()) is not None:
        found.add(whole)
    root = _COPIES.get()
    copy = root / below(whole) if root is not None else None
    return copy if copy is not None and copy.exists() else path


def below(path: Path) -> Path:
    """Return an absolute path as one that is relative to the root of its copies."""
    return path.relative_to(path.anchor)
