"""Checks what a scenario names of its extensions, and their keys, as every other key is checked."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from formation_scenario.error_messages import bare, is_group, problems_of
from formation_scenario.expectation import METRICS
from formation_scenario.extensions import (
    AUTOPILOT,
    DELAY_ESTIMATOR,
    DISTURBANCE,
    EMULATED_FAMILY,
    FAULT,
    GUIDANCE,
    LAW_KINDS,
    LINK,
    METRIC,
    NAVIGATION,
    PREDICTOR,
    SWITCHED,
    Registered,
)
from formation_scenario.fields import Problem, did_you_mean
from formation_scenario.law import LAW_TYPES, PREDICTORS
from formation_scenario.navigation import NAVIGATIONS
from formation_scenario.path_plan import GUIDANCES
from formation_scenario.registry import HOW, OURS, Registry, missing, unknown
from formation_scenario.shapes import SHAPE
from formation_scenario.source import Key, KeyPath, Plain, Source, dotted, kind, plain_mapping, show
from formation_scenario.surroundings import DISTURBANCES
from formation_scenario.vehicles import AUTOPILOTS, CLOCKS

OWN_WORDS = ("value_error", "assertion_error")
"""pydantic's errors of a model's own validators, whose words say what is allowed."""


class Named(NamedTuple):
    """A group of keys whose word may be an extension's name, with its own keys in `parameters` beside it."""

    path: KeyPath
    """Where it is; `EACH`: every entry of a list."""
    word: str
    kinds: tuple[str, ...]
    usual: str | None = None
    """What is meant where no word is given; None: nothing."""
    called: str = "a name"
    inherits: bool = False
    """Whether keys that aren't given are those of an earlier group, instead of the defaults."""


EACH = "*"
_DIRECTIONS: tuple[KeyPath, ...] = ((), ("uplink",), ("downlink",))
IN_ACTS = (
    *(Named(("link", *direction), "process", (LINK,)) for direction in _DIRECTIONS),
    Named(("fault",), "kind", (FAULT,)),
    Named(("disturbance",), "kind", (DISTURBANCE,), DISTURBANCES[0]),
)
"""What a program does to a flight."""
IN_SCENARIOS = (
    Named(("law",), "type", LAW_KINDS, LAW_TYPES[0], "a law"),
    Named(("law", "predictor"), "type", (PREDICTOR,), PREDICTORS[0], "a predictor"),
    Named(("path", "guidance"), "type", (GUIDANCE,), GUIDANCES[0], "a guidance"),
    Named(("telemetry",), "clock", (DELAY_ESTIMATOR,), CLOCKS[0], "an estimator"),
    Named(("vehicles", EACH), "autopilot", (AUTOPILOT,), AUTOPILOTS[0], "a family"),
    Named(("formation",), "shape", (SHAPE,), "diamond", "a shape"),
    Named(("formation", "changes", EACH), "shape", (SHAPE,), None, "a shape", inherits=True),
    *(
        Named((*group, *direction), "process", (LINK,))
        for group in (("links", "default"), ("links",), ("links", "changes", EACH))
        for direction in _DIRECTIONS
        if group != ("links",) or direction
    ),
    Named(("faults", EACH), "kind", (FAULT,)),
    Named(("disturbances", EACH), "kind", (DISTURBANCE,), DISTURBANCES[0]),
    *(
        Named(("vehicles", EACH, name), "source", (NAVIGATION,), NAVIGATIONS[0])
        for name in ("navigation", "true_navigation")
    ),
    Named(("vehicles", EACH, "emulator"), "family", (EMULATED_FAMILY,)),
    *(each._replace(path=("orders", EACH, *each.path)) for each in IN_ACTS),
)


def with_extension_keys(source: Source, registry: Registry) -> tuple[Source, list[Problem]]:
    """Return the scenario with every default of its extensions' keys, and what is wrong with them.

    Values of a wrong type that pydantic reports itself are kept.
    """
    source, problems = with_parameters(source, registry, IN_SCENARIOS)
    given = source.data.get("extensions")
    changed: dict[Key, Plain] = {}
    if isinstance(given, dict):
        changed["extensions"] = {name: _keys_of(name, keys, source, registry, problems) for name, keys in given.items()}
    problems += _metrics(source, registry)
    return replace(source, data=source.data | changed), problems


