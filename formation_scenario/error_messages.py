"""Translates pydantic's errors into problems in the user's terms: what was found, and what is allowed."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, NamedTuple, TypeGuard, Union, get_args, get_origin

from annotated_types import MaxLen
from pydantic import BaseModel, Tag, ValidationError
from pydantic.fields import FieldInfo

from formation_scenario.feature_folders import absent_features
from formation_scenario.fields import CHOICE, EXTENSION, Allowed, Problem, did_you_mean
from formation_scenario.source import Key, KeyPath, Plain, Source, dotted, kind, show

MAPPING_KEY = "[key]"
UNKNOWN_KEY = ("extra_forbidden", "invalid_key")
"""pydantic's errors for a key that a group doesn't have: a word, a number."""


class _Expected(NamedTuple):
    """The part of an error's location that the types can follow, and the type there with its constraints."""

    path: KeyPath
    rest: KeyPath
    """The rest of the location."""
    type: object
    constraints: tuple[object, ...]


def problems_of(error: ValidationError, model: type[BaseModel], source: Source, above: KeyPath = ()) -> list[Problem]:
    """Return one problem for each wrong value that pydantic found in a model read from `above`."""
    found = [(details["type"], details["loc"]) for details in error.errors()]
    # pydantic calls a list too short if some of its items are invalid; those have problems of their own.
    around = {loc[:length] for _, loc in found for length in range(len(loc))}
    kept = [each for each in found if each[0] != "too_short" or each[1] not in around]
    return list(dict.fromkeys(_problem(*each, model, source, above) for each in kept))


def _problem(error: str, loc: tuple[Key, ...], model: type[BaseModel], source: Source, above: KeyPath) -> Problem:
    if error in UNKNOWN_KEY:
        parent = _expected(model, loc[:-1])
        keys = _keys(parent.type) if is_group(parent.type) else []
        near = did_you_mean(str(loc[-1]), keys) or _deeper(parent.type, loc[-1], (*above, *parent.path))
        path = (*above, *parent.path, loc[-1])
        absent = absent_features(source.home)
        flown = f"; it was flown with features that aren't here: {', '.join(absent)}" if absent else ""
        return source.problem(path, f"found an unknown key '{loc[-1]}'", ", ".join(keys) + near + flown)
    if MAPPING_KEY in loc:
        loc = loc[: loc.index(MAPPING_KEY)]
        allowed = describe(*bare(get_args(_expected(model, loc[:-1]).type)[0]))
        return source.problem((*above, *loc), f"found key {show(loc[-1])}", allowed)
    expected = _expected(model, loc)
    path = (*above, *expected.path)
    if error.startswith(CHOICE):
        path, words = (
            (*path, error.removeprefix(CHOICE)),
            [str(word) for word in members(expected.type) if word != EXTENSION],
        )
        word = _value_at(source.data, path)
        near = did_you_mean(word, words) if isinstance(word, str) else ""
        return source.problem(path, f"found {show(word)}", ", ".join(words) + near)
    allowed = describe(expected.type, expected.constraints)
    if error == "missing" and not expected.rest:
        return source.problem(path, "not found", allowed)
    value = _value_at(source.data, path)
    longest = next((item.max_length for item in expected.constraints if isinstance(item, MaxLen)), None)
    if error == "too_long" and isinstance(value, list) and longest is not None:
        return source.problem(path, f"found {len(value)} entries", f"up to {longest}")
    found = f"found {kind(value) if is_group(expected.type) else show(value)}"
    named = [choice for item in expected.constraints if isinstance(item, Allowed) for choice in item.choices]
    choices = named or [str(each) for each in get_args(expected.type) if get_origin(expected.type) is Literal]
    near = did_you_mean(value, choices) if isinstance(value, str) else ""
    return Problem(*source.position((*path, *expected.rest)), dotted(path), found, allowed + near)


def _keys(model: type[BaseModel]) -> list[str]:
    return [field.alias or name for name, field in model.model_fields.items()]


def _deeper(group: object, name: Key, above: KeyPath) -> str:
    """Return " (did you mean 'x.y'?)" for a key of this name within a group's own groups, "" if there is none."""
    if not is_group(group):
        return ""
    inner = {key: bare(_inner(group, key))[0] for key in _keys(group)}
    groups = {key: each for key, each in inner.items() if is_group(each)}
    found = next((dotted((*above, key, name)) for key, each in groups.items() if name in _keys(each)), "")
    if found:
        return f" (did you mean '{found}'?)"
    return next((near for key, each in groups.items() if (near := _deeper(each, name, (*above, key)))), "")


