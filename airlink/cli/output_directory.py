"""The directory that a command writes into: its name by default, and when one may not be written into."""

from __future__ import annotations

import os
import sys
from datetime import datetime
from itertools import chain, count
from pathlib import Path

import click

RUN = "run.yaml"
"""The file that marks the directory of a run."""
LONGEST_NAME = 200
"""Most bytes of a scenario's name in its directory's name; file systems allow 255 in all."""


class Directory(click.Path):
    """A directory to write into; "" isn't one."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        """Return the path."""
        if not os.fspath(value):
            self.fail("found ''; allowed: a directory", param, ctx)
        return super().convert(value, param, ctx)


OUT = Directory()
"""Output directory of a command."""


def refusal(path: Path, *, overwrite: bool, mark: str = RUN) -> str | None:
    """Return why a command may not write into a directory, as a message; None if it may.

    Args:
        path: a directory, which need not exist.
        overwrite: whether the output of an earlier command there may be replaced.
        mark: the file that marks the output of such a command.

    Raises:
        OSError: the directory can't be read.
    """
    encoding = sys.getfilesystemencoding()
    if encoding == "utf-8" and not _is_encodable(str(path), encoding):
        return f"found {str(path)!a}; allowed: a name whose bytes are UTF-8"
    if not _is_encodable(str(path), encoding):
        return f"found {str(path)!a}; allowed: a name in {encoding}, in which file names are written here"
    if not path.is_dir() or next(path.iterdir(), None) is None:
        return None
    if not (path / mark).is_file():
        return f"found files in {path}, and no {mark} of an earlier run; allowed: a new directory, or an empty one"
    if overwrite:
        return None
    found = f"found an earlier run in {path}"
    return f"{found}; allowed: another directory, or --overwrite (in Python overwrite=True), which replaces that run"


def default_directory(name: str) -> Path:
    """Return runs/NAME-TIME, with a number appended if that exists; a long NAME is cut.

    Slashes in NAME are replaced, and so are characters that the file system's encoding lacks (`LC_ALL=C`).
    """
    encoding = sys.getfilesystemencoding()
    written = "".join(each if _is_encodable(each, encoding) else "_" for each in name.replace(os.sep, "-"))
    short = written.encode(encoding)[:LONGEST_NAME].decode(encoding, errors="ignore")
    stem = f"{short}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    paths = (Path("runs") / each for each in chain([stem], (f"{stem}-{number}" for number in count(2))))
    return next(path for path in paths if not path.exists())


def _is_encodable(text: str, encoding: str) -> bool:
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True