def with_parameters(source: Source, registry: Registry, named: Iterable[Named]) -> tuple[Source, list[Problem]]:
    """Return keys with every default of the `parameters` in some groups, and what is wrong with names and keys."""
    data: Plain = source.data
    problems = list[Problem]()
    for each in named:
        data = _inside(data, (), each.path, partial(_with_own, each, source, registry, problems))
    return replace(source, data=plain_mapping(data) if isinstance(data, dict) else source.data), problems


def _inside(value: Plain, at: KeyPath, path: KeyPath, changed: Callable[[dict[Key, Plain], KeyPath], Plain]) -> Plain:
    """Return a value with the groups at a path in it changed; the function gets each with its key path."""
    if not path:
        return changed(value, at) if isinstance(value, dict) else value
    step, rest = path[0], path[1:]
    if step == EACH and isinstance(value, list):
        return [_inside(one, (*at, index), rest, changed) for index, one in enumerate(value)]
    if step == EACH or not isinstance(value, dict) or step not in value:
        return value
    return value | {step: _inside(value[step], (*at, step), rest, changed)}


def _with_own(
    named: Named, source: Source, registry: Registry, problems: list[Problem], group: dict[Key, Plain], path: KeyPath
) -> Plain:
    """Return a group with the defaults of its own parameters."""
    chosen, given = group.get(named.word), group.get("parameters")
    chosen = named.usual if chosen is None else chosen
    if chosen is not None and not isinstance(chosen, str):
        return group
    entry, ours = registry.get(chosen, *named.kinds), OURS[named.kinds[0]]
    if entry is not None and given is None and named.inherits:
        return group
    if entry is not None:
        return group | {"parameters": own_keys(entry, given, (*path, "parameters"), source, problems)}
    if chosen is not None and chosen not in ours:
        known = [*ours, *registry.names(*named.kinds)]
        near = did_you_mean(chosen, known) or f"; {named.called} of one's own: {HOW}"
        allowed = f"{', '.join(known)}{near}{missing(chosen, source.home)}"
        problems.append(source.problem((*path, named.word), f"found {show(chosen)}", allowed))
    elif given not in (None, {}):
        why = f"{chosen} has its keys beside {dotted((*path, named.word))}" if chosen else f"beside {named.word} alone"
        problems.append(source.problem((*path, "parameters"), f"found {kind(given)}", f"none: {why}"))
    return {name: value for name, value in group.items() if name != "parameters" or value is not None}


def _keys_of(name: Key, given: Plain, source: Source, registry: Registry, problems: list[Problem]) -> Plain:
    entry = registry.get(str(name), *SWITCHED, METRIC)
    if entry is not None:
        return own_keys(entry, given, ("extensions", name), source, problems)
    known = registry.names(*SWITCHED, METRIC)
    allowed = unknown(str(name), known) + missing(str(name), source.home)
    problems.append(source.problem(("extensions", name), f"found an unknown extension '{name}'", allowed))
    return {}


def _metrics(source: Source, registry: Registry) -> Iterator[Problem]:
    """Yield expectations of unknown figures."""
    known = [*METRICS, *registry.names(METRIC)]
    wanted = source.data.get("expect")
    for index, each in enumerate(wanted if isinstance(wanted, list) else []):
        metric = each.get("metric") if isinstance(each, dict) else None
        if isinstance(metric, str) and metric not in known:
            path = ("expect", index, "metric")
            allowed = f"{', '.join(known)}{did_you_mean(metric, known)}{missing(metric, source.home)}"
            yield source.problem(path, f"found {show(metric)}", allowed)


def own_keys(entry: Registered, given: Plain, path: KeyPath, source: Source, problems: list[Problem]) -> Plain:
    """Return an extension's keys with its defaults, checked by its own model."""
    model = entry.keys_model
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
    """Yield keys that a model doesn't have, which pydantic ignores by default; also in its inner models."""
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