def _value_at(data: Plain, path: KeyPath) -> Plain:
    for key in path:
        if isinstance(data, dict):
            data = data.get(key)
        elif isinstance(data, list) and isinstance(key, int) and key < len(data):
            data = data[key]
    return data


def _expected(model: type[BaseModel], loc: tuple[Key, ...]) -> _Expected:
    """Follow an error's location through the types up to a union, or through one whose groups have tags.

    A tag is part of the location, but isn't a key.
    """
    expected = _Expected((), loc, model, ())
    for index, key in enumerate(loc):
        tagged = members(expected.type)
        inner = tagged.get(key) or _inner(expected.type, key)
        if inner is None:
            break
        path = expected.path if key in tagged else (*expected.path, key)
        expected = _Expected(path, loc[index + 1 :], *bare(inner))
    return expected


def members(annotation: object) -> dict[Key, object]:
    """Return the groups of keys of a tagged union by their tags; empty for any other type."""
    groups = [group for group in _union(annotation) if get_origin(group) is Annotated]
    return {item.tag: group for group in groups for item in get_args(group)[1:] if isinstance(item, Tag)}


def _union(annotation: object) -> tuple[object, ...]:
    """Return the members of a union; empty for any other type."""
    return get_args(annotation) if get_origin(annotation) in {Union, types.UnionType} else ()


def _inner(annotation: object, key: Key) -> object:
    if is_group(annotation):
        fields = annotation.model_fields
        return next((field for name, field in fields.items() if (field.alias or name) == key), None)
    arguments = get_args(annotation)
    if get_origin(annotation) is tuple and arguments[1:] == (...,):
        return arguments[0]
    return arguments[1] if get_origin(annotation) is Mapping else None


def bare(annotation: object) -> tuple[object, tuple[object, ...]]:
    """Strip `Annotated`, `FieldInfo` and `| None` from a type; return it with the constraints that they held."""
    constraints: tuple[object, ...] = ()
    while True:
        if isinstance(annotation, FieldInfo):
            constraints = (*constraints, *annotation.metadata)
            annotation = annotation.annotation
        elif get_origin(annotation) is Annotated:
            annotation, *metadata = get_args(annotation)
            for entry in metadata:
                constraints = (*constraints, *(entry.metadata if isinstance(entry, FieldInfo) else [entry]))
        elif len(rest := [each for each in _union(annotation) if each is not types.NoneType]) == 1:
            annotation = rest[0]
        else:
            return annotation, constraints


def allowed(annotation: object) -> str:
    """Return the allowed values of a field or an annotated type in words."""
    return describe(*bare(annotation))


def describe(annotation: object, constraints: Sequence[object] = ()) -> str:
    """Return the allowed values of a type in words: "a number from 0 to 1", "diamond, square, ..."."""
    for constraint in constraints:
        if isinstance(constraint, Allowed):
            return constraint.text
    if annotation is int or annotation is float:
        return ("a whole number" if annotation is int else "a number") + _range(constraints)
    if annotation is bool:
        return "true or false"
    if get_origin(annotation) is Literal:
        return ", ".join(str(choice) for choice in get_args(annotation))
    if is_group(annotation):
        return "a mapping with " + ", ".join(_keys(annotation))
    origins: dict[object, str] = {tuple: "a list", Mapping: "a mapping of vehicle ids to [forward, right, up]"}
    return origins.get(get_origin(annotation), "text")


def _range(constraints: Sequence[object]) -> str:
    bounds = {name: getattr(item, name) for item in constraints for name in _BOUNDS if hasattr(item, name)}
    low, high = bounds.get("ge"), bounds.get("le")
    if low is not None and high is not None and high < _UNBOUNDED:
        return f" from {low:g} to {high:g}"
    phrases = [f"{_BOUNDS[name]} {bound:g}" for name, bound in bounds.items() if abs(bound) < _UNBOUNDED]
    return " " + " and ".join(phrases) if phrases else ""


_BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_UNBOUNDED = 1e9


def is_group(annotation: object) -> TypeGuard[type[BaseModel]]:
    """Return whether a type is a group of keys."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
