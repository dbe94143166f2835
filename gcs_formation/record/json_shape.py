"""Validation of JSON read back from a record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import NoneType
from typing import Any, Final, NamedTuple, TypeAlias, cast

MAX_LETTERS: Final = 40


class Kind(NamedTuple):
    """Values of some types, and their name; a boolean counts as a number only if listed."""

    words: str
    types: tuple[type, ...]


class Each(NamedTuple):
    """An object or array whose values all have one shape."""

    shape: Shape


class Maybe(NamedTuple):
    """The shape of an optional key's value."""

    shape: Shape


Shape: TypeAlias = "Kind | Each | Mapping[str, Shape | Maybe]"
"""A mapping stands for an object with at least these keys."""
TEXT = Kind("a text", (str,))
INTEGER = Kind("an integer", (int,))
NUMBER = Kind("a number", (int, float))
NUMBER_OR_NULL = Kind("a number or null", (int, float, NoneType))
TEXT_OR_NULL = Kind("a text or null", (str, NoneType))
TRUTH_OR_NULL = Kind("true, false or null", (bool, NoneType))
OBJECT = Kind("an object", (dict,))
ANYTHING = Kind("a value", (object, bool))


def mismatch(found: object, shape: Shape, where: str, path: str = "") -> str | None:
    """Return in words the first value that doesn't fit, None if all do.

    Args:
        found: what was read.
        shape: what it must be.
        where: name of the file, or of a part of it.
        path: dotted keys from there to `found`.
    """
    if isinstance(shape, Kind):
        fits = isinstance(found, shape.types) and (not isinstance(found, bool) or bool in shape.types)
        return None if fits else _mismatch(found, shape.words, where, path)
    if isinstance(shape, Each):
        return _each(found, shape, where, path)
    if not isinstance(found, dict):
        return _mismatch(found, OBJECT.words, where, path)
    values = cast("dict[str, Any]", found)
    for name, own in shape.items():
        at, wanted = f"{path}.{name}" if path else name, own.shape if isinstance(own, Maybe) else own
        if name in values:
            text = mismatch(values[name], wanted, where, at)
        else:
            text = None if wanted is not own else f"found no {at} in {where}; expected: {_words(wanted)}"
        if text is not None:
            return text
    return None


def _each(found: object, shape: Each, where: str, path: str) -> str | None:
    if not isinstance(found, dict | list):
        return _mismatch(found, _words(shape), where, path)
    values = cast("dict[str, Any] | list[Any]", found)
    named = values.items() if isinstance(values, dict) else enumerate(values)
    texts = (mismatch(value, shape.shape, where, f"{path}.{name}") for name, value in named)
    return next((text for text in texts if text is not None), None)


def _mismatch(found: object, words: str, where: str, path: str) -> str:
    shown = json.dumps(found, ensure_ascii=False, default=str)
    shown = shown if len(shown) <= MAX_LETTERS else f"{shown[:MAX_LETTERS]}…"
    return f"found {shown}{f' for {path}' if path else ''} in {where}; expected: {words}"


def _words(shape: Shape) -> str:
    if isinstance(shape, Kind):
        return shape.words
    return "an object or an array" if isinstance(shape, Each) else OBJECT.words
