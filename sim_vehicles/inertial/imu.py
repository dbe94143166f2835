"""Inertial sensors: measurements of ideal ones along a true motion, and errors of real ones.

Source: Groves (2013), sections 2.2 and 5.3 to 5.5, inverted: specific force and angular rate from the derivatives of
position and attitude. Angles: heading clockwise from north, pitch upwards, bank to the right. A matrix rotates body
components (right, forward, up) into navigation components (east, north, up).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple, Self, cast

import numpy as np

from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from flight_model.earth import ECCENTRICITY_SQUARED, RATE_RADPS, GeodeticOrigin, gravity_mps2, radii_m
from flight_model.energy import GRAVITY_MPS2
from flight_model.path import FlightPath
from formation_scenario.navigation import InertialNavigation

KNOT_S = 1.0
"""Spacing of the splines' knots. Degree 5 makes rates and forces smooth enough to integrate."""
DEGREE = 5
GAUSS_POINTS = 4
DEGREE_PER_HOUR: Final = math.radians(1.0) / 3600.0
LAT, LON, HEIGHT, HEADING, PITCH, BANK = range(6)


class NavigationState(NamedTuple):
    """Position and motion over the ellipsoid at one or more instants, (...): rad, m, m/s."""

    lat_rad: Array
    lon_rad: Array
    height_m: Array
    velocity_mps: Array
    """East, north and up, (..., 3)."""
    attitude: Array
    """Body to navigation matrices, (..., 3, 3)."""


class Increments(NamedTuple):
    """Measurements of inertial sensors: integrals over N successive intervals, body components, (N, 3)."""

    angle_rad: Array
    velocity_mps: Array

    def part(self, first: int, end: int) -> Increments:
        """Return the increments of intervals `first` to `end` - 1."""
        return Increments(self.angle_rad[first:end], self.velocity_mps[first:end])


def attitude(heading_rad: Array, pitch_rad: Array, bank_rad: Array) -> Array:
    """Return the body to navigation matrices (..., 3, 3) of angles (...)."""
    sin_h, cos_h, sin_p, cos_p = np.sin(heading_rad), np.cos(heading_rad), np.sin(pitch_rad), np.cos(pitch_rad)
    sin_b, cos_b = np.sin(bank_rad), np.cos(bank_rad)
    rows = (
        (cos_h * cos_b + sin_h * sin_p * sin_b, sin_h * cos_p, cos_h * sin_b - sin_h * sin_p * cos_b),
        (-sin_h * cos_b + cos_h * sin_p * sin_b, cos_h * cos_p, -sin_h * sin_b - cos_h * sin_p * cos_b),
        (-cos_p * sin_b, sin_p, cos_p * cos_b),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def misalignment(computed: Array, true: Array) -> Array:
    """Return the small rotation phi (..., 3) of a computed matrix: computed = (I - [phi x]) true."""
    off = computed @ np.swapaxes(true, -1, -2)
    skew = (np.swapaxes(off, -1, -2) - off) / 2.0
    return np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), axis=-1)


