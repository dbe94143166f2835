"""The class for each autopilot family."""

from __future__ import annotations

from airlink.geodesy import GeodeticOrigin
from formation_scenario import Vehicle
from gcs_formation.vehicle.arduplane import ArduPlane
from gcs_formation.vehicle.autopilot import Autopilot
from gcs_formation.vehicle.px4_plane import Px4Plane

FAMILIES: dict[str, type[Autopilot]] = {"emulator": ArduPlane, "arduplane": ArduPlane, "px4": Px4Plane}
"""The scenario's `autopilot` -> its class; the emulators behave like ArduPlane."""


def autopilot_for(vehicle: Vehicle, origin: GeodeticOrigin) -> Autopilot:
    """Return the family's class for a vehicle of the scenario."""
    return FAMILIES[vehicle.autopilot](vehicle.id, origin, vehicle.model.turn_rate_max_rps)
