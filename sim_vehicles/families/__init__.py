"""The emulated families of autopilots: folders, found by being here, each registered as an extension's is.

A folder's module `family` has `FAMILIES`, the classes that it brings; nothing else names it, so that it can be deleted.
An extension subclasses one of these classes, which are attributes of this module. The hooks that it may override are
those of `Autopilot` and `Vehicle`; what tells families apart in numbers and tables, such as `version` and `handlers`,
are class attributes. `self.keys` has its own keys, `self.config` and `self.fleet` what the scenario says.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Final

from formation_scenario.extensions import EMULATED_FAMILY, ExtensionError, Registered, registered_in
from formation_scenario.simulated import register_emulated_family
from sim_vehicles.autopilot.autopilot import Autopilot, GivenCommand
from sim_vehicles.vehicle import Vehicle

__all__ = ["FAMILIES", "Autopilot", "GivenCommand", "Vehicle", "family_named"]

FAMILIES: Final = dict[str, Registered]()
"""Ours by their names."""
for _folder in sorted(each.name for each in iter_modules(__path__) if each.ispkg):
    for _family in import_module(f"{__name__}.{_folder}.family").FAMILIES:
        register_emulated_family(_family.emulates)(_family)
        FAMILIES.update(registered_in(sys.modules[_family.__module__], EMULATED_FAMILY))


def family_named(name: str) -> Registered:
    """Return one of ours.

    Raises:
        ExtensionError: its folder isn't there.
    """
    if name not in FAMILIES:
        raise ExtensionError(f"found emulated family '{name}', which isn't installed; allowed: {', '.join(FAMILIES)}")
    return FAMILIES[name]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a class, of which another may be a subclass
    """Return one of our classes of vehicles by its name, such as `Plane`."""
    for each in FAMILIES.values():
        if each.made.__name__ == name:
            return each.made
    raise AttributeError(f"found {name}; allowed: {', '.join(each.made.__name__ for each in FAMILIES.values())}")