class Trajectory:
    """Latitude, longitude, height, heading, pitch and bank as splines of time."""

    def __init__(self, times_s: Array, rows: Array, duration_s: float) -> None:
        """Take the six values (N, 6) at N >= 6 equidistant times from 0, and the duration of the flight."""
        import scipy  # noqa: PLC0415 - only navigation by inertia has splines of its motion

        self.duration_s = duration_s
        self._first = rows[0].copy()
        # Differences from the start keep digits that would be lost to the Earth's radius.
        self._spline = cast(
            "Callable[..., Array]", scipy.interpolate.make_interp_spline(times_s, rows - self._first, k=DEGREE)
        )

    @classmethod
    def at_rest(cls, origin: GeodeticOrigin, heading_rad: float, duration_s: float) -> Self:
        """Return a level vehicle at rest at an origin."""
        times_s = _knots(duration_s)
        row = (origin.lat_rad, origin.lon_rad, origin.alt_m, heading_rad, 0.0, 0.0)
        return cls(times_s, np.tile(row, (times_s.size, 1)), duration_s)

    @classmethod
    def along(cls, path: FlightPath, speed_mps: float, origin: GeodeticOrigin, duration_s: float) -> Self:
        """Return the flight along a path at a horizontal speed, with the heading along it and coordinated turns."""
        times_s = _knots(duration_s)
        points = path.at(speed_mps * times_s)
        lat_rad, lon_rad = origin.positions(points.north_m, points.east_m)
        gravity = gravity_mps2(lat_rad, points.height_m)
        bank_rad = np.arctan(speed_mps**2 * points.curvature_1pm / gravity)
        height_m, heading_rad = origin.alt_m + points.height_m, np.unwrap(points.course_rad)
        columns = lat_rad, lon_rad, height_m, heading_rad, np.arctan(points.slope), bank_rad
        return cls(times_s, np.stack(columns, axis=1), duration_s)

    def state(self, times_s: Array) -> NavigationState:
        """Return the true state at times (...)."""
        values, rates = self._values(times_s), self._spline(times_s, 1)
        lat_rad, lon_rad, height_m, *angles = np.moveaxis(values, -1, 0)
        return NavigationState(lat_rad, lon_rad, height_m, _velocity(values, rates), attitude(*angles))

    def increments(self, period_s: float, first: int, end: int) -> Increments:
        """Return increments of ideal sensors over intervals `first` to `end` - 1 of `period_s`, by Gauss quadrature."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        times_s = (np.arange(first, end)[:, None] + (1.0 + nodes) / 2.0) * period_s
        rate, force = self._sensed(times_s)
        shares = weights * period_s / 2.0
        return Increments(np.einsum("ijk,j->ik", rate, shares), np.einsum("ijk,j->ik", force, shares))

    def _values(self, times_s: Array) -> Array:
        return self._spline(times_s) + self._first

    def _sensed(self, times_s: Array) -> tuple[Array, Array]:
        """Return the angular rate against inertial space and the specific force, body components (..., 3)."""
        values, rates, changes = self._values(times_s), self._spline(times_s, 1), self._spline(times_s, 2)
        to_body = np.swapaxes(attitude(*np.moveaxis(values[..., HEADING:], -1, 0)), -1, -2)
        velocity, acceleration = _velocity(values, rates), _acceleration(values, rates, changes)
        lat_rad = values[..., LAT]
        earth = RATE_RADPS * np.stack((np.zeros_like(lat_rad), np.cos(lat_rad), np.sin(lat_rad)), axis=-1)
        transport = _transport_rate(values, velocity)
        rate = _body_rate(values, rates) + _apply(to_body, earth + transport)
        force = acceleration + np.cross(2.0 * earth + transport, velocity)
        force[..., 2] += gravity_mps2(values[..., LAT], values[..., HEIGHT])
        return rate, _apply(to_body, force)


def _knots(duration_s: float) -> Array:
    return KNOT_S * np.arange(max(DEGREE, math.ceil(duration_s / KNOT_S)) + 1, dtype=np.float64)


def _apply(matrices: Array, vectors: Array) -> Array:
    return np.einsum("...ij,...j->...i", matrices, vectors)


def _metres_per_radian(values: Array) -> tuple[Array, Array, Array]:
    """Return metres per radian of latitude and of longitude, and the cosine of the latitude."""
    meridian_m, across_m = radii_m(values[..., LAT])
    cosine = np.cos(values[..., LAT])
    return meridian_m + values[..., HEIGHT], (across_m + values[..., HEIGHT]) * cosine, cosine


def _velocity(values: Array, rates: Array) -> Array:
    """Return the velocity east, north and up (..., 3)."""
    north_m, east_m, _ = _metres_per_radian(values)
    return np.stack((east_m * rates[..., LON], north_m * rates[..., LAT], rates[..., HEIGHT]), axis=-1)


def _acceleration(values: Array, rates: Array, changes: Array) -> Array:
    """Return the velocity's rate of change, east, north and up (..., 3)."""
    north_m, east_m, cosine = _metres_per_radian(values)
    sine = np.sin(values[..., LAT])
    meridian_m, across_m = radii_m(values[..., LAT])
    turn, spin, climb = np.moveaxis(rates[..., :HEADING], -1, 0)
    bend = ECCENTRICITY_SQUARED * sine * cosine / (1.0 - ECCENTRICITY_SQUARED * sine**2) * turn
    north_rate = 3.0 * meridian_m * bend + climb
    east_rate = (across_m * bend + climb) * cosine - (across_m + values[..., HEIGHT]) * sine * turn
    north, east = north_m * changes[..., LAT] + north_rate * turn, east_m * changes[..., LON] + east_rate * spin
    return np.stack((east, north, changes[..., HEIGHT]), axis=-1)


