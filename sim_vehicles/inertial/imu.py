"""Inertial sensors: their errors, applied to ideal increments."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from sim_vehicles.inertial.trajectory import Increments


@dataclass(frozen=True)
class InertialSensors:
    """Three accelerometers and three gyroscopes along the body's axes, in SI units."""

    accel_bias_mps2: tuple[float, float, float]
    gyro_bias_radps: tuple[float, float, float]
    accel_noise: float
    """Square root of the white noise's density, (m/s²)/sqrt(Hz): the velocity random walk, m/s per root second."""
    gyro_noise: float
    """Likewise, (rad/s)/sqrt(Hz): the angle random walk."""
    drawn_with: tuple[float, float] | None = None
    """The standard deviations with which random biases were drawn, m/s² and rad/s; None: they are given."""

    @property
    def accel_bias_sigma(self) -> float:
        """The standard deviation of a bias that filters assume: the given biases' root mean square, m/s²."""
        return self.drawn_with[0] if self.drawn_with else _root_mean_square(self.accel_bias_mps2)

    @property
    def gyro_bias_sigma(self) -> float:
        """The same of the gyroscopes, rad/s."""
        return self.drawn_with[1] if self.drawn_with else _root_mean_square(self.gyro_bias_radps)

    def drawn(self, random: np.random.Generator) -> InertialSensors:
        """Return such sensors with biases drawn as filters assume them: normal, each axis its own."""
        sigmas = self.accel_bias_sigma, self.gyro_bias_sigma
        (a, b, c), (d, e, f) = (np.array(sigmas)[:, None] * random.standard_normal((2, 3))).tolist()
        return InertialSensors((a, b, c), (d, e, f), self.accel_noise, self.gyro_noise, sigmas)


def _root_mean_square(biases: tuple[float, float, float]) -> float:
    return math.sqrt(sum(each**2 for each in biases) / 3.0)


def measured(ideal: Increments, sensors: InertialSensors, period_s: float, random: np.random.Generator) -> Increments:
    """Return the increments that these sensors measure instead of `ideal`, over intervals of `period_s`."""
    shape, root_s = ideal.angle_rad.shape, math.sqrt(period_s)
    angle = np.multiply(sensors.gyro_bias_radps, period_s) + sensors.gyro_noise * root_s * random.standard_normal(shape)
    change = np.multiply(sensors.accel_bias_mps2, period_s) + sensors.accel_noise * root_s * random.standard_normal(
        shape
    )
    return Increments(ideal.angle_rad + angle, ideal.velocity_mps + change)


def sensor_random(seed: int, vehicle: VehicleId, purpose: str = "inertial") -> np.random.Generator:
    """Return a vehicle's own stream of random numbers for a purpose."""
    return np.random.Generator(np.random.Philox(random_stream(seed, purpose, *vehicle)))
