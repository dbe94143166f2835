"""Which features there are, without loading them: each is a folder, and what it brings are modules of known names.

A folder that is deleted takes its keys, rules, stages and figures with it; nothing else names it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Final

PACKAGE: Final = "gcs_formation.features"
"""Its subpackages are the features."""
SUMMARY: Final = "summary.json"
"""The file of a run directory, beside its scenario, that has the features which it was flown with."""


def feature_names() -> tuple[str, ...]:
    """Return the names of the features that are there, in their order: those of their folders."""
    return tuple(_modules())


@cache
def brought(module: str) -> tuple[ModuleType, ...]:
    """Return the modules of a name that features have, such as `plate`, which only a report needs.

    A feature without such a module isn't imported.
    """
    return tuple(import_module(f"{PACKAGE}.{name}.{module}") for name, has in _modules().items() if module in has)


def brought_texts(file: str) -> Iterator[str]:
    """Yield the texts of the files of a name that features have."""
    for name in feature_names():
        path = files(f"{PACKAGE}.{name}") / file
        if path.is_file():
            yield path.read_text(encoding="utf-8")


def absent_features(home: Path | None) -> list[str]:
    """Return the features that a run was flown with and that aren't here, if its summary.json is in a directory."""
    try:
        flown = json.loads((home / SUMMARY).read_text("utf-8"))["features"] if home is not None else ()
        return [str(each) for each in flown if each not in _modules()]
    except (OSError, ValueError, KeyError, TypeError):
        return []


@cache
def _modules() -> dict[str, frozenset[str]]:
    """Return the names of each feature's modules, compiled or not, by the feature's name."""
    package = find_spec(PACKAGE)
    found = dict[str, frozenset[str]]()
    for directory in [] if package is None else package.submodule_search_locations or ():
        for folder in Path(directory).iterdir():
            if folder.is_dir() and not folder.name.startswith("__"):
                names = frozenset(each.name.partition(".")[0] for each in folder.iterdir())
                found |= {folder.name: names} if "__init__" in names else {}
    return dict(sorted(found.items()))
