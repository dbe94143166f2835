"""The configuration of a vehicle that navigates by inertia, its aids included, from a scenario's keys."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from sim_vehicles.airframe.motion import InnovationRatios
from sim_vehicles.inertial.error_model import PLACE, SIZE, UP
from sim_vehicles.inertial.imu import InertialSensors, sensor_random

RECEIVED = 6
GATE = 5.0
STANDARD_GRAVITY_MPS2: Final = 9.80665
DEGREE_PER_HOUR: Final = math.radians(1.0) / 3600.0


class Aid(NamedTuple):
    """A sensor that measures part of the position and velocity, with independent white errors."""

    rate_hz: float
    seen: Array
    """(M, 15) measurement matrix: which of the errors each measurement contains."""
    sigmas: Array
    """(M,) standard deviations, m and m/s."""

    @property
    def has_position(self) -> bool:
        """Whether it is a receiver: it measures places and velocities east, north and up, in this order."""
        return self.sigmas.size == RECEIVED

    def test_ratios(self, innovation: Array) -> InnovationRatios:
        """Return normalised innovations (M,) as shares of ArduPilot's gates, 5 standard deviations (EK3_POS_I_GATE)."""
        shares: list[float] = (np.abs(innovation) / GATE).tolist()
        if not self.has_position:
            return InnovationRatios(0.0, 0.0, shares[0], 0.0)
        east, north, up, *velocity = shares
        return InnovationRatios(max(velocity), max(east, north), up, 0.0)


def gnss(rate_hz: float, position_sigma_m: float, height_sigma_m: float, velocity_sigma_mps: float) -> Aid:
    """Return a GNSS receiver: position and velocity, loosely coupled (Groves, 2013, section 14.1.2)."""
    sigmas = (position_sigma_m, position_sigma_m, height_sigma_m, *(velocity_sigma_mps,) * 3)
    return Aid(rate_hz, np.eye(6, SIZE), np.array(sigmas))


def barometer(rate_hz: float, height_sigma_m: float) -> Aid:
    """Return a barometric altimeter: the height alone."""
    return Aid(rate_hz, np.eye(SIZE)[PLACE][[UP]], np.array((height_sigma_m,)))


@dataclass(frozen=True)
class InertialConfig:
    """Sensors, the aid that bounds their drift, and the alignment before the flight."""

    sensors: InertialSensors
    aid: Aid | None = None
    aligned_s: int | None = None
    """Duration of the alignment, at rest, before the vehicle boots, s; None: it starts from its true state."""
    airspeed_mps: float = 0.0
    """Standard deviation of the airspeed as measured."""


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
