"""Where commands write to."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path

RUN = "run.yaml"
"""The file that makes a directory that of a run."""


def refusal(path: Path, *, overwrite: bool, mark: str = RUN) -> str | None:
    """Return why a command may not write into a directory, in words; None if it may.

    Args:
        path: a directory, which need not exist.
        overwrite: whether what an earlier command wrote there may be replaced.
        mark: the file by which a directory of such a command is known.

    Raises:
        OSError: the directory can't be read.
    """
    if any("\ud800" <= each <= "\udfff" for each in str(path)):
        return f"found {str(path)!a}; allowed: a name whose bytes are UTF-8"
    if not path.is_dir() or next(path.iterdir(), None) is None:
        return None
    if not (path / mark).is_file():
        return f"found files in {path}, and no {mark} of an earlier run; allowed: a new directory, or an empty one"
    if overwrite:
        return None
    found = f"found an earlier run in {path}"
    return f"{found}; allowed: another directory, or --overwrite (in Python overwrite=True), which replaces that run"


def default_directory(name: str) -> Path:
    """Return runs/NAME-TIME, with a number appended if that exists; slashes in NAME are replaced."""
    stem = f"{name.replace(os.sep, '-')}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    directory, number = Path("runs") / stem, 1
    while directory.exists():
        number += 1
        directory = Path("runs") / f"{stem}-{number}"
    return directory
