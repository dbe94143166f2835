"""What comes from outside: a law, a filter or another thing that a module named by a run registers.

A scenario names what is registered; it never names a file to execute. formation_scenario/registry.py loads the modules.
"""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, TypeVar

from pydantic import BaseModel, create_model

from formation_scenario.register import marks_of

Result = TypeVar("Result")
OPTION = "--plugin"
LAW, FORMATION_LAW, FILTER, MONITOR, RECORDER, METRIC = (
    "law",
    "formation law",
    "filter",
    "monitor",
    "recorder",
    "metric",
)
LINK, FAULT, DISTURBANCE, AIRCRAFT, EMULATED_FAMILY, NAVIGATION = (
    "link process",
    "fault",
    "disturbance",
    "aircraft",
    "emulated family",
    "navigation source",
)
PREDICTOR, DELAY_ESTIMATOR, GUIDANCE, AUTOPILOT = "predictor", "delay estimator", "guidance", "autopilot family"
LAW_KINDS = LAW, FORMATION_LAW
"""Kinds that `law.type` names; a metric is named in `expect`, others in `extensions`."""
SWITCHED = FILTER, MONITOR, RECORDER
"""Kinds that are on if `extensions` names them."""


class ExtensionError(Exception):
    """An extension that can't begin, or that failed; the message has its file and line."""


@dataclass(frozen=True)
class Origin:
    """A module from outside: a file with its content, or an entry point of an installed package."""

    file: str
    sha256: str
    content: bytes | None = None
    """None for an installed package."""
    entry_point: str = ""
    package: str | None = None
    version: str | None = None

    @property
    def how(self) -> str:
        """How it is named so that a command loads it."""
        return f"{OPTION} {self.file}" if self.package is None else f"pip install {self.package}=={self.version}"


@dataclass(frozen=True, eq=False)
class Registered:
    """One thing that a module registers: its kind, name and class, and where it is written."""

    kind: str
    name: str
    made: type[Any]
    line: int
    origin: Origin

    @property
    def where(self) -> str:
        """File and line."""
        return f"{self.origin.file}:{self.line}"

    def __str__(self) -> str:
        return f"{self.kind} '{self.name}'"

    @property
    def keys_model(self) -> type[BaseModel]:
        """The model of its own keys."""
        model: type[BaseModel] = getattr(self.made, "Keys", None) or create_model("NoKeys")
        return model

    @property
    def works_by_defaults(self) -> bool:
        """Whether none of its keys must be given."""
        return not any(field.is_required() for field in self.keys_model.model_fields.values())

    def instance(self, keys: Mapping[str, Any], **given: Any) -> Any:  # noqa: ANN401 - a class from outside
        """Return a new instance with its keys, typed by its own model; it has the attributes `given` when it begins."""
        typed = self.keys_model.model_validate_json(json.dumps(keys))
        one = self.made.__new__(self.made, typed)
        for name, value in given.items():
            setattr(one, name, value)
        self.made.__init__(one, typed)
        return one

    def call(
        self,
        act: Callable[[], Result],
        failed: Callable[[str], Exception],
        passing: tuple[type[Exception], ...] = (),
    ) -> Result:
        """Return what its code returns; raise `failed` of the words for whatever else than `passing` it raises.

        Every call of code from outside goes through here: it may raise anything, and what it raises is its author's.
        """
        try:
            return act()
        except passing:
            raise
        except Exception as error:  # of code from outside, the only place that takes all of it
            raise failed(self.describe_error(error)) from error

    def describe_error(self, error: BaseException) -> str:
        """Return an error that its code raised in words, with the file and line of that code."""
        line = line_in(error, self.origin.file)
        return f"{type(error).__name__}: {error} ({self.origin.file}, line {line or self.line})"

    def to_dict(self) -> dict[str, Any]:
        """Return it as recorded."""
        named = {"name": self.name, "kind": self.kind, "version": self.origin.version, "sha256": self.origin.sha256}
        return named | {"package": self.origin.package, "file": self.origin.file}


def line_in(error: BaseException, file: str) -> int | None:
    """Return the innermost line of a file in an error's traceback; None if it isn't in it."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_code.co_filename == file]
    return lines[-1] if lines else None


def registered_in(module: ModuleType, kind: str) -> dict[str, Registered]:
    """Return what one of our own modules registers of a kind, by its names."""
    origin = Origin(str(module.__file__), "")
    return {one.name: one for one in registered_of(module, origin) if one.kind == kind}


def registered_of(module: ModuleType, origin: Origin) -> Iterator[Registered]:
    """Return what a module registers."""
    for mark in marks_of(module):
        yield Registered(mark.kind, mark.name, mark.made, mark.line, origin)
