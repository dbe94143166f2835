"""The linear error model of an inertial navigator, with 15 states, its aids' measurements, and a Kalman filter.

The errors are: position, east, north and up in m; velocity likewise in m/s; misalignment phi in rad, where the computed
attitude is (I - [phi x]) times the true one; the biases of accelerometers and gyroscopes, body components, in SI units.
Sources: Titterton and Weston, Strapdown Inertial Navigation Technology (2004), section 12.3; Groves (2013), section
14.2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import RATE_RADPS, gravity_mps2, radii_m
from formation_scenario.navigation import InertialNavigation
from sim_vehicles.airframe.motion import InnovationRatios
from sim_vehicles.inertial.imu import InertialSensors

POSITION, VELOCITY, TILT, ACCEL_BIAS, GYRO_BIAS = (slice(3 * i, 3 * i + 3) for i in range(5))
SIZE = 15
EAST, NORTH, UP = range(3)
RECEIVED = 6
GATE = 5.0


def dynamics(lat_rad: float, height_m: float, velocity_mps: Array, force_mps2: Array, attitude: Array) -> Array:
    """Return F (15, 15) of x' = F x + noise.

    Args:
        lat_rad: latitude.
        height_m: height above the ellipsoid.
        velocity_mps: (3,) east, north and up.
        force_mps2: (3,) specific force, east, north and up.
        attitude: (3, 3) body to navigation.
    """
    meridian_m, across_m = (radius + height_m for radius in radii_m(lat_rad))
    sine, cosine = math.sin(lat_rad), math.cos(lat_rad)
    tangent = sine / cosine
    earth = RATE_RADPS * np.array((0.0, cosine, sine))
    east, north, _ = velocity_mps
    transport = np.array((-north / meridian_m, east / across_m, east / across_m * tangent))
    of_velocity = np.array(((0.0, -1.0 / meridian_m, 0.0), (1.0 / across_m, 0.0, 0.0), (tangent / across_m, 0.0, 0.0)))
    earth_by_position, transport_by_position = np.zeros((3, 3)), np.zeros((3, 3))
    earth_by_position[:, NORTH] = RATE_RADPS / meridian_m * np.array((0.0, -sine, cosine))
    transport_by_position[UP, NORTH] = east / (across_m * cosine**2 * meridian_m)
    moving = _skew(velocity_mps)
    f = np.zeros((SIZE, SIZE))
    f[POSITION, VELOCITY] = np.eye(3)
    f[EAST, EAST] = -north * tangent / meridian_m
    f[EAST, NORTH] = east * tangent / across_m
    f[EAST, UP], f[NORTH, UP] = -east / across_m, -north / meridian_m
    f[VELOCITY, POSITION] = moving @ (2.0 * earth_by_position + transport_by_position)
    f[VELOCITY.start + UP, UP] += 2.0 * gravity_mps2(lat_rad, height_m) / math.sqrt(meridian_m * across_m)
    f[VELOCITY, VELOCITY] = moving @ of_velocity - _skew(2.0 * earth + transport)
    f[VELOCITY, TILT] = _skew(force_mps2)
    f[VELOCITY, ACCEL_BIAS] = attitude
    f[TILT, POSITION] = earth_by_position + transport_by_position
    f[TILT, VELOCITY] = of_velocity
    f[TILT, TILT] = -_skew(earth + transport)
    f[TILT, GYRO_BIAS] = -attitude
    return f


def noise_density(sensors: InertialSensors) -> Array:
    """Return the diagonal (15,) of the sensors' noise density: random walks of velocity and angle."""
    density = np.zeros(SIZE)
    density[VELOCITY], density[TILT] = sensors.accel_noise**2, sensors.gyro_noise**2
    return density


def bias_covariance(sensors: InertialSensors) -> Array:
    """Return the covariance (15, 15) of a state that is known exactly, with sensors whose biases aren't."""
    sigmas = np.zeros(SIZE)
    sigmas[ACCEL_BIAS], sigmas[GYRO_BIAS] = sensors.accel_bias_sigma, sensors.gyro_bias_sigma
    return np.diag(sigmas**2)


def _skew(v: Array) -> Array:
    """Return [v x]."""
    return np.array(((0.0, -v[2], v[1]), (v[2], 0.0, -v[0]), (-v[1], v[0], 0.0)))


class Aid(NamedTuple):
    """A sensor that measures part of the position and velocity, with independent white errors."""

    rate_hz: float
    seen: Array
    """(M, 15) measurement matrix: which of the errors each measurement contains."""
    sigmas: Array
    """(M,) standard deviations, m and m/s."""

    @property
    def has_position(self) -> bool:
        """Whether it is a GNSS receiver: it measures positions and velocities east, north and up, in this order."""
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
    """Return a barometric altimeter: only the height."""
    return Aid(rate_hz, np.eye(SIZE)[POSITION][[UP]], np.array((height_sigma_m,)))


def aid(keys: InertialNavigation) -> Aid | None:
    """Return the navigator's aid, None if it has none."""
    match keys.aiding:
        case "gnss":
            return gnss(**keys.gnss.model_dump())
        case "baro":
            return barometer(**keys.barometer.model_dump())
        case _:
            return None


class ErrorFilter:
    """A Kalman filter's covariance of N errors."""

    def __init__(self, covariance: Array) -> None:
        """Start with a covariance (N, N)."""
        self.covariance = covariance

    def predict(self, dynamics: Array, noise_density: Array, period_s: float) -> None:
        """Propagate by `period_s`, short compared with the dynamics (N, N); `noise_density` is the diagonal (N,)."""
        step = dynamics * period_s
        transition = np.eye(len(step)) + step + step @ step / 2.0
        # Simpson's rule, which includes the dynamics' effect on the noise within the step.
        half = np.eye(len(step)) + step / 2.0 + step @ step / 8.0
        middle, end = (half * noise_density) @ half.T, (transition * noise_density) @ transition.T
        noise = (end + 4.0 * middle + np.diag(noise_density)) * period_s / 6.0
        self.covariance = transition @ self.covariance @ transition.T + noise

    def update(self, seen: Array, measured: Array, sigmas: Array) -> tuple[Array, Array]:
        """Process a measurement (M,) of `seen` (M, N) @ errors, with independent standard deviations (M,).

        Return the estimated errors (N,) and the innovation (M,), normalised and decorrelated: standard normal if the
        filter is consistent.
        """
        import scipy  # noqa: PLC0415 - only aided navigation by inertia solves for a gain

        across = self.covariance @ seen.T
        total = seen @ across + np.diag(sigmas**2)
        root = scipy.linalg.cholesky(total, lower=True)
        gain = scipy.linalg.cho_solve((root, True), across.T).T
        kept = np.eye(len(self.covariance)) - gain @ seen
        # Joseph's form stays symmetric and positive definite in spite of rounding.
        self.covariance = kept @ self.covariance @ kept.T + (gain * sigmas**2) @ gain.T
        return gain @ measured, scipy.linalg.solve_triangular(root, measured, lower=True)
