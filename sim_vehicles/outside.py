"""Holds code from outside, instances of extensions, for the compiled modules that call it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from airlink.endpoint import VehicleId
from formation_scenario.extensions import ExtensionError, Registered

Result = TypeVar("Result")


class Failures:
    """What failed of a fleet's extensions; only the first is reported."""

    def __init__(self) -> None:
        """Start without any."""
        self.first: str | None = None

    def add_error(self, entry: Registered, text: str) -> None:
        """Take what an extension did wrong."""
        self.add(f"the {entry} failed: {text}")

    def add(self, text: str) -> None:
        """Take what failed, in words."""
        self.first = self.first or text


class Guarded:
    """An instance of an extension, which isn't called again after it has failed."""

    def __init__(self, entry: Registered, keys: Mapping[str, Any] | None, failures: Failures, **given: Any) -> None:
        """Make the instance, with the attributes `given`.

        Raises:
            ExtensionError: it can't begin.
        """
        self.entry, self._failures, self.failed = entry, failures, False
        self.instance = entry.call(
            lambda: entry.instance(keys or {}, **given), lambda why: ExtensionError(f"the {entry} can't begin: {why}")
        )

    def call(self, method: Callable[[], Result], otherwise: Result) -> Result:
        """Return what a call returns; `otherwise` if it fails, or failed before."""
        if self.failed:
            return otherwise
        try:
            return method()
        except Exception as error:  # noqa: BLE001 - of code from outside
            self._fail(self.entry.describe_error(error))
            return otherwise

    def finite(self, method: Callable[[], Sequence[float]], count: int) -> tuple[float, ...] | None:
        """Return the numbers that a call returns; None if they aren't `count` finite ones, or it failed before."""

        def numbers() -> tuple[float, ...]:
            return tuple(float(each) for each in method())

        found = self.call(numbers, None)
        if found is not None and not (len(found) == count and math.isfinite(sum(found))):
            self._fail(f"found {', '.join(f'{each:.6g}' for each in found)} ({self.entry.where})")
            return None
        return found

    def _fail(self, text: str) -> None:
        self.failed = True
        self._failures.add_error(self.entry, text)


def reference(vehicle: VehicleId) -> int | str:
    """Return a vehicle as a scenario writes it."""
    return vehicle.system if vehicle.network == 1 else str(vehicle)
