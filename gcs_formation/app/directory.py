"""The default run directory."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path


def default_directory(name: str) -> Path:
    """Return runs/NAME-TIME, with a number appended if that exists; slashes in NAME are replaced."""
    stem = f"{name.replace(os.sep, '-')}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    directory, number = Path("runs") / stem, 1
    while directory.exists():
        number += 1
        directory = Path("runs") / f"{stem}-{number}"
    return directory
