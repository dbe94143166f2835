"""Where the records of a study's flights are kept: in a directory here, or at a URL.

Another machine sends a flight's record here when it is over. To a URL of fsspec (filesystem-spec.readthedocs.io) the
machine that flies writes by itself.
"""

from __future__ import annotations

import shutil
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from formation_scenario.fields import refused
from gcs_formation.errors import RecordingError

Record: TypeAlias = Mapping[str, bytes]
"""The files of a flight's record, by their names below its directory."""
OPTION = "--records"


def is_url(location: str | None) -> bool:
    """Return whether a location is a URL, not a directory."""
    return location is not None and "://" in location


def require_url(location: str, kept: str) -> None:
    """Refuse a text that isn't a URL of a kind that fsspec knows, or one at which nothing would be `kept`.

    Raises:
        ScenarioError: what was found and what is allowed.
    """
    try:
        known: list[str] = import_module("fsspec").available_protocols()
    except ImportError as error:
        needed = "it needs fsspec: pip install 'gcs-formation[study]'"
        raise refused("", f"found '{location}'", f"none here, as {needed}", OPTION) from error
    protocol = location.partition("://")[0].partition("::")[0]
    if not is_url(location) or protocol not in known:
        allowed = "a URL that fsspec knows, such as s3://BUCKET/PATH, gs://BUCKET/PATH or file:///PATH"
        raise refused("", f"found '{location}'", allowed, OPTION)
    if kept == "none":
        raise refused(
            "", f"found '{location}', and a study with record: none", "record: full, series or summary", OPTION
        )


@contextmanager
def kept_at(location: str | None) -> Generator[Path | None]:
    """Give the directory in which a flight is recorded; None for nowhere. A URL's is uploaded when the flight is over.

    Raises:
        RecordingError: it can't be uploaded.
    """
    if location is None or not is_url(location):
        yield None if location is None else Path(location)
        return
    with TemporaryDirectory() as scratch:
        yield (directory := Path(scratch) / "record")
        _upload(packed(directory), location)


def _upload(record: Record, url: str) -> None:
    try:
        files, path = import_module("fsspec.core").url_to_fs(url)
        for name, content in record.items():
            target = f"{path.rstrip('/')}/{name}"
            files.makedirs(target.rpartition("/")[0], exist_ok=True)
            files.pipe_file(target, content)
    except Exception as error:  # each file system of fsspec, from outside, raises errors of its own
        raise RecordingError(f"cannot write {url}: {type(error).__name__}: {error}") from error


def packed(directory: Path) -> dict[str, bytes]:
    """Return the files of a record; none if there is no such directory."""
    files = sorted(each for each in directory.rglob("*") if each.is_file())
    return {each.relative_to(directory).as_posix(): each.read_bytes() for each in files}


def keep(record: Record, directory: Path) -> None:
    """Write a record that another machine sent; it is there as a whole or not at all. One that was there is replaced.

    Raises:
        RecordingError: it can't be written.
    """
    if not record:
        return
    fresh: Any = directory.with_name(f"{directory.name}.new")
    try:
        shutil.rmtree(fresh, ignore_errors=True)
        for name, content in record.items():
            file = fresh / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        shutil.rmtree(directory, ignore_errors=True)
        fresh.replace(directory)
    except OSError as error:
        raise RecordingError(f"cannot write {directory}: {error.strerror or error}") from error
