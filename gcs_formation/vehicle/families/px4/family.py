"""Declares which families are here, by their names."""

from __future__ import annotations

from typing import Final

from gcs_formation.vehicle.families.px4.copter import Px4Copter
from gcs_formation.vehicle.families.px4.guided_course import Px4Course
from gcs_formation.vehicle.families.px4.plane import Px4Plane

FAMILIES: Final = {"px4_plane": Px4Plane, "px4_copter": Px4Copter, "px4_course": Px4Course}
