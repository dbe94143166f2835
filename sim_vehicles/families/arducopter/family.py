"""Declares which families are here."""

from __future__ import annotations

from typing import Final

from sim_vehicles.families.arducopter.copter import Copter

FAMILIES: Final = (Copter,)
