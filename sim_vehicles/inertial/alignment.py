"""Alignment of a vehicle at rest: attitude from gravity and the Earth's rotation, refined by a Kalman filter.

Coarse alignment: the mean specific force gives the vertical, the mean angular rate gives north. Fine alignment: a
filter of ten states, whose measurement is that the vehicle's velocity is zero. It can't separate a horizontal
accelerometer bias from a tilt (b / g), nor the eastern gyroscope's bias from a heading error (epsilon / (Omega cos L)).
Source: Titterton and Weston (2004), sections 10.2 and 10.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import RATE_RADPS, GeodeticOrigin, gravity_mps2
from sim_vehicles.inertial.error_model import (
    ACCEL_BIAS,
    EAST,
    GYRO_BIAS,
    NORTH,
    SIZE,
    TILT,
    UP,
    VELOCITY,
    ErrorFilter,
    dynamics,
    noise_density,
)
from sim_vehicles.inertial.imu import Increments, InertialSensors, NavigationState, Trajectory, measured, misalignment
from sim_vehicles.inertial.strapdown import Strapdown

COARSE_S: Final = 60.0
"""Averaging time of the coarse alignment; the fine filter then processes the same samples from the beginning."""
UPDATE_S: Final = 1.0
FIRST_SIGMA: Final = np.radians((1.0, 1.0, 5.0))
"""Standard deviations of the attitude after the coarse alignment, about east, north and up, rad."""
FIRST_SHARE: Final = 50.0
"""Least ratio of these to the alignment's limits: a narrower prior would make a bias look known, and the posterior fall
below its limit (by 0.5 % with a ratio of 10)."""
VELOCITY_SIGMA_MPS: Final = 0.1
"""Standard deviation of the velocity with which a vehicle at rest sways in the wind, east and north."""
STATES: Final = np.array(
    [VELOCITY.start + EAST, VELOCITY.start + NORTH]
    + [TILT.start + axis for axis in range(3)]
    + [ACCEL_BIAS.start + EAST, ACCEL_BIAS.start + NORTH]
    + [GYRO_BIAS.start + axis for axis in range(3)]
)
"""Indices of the estimated ones of the fifteen errors. Biases are along east, north and up: the vehicle is at rest."""
TILTS: Final = slice(2, 5)


@dataclass(frozen=True)
class Alignment:
    """The result of an alignment."""

    times_s: Array
    """(K,) times of the updates."""
    sigma_rad: Array
    """(K, 3) standard deviations of the misalignment about east, north and up, from the filter's covariance."""
    error_rad: Array
    """(K, 3) true misalignment."""
    innovations: Array
    """(K, 2) innovations of the velocity east and north, normalised by their standard deviations."""
    bias: Array
    """(6,) estimated biases, body components: accelerometers' in m/s², gyroscopes' in rad/s."""
    covariance: Array
    """(15, 15) covariance of all errors, biases in body components; zero for those not estimated."""
    coarse_rad: Array
    """(3,) true misalignment after the coarse alignment."""


def coarse(rate_radps: Array, force_mps2: Array) -> Array:
    """Return the attitude (3, 3) of a vehicle at rest, from its mean rate and force (3,), body components."""
    up = force_mps2 / np.linalg.norm(force_mps2)
    east = np.cross(rate_radps, up)
    east /= np.linalg.norm(east)
    return np.stack((east, np.cross(up, east), up))


def limits(sensors: InertialSensors, position: GeodeticOrigin) -> Array:
    """Return the limits of any alignment, rad, (3,) about east, north and up: b / g, b / g, epsilon / (Omega cos L)."""
    tilt = sensors.accel_bias_sigma / gravity_mps2(position.lat_rad, position.alt_m)
    return np.array((tilt, tilt, sensors.gyro_bias_sigma / (RATE_RADPS * math.cos(position.lat_rad))))


