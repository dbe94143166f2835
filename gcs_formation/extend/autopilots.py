"""Families of autopilots as the station commands them: ours, registered as one from outside is, and how that is held.

Ours are the folders of `gcs_formation/vehicle/families`, found by being there: a folder's module `family` has
`FAMILIES`, its classes by the families' names, and nothing else names it, so that it can be deleted.

A family of one's own is a subclass of `Autopilot`, with everything that a family needs, or of the class of ours that it
resembles; these are attributes of this module, such as `ArduPlane`. The hooks are the methods of `Autopilot`; what
tells families apart in numbers and tables are class attributes. `self.keys` has its own keys.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Final

from airlink.messages.system import Heartbeat
from flight_model.flight_state import FlightState, Setpoint
from formation_scenario.extensions import AUTOPILOT, Registered, registered_in
from formation_scenario.register import Decorator, decorator
from gcs_formation.errors import NotFiniteError, RunAbortedError
from gcs_formation.vehicle import families
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.craft import Craft
from gcs_formation.vehicle.effect import Effect
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

__all__ = [
    "Autopilot",
    "Check",
    "Command",
    "Craft",
    "Effect",
    "FlightState",
    "Heartbeat",
    "Setpoint",
    "StartUpStep",
    "Telemetry",
    "family_named",
    "register_autopilot",
]

NOTHING: Final[Mapping[str, object]] = {
    "speaks": False,
    "start_up": (),
    "says_airborne": True,
    "says_grounded": False,
    "setpoint": (),
    "checks": (),
}
"""What stands for each method that every family has of its own, after that of an extension has failed."""


def register_autopilot(name: str) -> Decorator[type[Autopilot]]:
    """Register a family of autopilots, which `autopilot: NAME` of a vehicle chooses; `parameters` are its keys."""
    return decorator(AUTOPILOT, name, Autopilot)


FAMILIES: Final = dict[str, Registered]()
"""Ours by their names."""
for _folder in sorted(each.name for each in iter_modules(families.__path__) if each.ispkg):
    for _name, _family in import_module(f"{families.__name__}.{_folder}.family").FAMILIES.items():
        register_autopilot(_name)(_family)
        FAMILIES.update(registered_in(sys.modules[_family.__module__], AUTOPILOT))

_OURS: Final = {
    each.__name__: each for entry in FAMILIES.values() for each in entry.made.__mro__ if issubclass(each, Autopilot)
}
"""Classes of ours by their names."""


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a class, of which another may be a subclass
    """Return one of our classes by its name, such as `ArduPlane`."""
    if name in _OURS:
        return _OURS[name]
    raise AttributeError(f"found {name}; allowed: {', '.join(_OURS)}")


def family_named(name: str) -> type[Autopilot]:
    """Return one of our families.

    Raises:
        RunAbortedError: its folder isn't there.
    """
    if name not in FAMILIES:
        raise RunAbortedError(f"found autopilot family '{name}', which isn't installed; allowed: {', '.join(FAMILIES)}")
    made: type[Autopilot] = FAMILIES[name].made
    return made


def own_autopilot(entry: Registered, keys: Mapping[str, Any], craft: Craft) -> Autopilot:
    """Return the interface to an autopilot of a family from outside.

    Where its code raises an error, `failure` says so, and the class of ours that it is a subclass of goes on in its
    place, so that the flight ends safely.

    Raises:
        RunAbortedError: it can't begin.
    """

    def begun() -> Autopilot:
        autopilot: Autopilot = _held(entry).of(craft)
        autopilot.keys = entry.keys_model.model_validate(keys)
        return autopilot

    return entry.call(begun, lambda why: RunAbortedError(f"{entry} can't begin: {why}"))


def _held(entry: Registered) -> type[Autopilot]:
    """Return a subclass of a registered class whose own methods and properties don't raise."""
    made: type[Autopilot] = entry.made
    base = next(each for each in made.__mro__ if each in _OURS.values())
    held = {name: _method(entry, name, value, base) for name, value in _own(made, base)}
    return type(made.__name__, (made,), held)


def _own(made: type[Autopilot], base: type[Autopilot]) -> Iterator[tuple[str, Any]]:
    """Yield the methods and properties that a class and its bases below ours define, the innermost last."""
    for each in reversed(made.__mro__[: made.__mro__.index(base)]):
        for name, value in vars(each).items():
            if name not in {"__init__", "of"} and (isinstance(value, property) or _is_function(value)):
                yield name, value


def _is_function(value: object) -> bool:
    return callable(value) and not isinstance(value, type | classmethod | staticmethod)


def _called(value: Any) -> Any:  # noqa: ANN401 - as above
    """Return the function of a method or a property."""
    return value.fget if isinstance(value, property) else value


def _method(entry: Registered, name: str, value: Any, base: type[Autopilot]) -> Any:  # noqa: ANN401 - a class's attributes
    """Return a method, or a property, that notes an error and does as our class does from then on."""
    own, ours = _called(value), _called(getattr(base, name, None))

    def held(self: Autopilot, *args: object, **kwargs: object) -> object:
        if self.failure is None:
            try:
                return entry.call(lambda: own(self, *args, **kwargs), lambda why: NotFiniteError(str(entry), None, why))
            except NotFiniteError as error:
                self.failure = error
        if name in NOTHING and getattr(ours, "__isabstractmethod__", False):
            return NOTHING[name]
        return ours(self, *args, **kwargs) if callable(ours) else ours

    return property(held) if isinstance(value, property) else held
