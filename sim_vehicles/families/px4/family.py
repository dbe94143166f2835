"""Declares which families are here."""

from __future__ import annotations

from typing import Final

from sim_vehicles.families.px4.copter import Px4Copter
from sim_vehicles.families.px4.guided_course import Px4CoursePlane
from sim_vehicles.families.px4.plane import Px4Plane

FAMILIES: Final = (Px4Plane, Px4Copter, Px4CoursePlane)
