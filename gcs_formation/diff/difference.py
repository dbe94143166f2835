"""One difference of two runs, and when two values count as different."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, TypeGuard

WIDTH: Final = 60
"""Most characters of a value that are shown."""


@dataclass(frozen=True, slots=True)
class Difference:
    """What differs: the part of the record, the location in it, when, s since the run's start, and both values."""

    part: str
    location: str
    t_s: float | None
    one: object
    other: object

    def __str__(self) -> str:
        """Return it as a line: where, when, both values, and by how much numbers differ."""
        where = ": ".join(each for each in (self.part, self.location) if each)
        when = "" if self.t_s is None else f" at {self.t_s:.3f} s"
        return f"{where}{when}: {_shown(self.one)} | {_shown(self.other)}{_by(self.one, self.other)}"


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The greatest difference of two numbers that counts as none; None: they must be equal."""

    maximum: float | None

    def same(self, one: object, other: object) -> bool:
        """Return whether two values count as the same; NaN is the same as NaN."""
        if not (_is_number(one) and _is_number(other)):
            return type(one) is type(other) and one == other
        a, b = float(one), float(other)
        if a == b or (math.isnan(a) and math.isnan(b)):
            return True
        return self.maximum is not None and abs(a - b) <= self.maximum


def flattened(value: object, above: str = "") -> dict[str, Any]:
    """Return the values of nested mappings and lists by dotted keys, list items from 0."""
    if not isinstance(value, dict | list) or not value:
        return {above: value}
    pairs = value.items() if isinstance(value, dict) else enumerate(value)
    flat: dict[str, Any] = {}
    for key, each in pairs:
        flat |= flattened(each, f"{above}.{key}" if above else str(key))
    return flat


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(value: object) -> str:
    text = f"{value:.10g}" if isinstance(value, float) else str(value)
    return text if len(text) <= WIDTH else f"{text[: WIDTH - 3]}..."


def _by(one: object, other: object) -> str:
    if not (_is_number(one) and _is_number(other)):
        return ""
    by = abs(float(one) - float(other))
    return f" (by {by:.3g})" if math.isfinite(by) else ""
