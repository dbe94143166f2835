"""The functions that register a class: each notes it in the namespace of the module that it is written in.

So a registration belongs to whoever loads that module, and a module that is only imported changes nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TypeVar

from pydantic import BaseModel

from formation_scenario.extensions import FILTER, FORMATION_LAW, LAW, MARKS, METRIC, MONITOR, RECORDER, Mark
from gcs_formation.extend.base import Extension, FollowerLaw, FormationLaw, Metric, Monitor, Recorder, SetpointFilter

Made = TypeVar("Made", bound=type[Extension])
Decorator = Callable[[Made], Made]


def register_law(name: str) -> Decorator[type[FollowerLaw]]:
    """Register a law for each follower, which `law.type: NAME` chooses; `law.parameters` are its keys."""
    return _decorator(LAW, name, FollowerLaw)


def register_formation_law(name: str) -> Decorator[type[FormationLaw]]:
    """Register a law over all followers at once, which `law.type: NAME` chooses; `law.parameters` are its keys."""
    return _decorator(FORMATION_LAW, name, FormationLaw)


def register_filter(name: str) -> Decorator[type[SetpointFilter]]:
    """Register a setpoint filter, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return _decorator(FILTER, name, SetpointFilter)


def register_monitor(name: str) -> Decorator[type[Monitor]]:
    """Register a monitor, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return _decorator(MONITOR, name, Monitor)


def register_recorder(name: str) -> Decorator[type[Recorder]]:
    """Register a recorder, which is on if `extensions: {NAME: {…its keys}}` names it."""
    return _decorator(RECORDER, name, Recorder)


def register_metric(name: str) -> Decorator[type[Metric]]:
    """Register a metric, for `expect` and studies' `metrics`; `extensions: {NAME: {…}}` has its keys, if it has any."""
    return _decorator(METRIC, name, Metric)


def _decorator(kind: str, name: str, base: type[Extension]) -> Decorator[Made]:
    if not (isinstance(name, str) and name.isprintable() and name and not set(name) & set(" .=,")):
        raise ValueError(f"found name {name!r}; allowed: a text without spaces, dots, commas and equals signs")
    line = sys._getframe(2).f_lineno

    def register(made: Made) -> Made:
        if not (isinstance(made, type) and issubclass(made, base)):
            raise TypeError(f"found {made!r} as {kind} '{name}'; allowed: a subclass of {base.__name__}")
        if not issubclass(made.Keys, BaseModel):
            raise TypeError(f"found Keys of {kind} '{name}' that are no pydantic model; allowed: class Keys(BaseModel)")
        namespace = vars(sys.modules[made.__module__])
        marks: list[Mark] = namespace.setdefault(MARKS, [])
        marks.append(Mark(kind, name, made, line))
        return made

    return register
