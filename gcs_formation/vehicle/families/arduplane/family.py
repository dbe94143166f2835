"""Declares which families are here, by their names."""

from __future__ import annotations

from typing import Final

from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane

FAMILIES: Final = {"arduplane": ArduPlane}
