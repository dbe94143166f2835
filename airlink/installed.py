"""Which version is installed, and of which commit where that is known: 0.1.0, or 0.1.0+g68a8b540 from a clone.

A wheel that is built in a clone has its commit in a file; an editable installation, or a tree that is run in place,
reads it from the clone each time, since that moves on. A release from elsewhere has none.
"""

from __future__ import annotations

import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

PACKAGE: Final = "gcs-formation"
PROJECT: Final = "pyproject.toml"
COMMIT: Final = "COMMIT"
"""The file in which a wheel has its commit, beside this module."""
LETTERS: Final = 8
"""Of a commit's name, as `git log --abbrev=8` says it."""
HERE: Final = Path(__file__).parent


def installed_version(here: Path = HERE) -> str:
    """Return the version, with `+g` and the commit if it is known (a local version of PEP 440)."""
    try:
        number = version(PACKAGE)
    except PackageNotFoundError:  # a tree that is run in place
        number = written_version(here.parent / PROJECT)
    commit = commit_of(here)
    return f"{number}+g{commit}" if commit else number


def written_version(project: Path) -> str:
    """Return the version in a tree's pyproject.toml; 0 if there is none."""
    try:
        found = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["version"]
    except (OSError, ValueError, KeyError):
        return "0"
    return str(found)


def commit_of(here: Path) -> str:
    """Return the short name of the commit that a package in the directory `here` is of; "" if that isn't known."""
    if (here / COMMIT).is_file():
        return (here / COMMIT).read_text(encoding="ascii", errors="replace").strip()
    root = here.parent
    if not (root / ".git").exists() or not (root / PROJECT).is_file():
        return ""
    try:
        return head_of(root / ".git")[:LETTERS]
    except (OSError, ValueError):
        return ""


def head_of(git: Path) -> str:
    """Return the name of the commit that a clone is at (gitrepository-layout(5)); "" before the first.

    Raises:
        OSError: a file can't be read.
        ValueError: one isn't text.
    """
    if git.is_file():  # of a worktree or a submodule: it says where the directory is
        git = git.parent / git.read_text("utf-8").removeprefix("gitdir:").strip()
    head = (git / "HEAD").read_text("utf-8").strip()
    if not head.startswith("ref:"):
        return head
    name = head.removeprefix("ref:").strip()
    shared = git / (git / "commondir").read_text("utf-8").strip() if (git / "commondir").is_file() else git
    for directory in (git, shared):
        if (directory / name).is_file():
            return (directory / name).read_text("utf-8").strip()
    packed = shared / "packed-refs"
    lines = packed.read_text("utf-8").splitlines() if packed.is_file() else []
    return next((line.split()[0] for line in lines if line.endswith(f" {name}")), "")
