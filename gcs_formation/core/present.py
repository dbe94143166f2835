"""Which features there are, without loading them."""

from __future__ import annotations

from importlib.util import find_spec
from pkgutil import iter_modules
from typing import Final

PACKAGE: Final = "gcs_formation.features"
"""Its subpackages are the features."""


def feature_names() -> tuple[str, ...]:
    """Return the names of the features that are there, in their order: those of their folders."""
    package = find_spec(PACKAGE)
    places = [] if package is None else package.submodule_search_locations
    return tuple(sorted(each.name for each in iter_modules(places) if each.ispkg))
