"""Which features there are, without loading them."""

from __future__ import annotations

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
    package = find_spec(PACKAGE)
    places = [] if package is None else package.submodule_search_locations
    return tuple(sorted(each.name for each in iter_modules(places) if each.ispkg))


def brought(module: str) -> Iterator[ModuleType]:
    """Yield the modules of a name that features have, such as `plate`, which only a report needs, or `foretold`."""
    for name in feature_names():
        if find_spec(f"{PACKAGE}.{name}.{module}") is not None:
            yield import_module(f"{PACKAGE}.{name}.{module}")


def brought_texts(file: str) -> Iterator[str]:
    """Yield the texts of the files of a name that features have."""
    for name in feature_names():
        place = files(f"{PACKAGE}.{name}") / file
        if place.is_file():
            yield place.read_text(encoding="utf-8")
