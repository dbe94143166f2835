"""The vehicle files that are shipped, by their names."""

from __future__ import annotations

from importlib import resources

SUFFIXES = (".yaml", ".yml")
SHIPPED = "aircraft"
"""Folder of the shipped files, inside this package."""
SHIPPED_FILES = resources.files("formation_scenario") / SHIPPED


def shipped_names() -> list[str]:
    """Return the names of the shipped vehicle files."""
    files = [each.name for each in SHIPPED_FILES.iterdir()]
    return sorted(name.removesuffix(SUFFIXES[0]) for name in files if name.endswith(SUFFIXES[0]))
