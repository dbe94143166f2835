"""The base of what comes from outside, and how it is registered: noted in the namespace of the module it is written in.

So a registration belongs to the run that loads that module, and a module that is only imported changes nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict

MARKS = "__gcs_formation_registered__"
"""The name in a module's namespace under which the register functions list what it brings."""


class Mark(NamedTuple):
    """What a register function notes in the namespace of the class's module."""

    kind: str
    name: str
    made: type[Any]
    line: int


def marks_of(module: ModuleType) -> list[Mark]:
    """Return what a module registers, in its order."""
    marks: list[Mark] = vars(module).get(MARKS, [])
    return marks


class Extension:
    """What all kinds have in common: their keys, and a moment at which to begin."""

    class Keys(BaseModel):
        """The extension's own keys; without any here."""

        model_config = ConfigDict(defer_build=True)

    keys: Any
    """The keys of this instance, a `Keys`, with defaults filled in."""

    def __init__(self, keys: BaseModel) -> None:
        """Take the keys, which have been checked."""
        self.keys = keys
        self.begin()

    def begin(self) -> None:
        """Prepare what is needed between calls; `self.keys` is there."""


Made = TypeVar("Made", bound=type[Any])
Decorator = Callable[[Made], Made]


def decorator(kind: str, name: str, base: type[Any]) -> Decorator[Made]:
    """Return what registers a subclass of `base` by a name; to be called by a public function alone."""
    if not (isinstance(name, str) and name.isprintable() and name and not set(name) & set(" .=,")):
        raise ValueError(f"found name {name!r}; allowed: a text without spaces, dots, commas and equals signs")
    line = sys._getframe(2).f_lineno

    def register(made: Made) -> Made:
        if not (isinstance(made, type) and issubclass(made, base)):
            raise TypeError(f"found {made!r} as {kind} '{name}'; allowed: a subclass of {base.__name__}")
        if not issubclass(getattr(made, "Keys", BaseModel), BaseModel):
            raise TypeError(f"found Keys of {kind} '{name}' that are no pydantic model; allowed: class Keys(BaseModel)")
        namespace = vars(sys.modules[made.__module__])
        marks: list[Mark] = namespace.setdefault(MARKS, [])
        marks.append(Mark(kind, name, made, line))
        return made

    return register
