"""A vehicle whose autopilot is to be commanded, as far as its family needs to know it."""

from __future__ import annotations

from typing import NamedTuple

from flight_model.earth import GeodeticOrigin
from formation_scenario.vehicles import VehicleModel
from gcs_formation.estimation.airspeed import AirspeedScale


class Craft(NamedTuple):
    """A vehicle whose autopilot is to be commanded."""

    system: int
    """Its MAVLink system id."""
    origin: GeodeticOrigin
    """Origin of positions and heights."""
    model: VehicleModel
    airspeed_scale: AirspeedScale | None
    """Converts between true airspeeds and its sensor's readings; None: it reports and takes true ones, or none."""
    tick_s: float
    """Time between control ticks."""