def _transport_rate(values: Array, velocity: Array) -> Array:
    north_m, east_m, cosine = _metres_per_radian(values)
    eastward = velocity[..., 0] / (east_m / cosine)
    return np.stack((-velocity[..., 1] / north_m, eastward, eastward * np.tan(values[..., LAT])), axis=-1)


def _body_rate(values: Array, rates: Array) -> Array:
    """Return the body's rate against the navigation frame, body components (..., 3)."""
    sin_p, cos_p = np.sin(values[..., PITCH]), np.cos(values[..., PITCH])
    sin_b, cos_b = np.sin(values[..., BANK]), np.cos(values[..., BANK])
    heading, pitch, bank = np.moveaxis(rates[..., HEADING:], -1, 0)
    right, forward = pitch * cos_b + heading * cos_p * sin_b, bank - heading * sin_p
    return np.stack((right, forward, pitch * sin_b - heading * cos_p * cos_b), axis=-1)


@dataclass(frozen=True)
class InertialSensors:
    """Three accelerometers and three gyroscopes along the body's axes, in SI units."""

    accel_bias_mps2: tuple[float, float, float]
    gyro_bias_radps: tuple[float, float, float]
    accel_noise: float
    """Square root of the white noise's density, (m/s²)/sqrt(Hz): the velocity random walk, m/s per root second."""
    gyro_noise: float
    """The same, (rad/s)/sqrt(Hz): the angle random walk."""
    drawn_with: tuple[float, float] | None = None
    """Standard deviations with which random biases were drawn, m/s² and rad/s; None: biases are given."""

    @property
    def accel_bias_sigma(self) -> float:
        """Standard deviation of a bias that filters assume, m/s²; for given biases their root mean square."""
        return self.drawn_with[0] if self.drawn_with else _root_mean_square(self.accel_bias_mps2)

    @property
    def gyro_bias_sigma(self) -> float:
        """The same for the gyroscopes, rad/s."""
        return self.drawn_with[1] if self.drawn_with else _root_mean_square(self.gyro_bias_radps)

    def drawn(self, random: np.random.Generator) -> InertialSensors:
        """Return such sensors with biases drawn as filters assume them: normal and independent."""
        sigmas = self.accel_bias_sigma, self.gyro_bias_sigma
        (a, b, c), (d, e, f) = (np.array(sigmas)[:, None] * random.standard_normal((2, 3))).tolist()
        return InertialSensors((a, b, c), (d, e, f), self.accel_noise, self.gyro_noise, sigmas)


def _root_mean_square(biases: tuple[float, float, float]) -> float:
    return math.sqrt(sum(each**2 for each in biases) / 3.0)


def inertial_sensors(keys: InertialNavigation, seed: int, vehicle: VehicleId) -> InertialSensors:
    """Return a vehicle's sensors in SI units, from complete keys of the resolved scenario."""
    given = keys.sensors
    sensors = InertialSensors(
        accel_bias_mps2=_axes(given.accel_bias_ug, 1e-6 * GRAVITY_MPS2),
        gyro_bias_radps=_axes(given.gyro_bias_deg_per_h, DEGREE_PER_HOUR),
        accel_noise=1e-6 * GRAVITY_MPS2 * (given.accel_noise_ug_per_rthz or 0.0),
        gyro_noise=math.radians(given.gyro_noise_deg_per_rth or 0.0) / 60.0,
    )
    return sensors.drawn(random_stream(seed, "biases", *vehicle)) if keys.biases == "random" else sensors


def _axes(value: float | tuple[float, float, float] | None, unit: float) -> tuple[float, float, float]:
    x, y, z = value if isinstance(value, tuple) else (value or 0.0,) * 3
    return x * unit, y * unit, z * unit


def measured(ideal: Increments, sensors: InertialSensors, period_s: float, random: np.random.Generator) -> Increments:
    """Return the increments that these sensors measure instead of `ideal`, over intervals of `period_s`."""
    root_s, walks = math.sqrt(period_s), [random.standard_normal(ideal.angle_rad.shape) for _ in range(2)]
    angle = np.multiply(sensors.gyro_bias_radps, period_s) + sensors.gyro_noise * root_s * walks[0]
    change = np.multiply(sensors.accel_bias_mps2, period_s) + sensors.accel_noise * root_s * walks[1]
    return Increments(ideal.angle_rad + angle, ideal.velocity_mps + change)
