"""Declares which families are here."""

from __future__ import annotations

from typing import Final

from sim_vehicles.families.arduplane.plane import Plane

FAMILIES: Final = (Plane,)
