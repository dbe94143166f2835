"""Holds code from outside, an extension's instances, for the compiled modules that call it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from flight_model.slot import Vector3, all_finite
from formation_scenario.extensions import Registered
from gcs_formation.errors import NotFiniteError, RunAbortedError

Result = TypeVar("Result")


def made(entry: Registered, keys: Mapping[str, Any], **given: Any) -> Any:  # noqa: ANN401 - a class from outside
    """Return a new instance of an extension, which has the attributes `given` when it begins.

    Raises:
        RunAbortedError: it raised an error while it was made.
    """
    return entry.call(lambda: entry.instance(keys, **given), lambda why: RunAbortedError(f"{entry} can't begin: {why}"))


def guarded(entry: Registered, call: Callable[[], Result]) -> Result:
    """Return what code from outside returns.

    Raises:
        NotFiniteError: it raised an error; the text has its file and line.
    """
    return entry.call(call, lambda why: NotFiniteError(str(entry), None, why), (NotFiniteError,))


def three_numbers(values: Iterable[Any]) -> Vector3:
    """Return three numbers as floats; ValueError or TypeError if they are something else."""
    first, second, third = values
    return float(first), float(second), float(third)


def _as_feedback(values: Iterable[Any]) -> Vector3:
    try:
        return three_numbers(values)
    except (TypeError, ValueError):
        allowed = "three numbers: speed m/s, heading rad, height m"
        raise TypeError(f"returned {values!r}; allowed: {allowed}") from None


class Feedback:
    """The feedback of one follower's law from outside."""

    def __init__(self, entry: Registered, keys: Mapping[str, Any], index: int) -> None:
        """Make an instance for one vehicle."""
        self._entry, self._index, self._law = entry, index, made(entry, keys)

    def output(self, mixed: Vector3, slopes: Vector3, replaced: tuple[bool, bool, bool], dt_s: float) -> Vector3:
        """Return what it adds to the feed-forward, m/s, rad, m.

        Raises:
            NotFiniteError: it raised an error, or returned something else than three finite numbers.
        """
        law = self._law
        law.replaced = replaced
        output = guarded(self._entry, lambda: _as_feedback(law.feedback(mixed, slopes, dt_s)))
        if not all_finite(output):
            values = "speed {:.6g} m/s, heading {:.6g} rad, height {:.6g} m".format(*output)
            raise NotFiniteError(f"{self._entry} ({self._entry.where})", self._index, f"feedback: {values}")
        return output

    def limited(self, excess: Vector3) -> None:
        """Take what the limits added to the last output."""
        self._law.excess = excess

    def reset(self) -> None:
        """Forget what was accumulated."""
        self._law.excess, self._law.replaced = (0.0, 0.0, 0.0), (False, False, False)
        guarded(self._entry, self._law.reset)
