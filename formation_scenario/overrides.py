"""Overrides of a scenario's keys, `dotted.key=value`, as `--set` takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace

from formation_scenario.fields import Problem, ScenarioError, refused
from formation_scenario.source import (
    MAX_DIGITS,
    FilePosition,
    Key,
    KeyPath,
    Plain,
    Source,
    dotted,
    kind,
    plain_mapping,
    read_value,
    show,
)

LONGEST = 10**6
OPTION = "--set "
"""Prefix of an override on a command line, and so in messages about it."""


def settings(keys: Mapping[str, object]) -> tuple[str, ...]:
    """Return Python arguments as overrides; `__` in a name stands for a dot: `law__rate_hz=5`.

    Raises:
        ScenarioError: a value is neither number, text, list nor mapping.
    """
    named = plain_mapping({name.replace("__", "."): value for name, value in keys.items()})
    return tuple(f"{name}={show(value, LONGEST)}" for name, value in named.items())


def apply_overrides(source: Source, overrides: Sequence[str], option: str = OPTION) -> Source:
    """Return the scenario with all overrides applied, in order.

    Values are YAML (`links.default={delay_ms: 300}`), list items are named by their index from 0
    (`vehicles.1.model.tau_v_s=5`), and missing mappings along the key's path are created. Messages name an override
    with `option` before it.

    Raises:
        ScenarioError: an override lacks `=`, has broken YAML, or names an item that doesn't exist.
    """
    data, positions = deepcopy(source.data), dict(source.positions)
    problems: list[Problem] = []
    for override in overrides:
        try:
            made = _apply(data, override)
        except ScenarioError as error:
            problems.extend(replace(each, file=f"{option}{override}") for each in error.problems)
            continue
        path = made[-1]
        positions = {known: position for known, position in positions.items() if known[: len(path)] != path}
        positions |= dict.fromkeys(made, FilePosition(f"{option}{override}"))
    if problems:
        raise ScenarioError(problems)
    return Source(source.file, data, positions)


def _apply(data: dict[Key, Plain], override: str) -> list[KeyPath]:
    """Set a value; return the key paths of the mappings that this created, and its own as the last."""
    name, equals, text = override.partition("=")
    path: KeyPath = tuple(_key(key) for key in name.strip().split("."))
    if not equals or "" in path:
        raise refused("", f"found '{override}'", "dotted.key=value")
    value = read_value(text, path)
    parent: Plain = data
    made: list[KeyPath] = []
    for depth, key in enumerate(path[:-1]):
        if isinstance(parent, dict) and parent.get(key) is None:
            made.append(path[: depth + 1])
            parent[key] = {}
        parent = parent[key] if isinstance(parent, dict) else _items(parent, path[: depth + 1])[int(key)]
    if isinstance(parent, dict):
        parent[path[-1]] = value
    else:
        _items(parent, path)[int(path[-1])] = value
    return [*made, path]


def _key(text: str) -> Key:
    return int(text) if text.isdecimal() and len(text) <= MAX_DIGITS else text


def _items(parent: Plain, path: KeyPath) -> list[Plain]:
    """Return the list that a path's last key is an index of."""
    above, key = dotted(path[:-1]), path[-1]
    if not isinstance(parent, list):
        raise refused(above, f"found {kind(parent)}, which has no '{key}' in it", "a mapping or a list")
    if not isinstance(key, int) or key >= len(parent):
        allowed = f"0 to {len(parent) - 1}" if parent else "nothing, the list is empty"
        raise refused(above, f"found index '{key}'", allowed)
    return parent
