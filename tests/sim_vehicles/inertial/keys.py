"""Keys of inertial navigation that give sensors of known errors."""

import math
from typing import Any

from flight_model.energy import GRAVITY_MPS2
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from sim_vehicles.inertial.imu import InertialSensors

MICRO_G_MPS2, DEGREE_PER_HOUR_RADPS = 1e-6 * GRAVITY_MPS2, math.radians(1.0) / 3600.0


def inertial_keys(sensors: InertialSensors, **keys: Any) -> InertialNavigation:
    """Return the keys of a navigator with these sensors, which are in SI units."""
    ax, ay, az = (each / MICRO_G_MPS2 for each in sensors.accel_bias_mps2)
    gx, gy, gz = (each / DEGREE_PER_HOUR_RADPS for each in sensors.gyro_bias_radps)
    given = InertialSensorKeys(
        accel_bias_ug=(ax, ay, az),
        gyro_bias_deg_per_h=(gx, gy, gz),
        accel_noise_ug_per_rthz=sensors.accel_noise / MICRO_G_MPS2,
        gyro_noise_deg_per_rth=math.degrees(sensors.gyro_noise) * 60.0,
    )
    return InertialNavigation(source="ins", sensors=given, **keys)
