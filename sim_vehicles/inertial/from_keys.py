"""A scenario's keys of inertial navigation in SI units."""

from __future__ import annotations

import math
from typing import Final

from airlink.identity import VehicleId
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from sim_vehicles.inertial.aiding import Aid, barometer, gnss
from sim_vehicles.inertial.imu import InertialSensors, sensor_random

STANDARD_GRAVITY_MPS2: Final = 9.80665
DEGREE_PER_HOUR: Final = math.radians(1.0) / 3600.0


def inertial_sensors(keys: InertialNavigation, seed: int, vehicle: VehicleId) -> InertialSensors:
    """Return a vehicle's sensors in SI units; keys of the resolved scenario, none is missing."""
    given = _given(keys.sensors)
    return given.drawn(sensor_random(seed, vehicle, "biases")) if keys.biases == "random" else given


def _given(keys: InertialSensorKeys) -> InertialSensors:
    return InertialSensors(
        accel_bias_mps2=_axes(keys.accel_bias_ug, 1e-6 * STANDARD_GRAVITY_MPS2),
        gyro_bias_radps=_axes(keys.gyro_bias_deg_per_h, DEGREE_PER_HOUR),
        accel_noise=1e-6 * STANDARD_GRAVITY_MPS2 * (keys.accel_noise_ug_per_rthz or 0.0),
        gyro_noise=math.radians(keys.gyro_noise_deg_per_rth or 0.0) / 60.0,
    )


def aid(keys: InertialNavigation) -> Aid | None:
    """Return what aids the navigator, None for nothing."""
    match keys.aiding:
        case "gnss":
            return gnss(**keys.gnss.model_dump())
        case "baro":
            return barometer(**keys.barometer.model_dump())
        case _:
            return None


def _axes(value: float | tuple[float, float, float] | None, unit: float) -> tuple[float, float, float]:
    x, y, z = value if isinstance(value, tuple) else (value or 0.0,) * 3
    return x * unit, y * unit, z * unit
