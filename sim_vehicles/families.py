"""The emulated families of autopilots, ours registered as an extension registers its own: a subclass of one of these.

The hooks that a subclass may override are those of `Autopilot` and `Vehicle`; what tells families apart in numbers and
tables, such as `version` and `handlers`, are class attributes. `self.keys` has its own keys, `self.config` and
`self.fleet` what the scenario says.
"""

from __future__ import annotations

import sys
from typing import Final

from formation_scenario.extensions import EMULATED_FAMILY, Registered, registered_in
from formation_scenario.simulated import register_emulated_family
from sim_vehicles.autopilot.autopilot import Autopilot, GivenCommand
from sim_vehicles.copter import Copter
from sim_vehicles.plane import Plane
from sim_vehicles.px4_plane_and_copter import Px4Copter, Px4Plane
from sim_vehicles.vehicle import Vehicle

__all__ = ["Autopilot", "Copter", "GivenCommand", "Plane", "Px4Copter", "Px4Plane", "Vehicle"]

FAMILIES: Final = dict[str, Registered]()
"""Ours by their names."""
for _family in (Plane, Copter, Px4Plane, Px4Copter):
    register_emulated_family(_family.emulates)(_family)
    FAMILIES.update(registered_in(sys.modules[_family.__module__], EMULATED_FAMILY))
