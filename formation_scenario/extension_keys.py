"""Checks what a scenario names of its extensions, and their keys, as every other key is checked."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from formation_scenario import extensions
from formation_scenario.error_messages import bare, is_group, problems_of
from formation_scenario.expectation import METRICS
from formation_scenario.extensions import LAW_KINDS, METRIC, SWITCHED, Registered, Registry
from formation_scenario.fields import Problem, did_you_mean
from formation_scenario.formation import LAW_TYPES
from formation_scenario.source import Key, KeyPath, Plain, Source, kind, plain_mapping, show

OWN_WORDS = ("value_error", "assertion_error")
"""pydantic's errors of a model's own validators, whose words say what is allowed."""


def with_extension_keys(source: Source, registry: Registry) -> tuple[Source, list[Problem]]:
    """Return the scenario with every default of its extensions' keys, and what is wrong with them.

    Values of a wrong type that pydantic reports itself are kept.
    """
    problems = list[Problem]()
    changed: dict[Key, Plain] = {}
    law = source.data.get("law")
    if isinstance(law, dict):
        changed["law"] = _law(law, source, registry, problems)
    given = source.data.get("extensions")
    if isinstance(given, dict):
        changed["extensions"] = {name: _keys_of(name, keys, source, registry, problems) for name, keys in given.items()}
    problems += _metrics(source, registry)
    return replace(source, data=source.data | changed), problems


def _law(law: dict[Key, Plain], source: Source, registry: Registry, problems: list[Problem]) -> Plain:
    """Return `law` with the defaults of its own parameters."""
    chosen, given = law.get("type", LAW_TYPES[0]), law.get("parameters")
    if not isinstance(chosen, str):
        return law
    entry = registry.get(chosen, *LAW_KINDS)
    if entry is not None:
        return law | {"parameters": _typed(entry, given, ("law", "parameters"), source, problems)}
    if chosen not in LAW_TYPES:
        known = [*LAW_TYPES, *registry.names(*LAW_KINDS)]
        near = did_you_mean(chosen, known) or f"; a law of one's own: {extensions.HOW}"
        allowed = f"{', '.join(known)}{near}{extensions.missing(chosen, _home(source))}"
        problems.append(source.problem(("law", "type"), f"found {show(chosen)}", allowed))
    elif given not in (None, {}):
        path = ("law", "parameters")
        problems.append(source.problem(path, f"found {kind(given)}", f"none: {chosen} has its keys beside law.type"))
    return {name: value for name, value in law.items() if name != "parameters" or value is not None}


def _keys_of(name: Key, given: Plain, source: Source, registry: Registry, problems: list[Problem]) -> Plain:
    entry = registry.get(str(name), *SWITCHED, METRIC)
    if entry is not None:
        return _typed(entry, given, ("extensions", name), source, problems)
    known = registry.names(*SWITCHED, METRIC)
    allowed = extensions.unknown(str(name), known) + extensions.missing(str(name), _home(source))
    problems.append(source.problem(("extensions", name), f"found an unknown extension '{name}'", allowed))
    return {}


def _metrics(source: Source, registry: Registry) -> Iterator[Problem]:
    """Yield expectations of figures that nobody knows."""
    known = [*METRICS, *registry.names(METRIC)]
    wanted = source.data.get("expect")
    for index, each in enumerate(wanted if isinstance(wanted, list) else []):
        metric = each.get("metric") if isinstance(each, dict) else None
        if isinstance(metric, str) and metric not in known:
            path = ("expect", index, "metric")
            allowed = f"{', '.join(known)}{did_you_mean(metric, known)}{extensions.missing(metric, _home(source))}"
            yield source.problem(path, f"found {show(metric)}", allowed)


def _home(source: Source) -> Path | None:
    return None if source.file is None else Path(source.file).parent


def _typed(entry: Registered, given: Plain, path: KeyPath, source: Source, problems: list[Problem]) -> Plain:
    """Return an extension's keys with its defaults, checked by its own model."""
    model: type[BaseModel] = entry.made.Keys
    given = {} if given is None else given
    if not isinstance(given, dict):
        problems.append(source.problem(path, f"found {kind(given)}", _mapping(model)))
        return {}
    found = list(_unknown(model, given, path, source))
    try:
        # As JSON, so that lists are tuples and words enumerations, but no text a number.
        keys = model.model_validate_json(json.dumps(given), strict=True)
    except ValidationError as error:
        problems += found + _wrong(error, model, path, source)
        return {}
    problems += found
    if not found:
        problems += _not_finite(keys.model_dump(), path, source)
    return plain_mapping(keys.model_dump(mode="json", by_alias=True))


def _mapping(model: type[BaseModel]) -> str:
    return f"a mapping with {', '.join(_names(model))}" if model.model_fields else "nothing: it has no keys"


def _names(model: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()]


def _unknown(model: type[BaseModel], given: Mapping[Key, Plain], path: KeyPath, source: Source) -> Iterator[Problem]:
    """Yield keys that a model doesn't have, which pydantic ignores unless told otherwise; also in its inner models."""
    if model.model_config.get("extra") in ("allow", "forbid"):
        return
    inner = {field.alias or name: bare(field)[0] for name, field in model.model_fields.items()}
    for name, value in given.items():
        if name not in inner:
            allowed = ", ".join(inner) + did_you_mean(str(name), list(inner)) if inner else "none: it has no keys"
            yield source.problem((*path, name), f"found an unknown key '{name}'", allowed)
        elif isinstance(value, dict) and is_group(group := inner[str(name)]):
            yield from _unknown(group, value, (*path, name), source)


def _wrong(error: ValidationError, model: type[BaseModel], path: KeyPath, source: Source) -> list[Problem]:
    """Return pydantic's findings; those of a model's own validators in their own words."""
    own = [each for each in error.errors() if each["type"] in OWN_WORDS]
    if not own:
        return problems_of(error, model, source, path)
    return [
        source.problem(
            (*path, *each["loc"]), f"found {show(_plain(each['input']))}", str(each["msg"]).partition(", ")[2]
        )
        for each in own
    ]


def _plain(value: Any) -> Plain:  # noqa: ANN401 - any value of any key
    return json.loads(json.dumps(value, default=str))


def _not_finite(keys: Mapping[str, Any], path: KeyPath, source: Source) -> Iterator[Problem]:
    """Yield numbers that are NaN or infinite."""
    for name, value in keys.items():
        if isinstance(value, float) and value - value != 0.0:
            yield source.problem((*path, name), f"found {value}", "a finite number")
