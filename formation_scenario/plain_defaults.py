"""Fills defaults into groups of keys as they are written, before they are typed; what will be refused stays."""

from __future__ import annotations

from collections.abc import Callable

from formation_scenario.fields import MAX_NUMBER
from formation_scenario.source import Key, Plain


def filled(value: Plain, defaults: dict[Key, Plain]) -> Plain:
    """Return a mapping with defaults for missing and null keys."""
    if value is None:
        return dict(defaults)
    if not isinstance(value, dict):
        return value
    return value | {name: default for name, default in defaults.items() if value.get(name) is None}


def usable(value: Plain, default: float) -> float:
    """Return a number from which a default is derived, or `default` if the number will be refused."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default
    return value if 0.0 <= value <= MAX_NUMBER else default


def each_changed(values: Plain, changed: Callable[[dict[Key, Plain]], Plain]) -> Plain:
    """Return a list with each of its mappings changed."""
    if not isinstance(values, list):
        return values
    return [changed(value) if isinstance(value, dict) else value for value in values]
