"""Which features there are, without loading them: each is a folder, and what it brings are modules of known names.

A folder that is deleted takes its keys, rules, stages and figures with it; nothing else names it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pkgutil import iter_modules
from types import ModuleType
from typing import Final

PACKAGE: Final = "gcs_formation.features"
"""Its subpackages are the features."""


def feature_names() -> tuple[str, ...]:
    """Return the names of the features that are there, in their order: those of their folders."""
    return tuple(sorted(each.name for each in iter_modules(_places()) if each.ispkg))


def brought(module: str) -> Iterator[ModuleType]:
    """Yield the modules of a name that features have, such as `plate`, which only a report needs.

    A feature without such a module isn't imported.
    """
    places = _places()
    for name in feature_names():
        if any(_has(f"{place}/{name}", module) for place in places):
            yield import_module(f"{PACKAGE}.{name}.{module}")


def brought_texts(file: str) -> Iterator[str]:
    """Yield the texts of the files of a name that features have."""
    for name in feature_names():
        place = files(f"{PACKAGE}.{name}") / file
        if place.is_file():
            yield place.read_text(encoding="utf-8")


def _places() -> list[str]:
    package = find_spec(PACKAGE)
    return [] if package is None else list(package.submodule_search_locations or ())


def _has(folder: str, module: str) -> bool:
    """Return whether a folder has a module, compiled or not."""
    return os.path.isdir(folder) and any(each.partition(".")[0] == module for each in os.listdir(folder))  # noqa: PTH112, PTH208
