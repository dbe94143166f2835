"""Which sensors a vehicle has."""

from __future__ import annotations

from flight_model.earth import GeodeticOrigin
from sim_vehicles.airframe.sensors import Sensors
from sim_vehicles.config import SensorErrors, VehicleConfig
from sim_vehicles.inertial.config import InertialConfig
from sim_vehicles.inertial.navigator import InertialNavigator


def sensors_of(config: VehicleConfig, origin: GeodeticOrigin, seed: int) -> Sensors | InertialNavigator | None:
    """Return what measures a vehicle's motion for its telemetry; None where that carries the exact state."""
    errors, own = config.sensors, (config.identity, seed)
    match errors:
        case SensorErrors():
            return Sensors(errors, *own)
        case InertialConfig():
            return InertialNavigator(errors, origin, config.start.heading_rad, *own)
        case None:
            return None