class FineAlignment:
    """The filter of ten states, for a vehicle at rest at a known position."""

    def __init__(self, position: GeodeticOrigin, sensors: InertialSensors) -> None:
        """Start after a coarse alignment; `sensors` are those that the filter assumes."""
        self.position = position
        force = np.array((0.0, 0.0, gravity_mps2(position.lat_rad, position.alt_m)))
        model = dynamics(position.lat_rad, position.alt_m, np.zeros(3), force, np.eye(3))
        self._dynamics = model[np.ix_(STATES, STATES)]
        self._density = noise_density(sensors)[STATES]
        self._accel_bias_sigma = accel = sensors.accel_bias_sigma
        tilts = np.maximum(FIRST_SIGMA, FIRST_SHARE * limits(sensors, position))
        sigmas = np.concatenate(((VELOCITY_SIGMA_MPS,) * 2, tilts, (accel,) * 2, (sensors.gyro_bias_sigma,) * 3))
        self._filter = ErrorFilter(np.diag(sigmas**2))

    @property
    def sigma_rad(self) -> Array:
        """Standard deviations (3,) of the misalignment about east, north and up."""
        return np.sqrt(np.diag(self._filter.covariance)[TILTS])

    def update(self, velocity_mps: Array) -> tuple[Array, Array]:
        """Take the velocity (2,) east and north, `UPDATE_S` later; return the errors (15,) and the innovation (2,)."""
        self._filter.predict(self._dynamics, self._density, UPDATE_S)
        seen = np.eye(2, len(STATES))
        errors = np.zeros(SIZE)
        errors[STATES], innovation = self._filter.update(seen, velocity_mps, np.full(2, VELOCITY_SIGMA_MPS))
        return errors, innovation

    def covariance(self, to_body: Array) -> Array:
        """Return the covariance of all errors (15, 15), biases in body components; `to_body` (3, 3) rotates into them.

        Position and vertical velocity of a vehicle at rest are known.
        """
        whole = np.zeros((SIZE, SIZE))
        whole[np.ix_(STATES, STATES)] = self._filter.covariance
        whole[ACCEL_BIAS.start + UP, ACCEL_BIAS.start + UP] = self._accel_bias_sigma**2
        turn = np.eye(SIZE)
        turn[ACCEL_BIAS, ACCEL_BIAS] = turn[GYRO_BIAS, GYRO_BIAS] = to_body
        return turn @ whole @ turn.T


def align(
    fine: FineAlignment,
    heading_rad: float,
    sensors: InertialSensors,
    duration_s: int,
    rate_hz: float,
    random: np.random.Generator,
) -> Alignment:
    """Align a level vehicle at rest at the filter's position, with sensors that give `rate_hz` increments a second."""
    period_s, each = 1.0 / rate_hz, round(rate_hz * UPDATE_S)
    rest = Trajectory.at_rest(fine.position, heading_rad, UPDATE_S)
    ideal = rest.increments(period_s, 0, each)
    repeated = Increments(*(np.tile(part, (duration_s, 1)) for part in ideal))
    samples = measured(repeated, sensors, period_s, random)
    means = (part[: round(COARSE_S * rate_hz)].mean(axis=0) / period_s for part in samples)
    truth = rest.state(np.array(0.0))
    start = truth._replace(attitude=coarse(*means))
    navigator, bias = Strapdown.at(start), np.zeros(6)
    sigma, error, innovations = list[Array](), list[Array](), list[Array]()
    for first in range(0, len(samples.angle_rad), each):
        navigator.run(samples.part(first, first + each), period_s)
        sway_mps = VELOCITY_SIGMA_MPS * random.standard_normal(2)
        innovation, found = _at_rest(navigator, truth, fine, sway_mps)
        bias += found
        navigator.set_biases(bias)
        innovations.append(innovation)
        sigma.append(fine.sigma_rad)
        error.append(misalignment(navigator.state().attitude, truth.attitude))
    return Alignment(
        times_s=UPDATE_S * np.arange(1, len(sigma) + 1, dtype=np.float64),
        sigma_rad=np.array(sigma),
        error_rad=np.array(error),
        innovations=np.array(innovations),
        bias=bias,
        covariance=fine.covariance(navigator.state().attitude.T),
        coarse_rad=misalignment(start.attitude, truth.attitude),
    )


def _at_rest(navigator: Strapdown, truth: NavigationState, fine: FineAlignment, sway_mps: Array) -> tuple[Array, Array]:
    """Correct a navigator by its zero velocity; return the innovation (2,) and the correction of its biases (6,).

    Position and vertical velocity are set to their known values.
    """
    velocity = np.array(navigator.velocity)
    errors, innovation = fine.update(velocity[:2] - sway_mps)
    errors[VELOCITY.start + UP] = velocity[UP]
    navigator.correct(np.zeros(3), errors[VELOCITY], errors[TILT])
    navigator.lat_rad, navigator.lon_rad = float(truth.lat_rad), float(truth.lon_rad)
    navigator.height_m = float(truth.height_m)
    to_body = navigator.state().attitude.T
    return innovation, np.concatenate((to_body @ errors[ACCEL_BIAS], to_body @ errors[GYRO_BIAS]))
