"""Loads a scenario from a file or a mapping, with overrides of its keys, and writes it as YAML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from formation_scenario.derived_defaults import resolve, with_models
from formation_scenario.error_messages import problems_of
from formation_scenario.expectation import WINDOWED
from formation_scenario.feasibility import check
from formation_scenario.fields import Problem, ScenarioError, refused
from formation_scenario.gains import AUTO, designed
from formation_scenario.model import Scenario
from formation_scenario.rules import expectations, inconsistencies
from formation_scenario.source import (
    MOST_DIGITS,
    Dumper,
    Key,
    KeyPath,
    Place,
    Plain,
    Source,
    dotted,
    kind,
    plain_mapping,
    read_file,
    read_value,
    show,
)
from formation_scenario.vehicles import VehicleGroup

LONGEST = 10**6
OPTION = "--set "
"""Prefix of an override on a command line, and so in messages about it."""
ONE_VEHICLE: dict[Key, Plain] = {"id": 1, "role": "leader"}


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
    data, places = deepcopy(source.data), dict(source.places)
    problems: list[Problem] = []
    for override in overrides:
        try:
            made = _apply(data, override)
        except ScenarioError as error:
            problems.extend(replace(each, file=f"{option}{override}") for each in error.problems)
            continue
        path = made[-1]
        places = {known: place for known, place in places.items() if known[: len(path)] != path}
        places |= dict.fromkeys(made, Place(f"{option}{override}"))
    if problems:
        raise ScenarioError(problems)
    return Source(source.file, data, places)


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
    return int(text) if text.isdecimal() and len(text) <= MOST_DIGITS else text


def _items(parent: Plain, path: KeyPath) -> list[Plain]:
    """Return the list that a path's last key is an index of."""
    above, key = dotted(path[:-1]), path[-1]
    if not isinstance(parent, list):
        raise refused(above, f"found {kind(parent)}, which has no '{key}' in it", "a mapping or a list")
    if not isinstance(key, int) or key >= len(parent):
        allowed = f"0 to {len(parent) - 1}" if parent else "nothing, the list is empty"
        raise refused(above, f"found index '{key}'", allowed)
    return parent


def load_scenario(
    source: str | Path | Mapping[Any, Any] | Scenario,
    overrides: Sequence[str] = (),
    option: str = OPTION,
    *,
    flown: bool = False,
) -> Scenario:
    """Return a scenario, validated, with every default filled in.

    Args:
        source: a YAML file, the mapping that it would hold, or a scenario.
        overrides: `dotted.key=value` settings, the values in YAML.
        option: prefix of overrides in messages; "" if they aren't a command's options.
        flown: whether it has been flown already, so that feasibility and expectations aren't checked.

    Raises:
        ScenarioError: the scenario can't be read, has values that aren't allowed, contradicts itself or can't be flown.
    """
    read = with_models(apply_overrides(_read(source), overrides, option))
    scenario, resolved = _typed(read)
    found = inconsistencies(scenario)
    if scenario.law.gains == AUTO and not found:
        scenario = designed(scenario, read.data.get("law"))
    if not flown:
        found = [*(found or check(scenario)), *expectations(scenario)]
    if found:
        raise ScenarioError([resolved.problem(*each) for each in found])
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML; loading it gives an equal scenario."""
    return yaml.dump(
        _plain(scenario), Dumper=Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def _read(source: str | Path | Mapping[Any, Any] | Scenario) -> Source:
    if isinstance(source, Scenario):
        return Source(None, _plain(source))
    return Source(None, plain_mapping(source)) if isinstance(source, Mapping) else read_file(Path(source))


def _plain(scenario: Scenario) -> dict[Key, Plain]:
    dumped = scenario.model_dump(by_alias=True, exclude_none=True)
    for entry in dumped["expect"]:
        if entry["metric"] not in WINDOWED and entry["to_s"] == scenario.duration_s:
            del entry["to_s"]  # so that it follows duration_s when that is changed
    return plain_mapping(dumped)


def _typed(source: Source) -> tuple[Scenario, Source]:
    problems, group = list[Problem](), source.data.get("vehicles")
    try:
        if isinstance(group, dict):
            VehicleGroup.model_validate(group)
    except ValidationError as error:
        problems = problems_of(error, VehicleGroup, source, ("vehicles",))
        # Check the rest as well, with a valid list in place of the group.
        source = replace(source, data=source.data | {"vehicles": [dict(ONE_VEHICLE)]})
    resolved, scenario = resolve(source), None
    try:
        scenario = Scenario.model_validate(resolved.data)
    except ValidationError as error:
        problems += problems_of(error, Scenario, resolved)
    if problems or scenario is None:
        raise ScenarioError(list(dict.fromkeys(problems)))
    return scenario, resolved
