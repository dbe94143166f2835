"""Strap-down navigation: position, velocity and attitude from increments of angle and velocity.

Sources: Savage, Strapdown Inertial Navigation Integration Algorithm Design, J. Guidance, Control, and Dynamics 21
(1998): two-sample coning and sculling; Groves (2013), section 5.5.
"""

from __future__ import annotations

import math
from typing import Self, TypeAlias, cast

import numpy as np

from flight_model.arrays import Array
from flight_model.earth import RATE_RADPS, gravity_mps2, radii_m
from sim_vehicles.inertial.imu import Increments, NavigationState

TWO_THIRDS = 2.0 / 3.0
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
"""Scalar first; rotates body components into navigation components."""


class Strapdown:
    """A navigation computer that starts from a state and integrates pairs of increments."""

    def __init__(self, lat_rad: float, lon_rad: float, height_m: float, velocity: Vector, attitude: Quaternion) -> None:
        """Start from a state; `velocity` is east, north and up in m/s."""
        self.lat_rad, self.lon_rad, self.height_m = lat_rad, lon_rad, height_m
        self.velocity, self.attitude = velocity, attitude
        self._accel_bias: Vector = (0.0, 0.0, 0.0)
        self._gyro_bias: Vector = (0.0, 0.0, 0.0)
        self._change: Vector = (0.0, 0.0, 0.0)

    @classmethod
    def at(cls, state: NavigationState) -> Self:
        """Return a computer that starts from a state at a single instant."""
        east, north, up = state.velocity_mps.tolist()
        position = float(state.lat_rad), float(state.lon_rad), float(state.height_m)
        return cls(*position, (east, north, up), to_quaternion(state.attitude))

    def run(self, samples: Increments, period_s: float) -> None:
        """Integrate an even number of samples of `period_s` each."""
        angles, changes = (cast("list[Vector]", part.tolist()) for part in samples)
        for i in range(0, len(angles), 2):
            self.advance((angles[i], angles[i + 1]), (changes[i], changes[i + 1]), 2.0 * period_s)

    def advance(self, angles: tuple[Vector, Vector], changes: tuple[Vector, Vector], period_s: float) -> None:
        """Integrate two successive intervals of `period_s` / 2 each: increments of angle, rad, and velocity, m/s."""
        half_s = period_s / 2.0
        first, second = (_less(each, self._gyro_bias, half_s) for each in angles)
        push, more = (_less(each, self._accel_bias, half_s) for each in changes)
        middle = _sum(self.velocity, self._change, 0.5)
        earth, transport = self._rates(middle)
        rotation = _sum((0.0, 0.0, 0.0), _sum(earth, transport, 1.0), period_s)
        before = self.velocity
        gained = self._gained(first, second, push, more, rotation)
        coriolis = cross(_sum(transport, earth, 2.0), middle)
        gravity = gravity_mps2(self.lat_rad, self.height_m + before[2] * half_s)
        change = (
            gained[0] - coriolis[0] * period_s,
            gained[1] - coriolis[1] * period_s,
            gained[2] - (coriolis[2] + gravity) * period_s,
        )
        self.velocity, self._change = _sum(before, change, 1.0), change
        self._move(_sum(before, change, 0.5), period_s)
        coning = cross(first, second)
        turn = _sum(_sum(first, second, 1.0), coning, TWO_THIRDS)
        back = of_vector((-rotation[0], -rotation[1], -rotation[2]))
        self.attitude = normalised(product(back, product(self.attitude, of_vector(turn))))

    def correct(self, position_m: Array, velocity_mps: Array, misalignment_rad: Array) -> None:
        """Subtract estimated errors (3,) of position in m and velocity, east, north and up, and of the attitude."""
        meridian_m, across_m = radii_m(self.lat_rad)
        east, north, up = position_m.tolist()
        self.lon_rad -= east / ((across_m + self.height_m) * math.cos(self.lat_rad))
        self.lat_rad -= north / (meridian_m + self.height_m)
        self.height_m -= up
        a, b, c = velocity_mps.tolist()
        self.velocity = (self.velocity[0] - a, self.velocity[1] - b, self.velocity[2] - c)
        x, y, z = misalignment_rad.tolist()
        self.attitude = normalised(product(of_vector((x, y, z)), self.attitude))

    def set_biases(self, biases: Array) -> None:
        """Set the biases (6,), accelerometers' and gyroscopes', to subtract from all later increments."""
        a, b, c, x, y, z = biases.tolist()
        self._accel_bias, self._gyro_bias = (a, b, c), (x, y, z)

    def state(self) -> NavigationState:
        """Return the computed state."""
        lat_rad, lon_rad, height_m = (np.array(each) for each in (self.lat_rad, self.lon_rad, self.height_m))
        return NavigationState(lat_rad, lon_rad, height_m, np.array(self.velocity), to_matrix(self.attitude))

    def _rates(self, velocity: Vector) -> tuple[Vector, Vector]:
        """Return the Earth's rate and the transport rate, rad/s."""
        meridian_m, across_m = radii_m(self.lat_rad)
        sine, cosine = math.sin(self.lat_rad), math.cos(self.lat_rad)
        eastward = velocity[0] / (across_m + self.height_m)
        earth = (0.0, RATE_RADPS * cosine, RATE_RADPS * sine)
        return earth, (-velocity[1] / (meridian_m + self.height_m), eastward, eastward * sine / cosine)

    def _gained(self, first: Vector, second: Vector, push: Vector, more: Vector, rotation: Vector) -> Vector:
        """Return the velocity gained by specific force, in the navigation frame midway through its own rotation."""
        whole, angle = _sum(push, more, 1.0), _sum(first, second, 1.0)
        turning = cross(angle, whole)
        sculling = _sum(cross(first, more), cross(push, second), 1.0)
        body = _sum(_sum(whole, turning, 0.5), sculling, TWO_THIRDS)
        gained = turned(self.attitude, body)
        return _sum(gained, cross(rotation, gained), -0.5)

    def _move(self, velocity: Vector, period_s: float) -> None:
        meridian_m, across_m = radii_m(self.lat_rad)
        height_m = self.height_m + velocity[2] * period_s / 2.0
        lat_rad = self.lat_rad + velocity[1] * period_s / (meridian_m + height_m)
        cosine = math.cos((self.lat_rad + lat_rad) / 2.0)
        self.lon_rad += velocity[0] * period_s / ((across_m + height_m) * cosine)
        self.lat_rad = lat_rad
        self.height_m += velocity[2] * period_s


def _sum(a: Vector, b: Vector, share: float) -> Vector:
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


def _less(increment: Vector, bias: Vector, period_s: float) -> Vector:
    return _sum(increment, bias, -period_s)


def to_matrix(q: Quaternion) -> Array:
    """Return a quaternion's matrix (3, 3)."""
    w, x, y, z = q
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def to_quaternion(matrix: Array) -> Quaternion:
    """Return a matrix's quaternion, by its largest component (Shepperd's method)."""
    m: list[list[float]] = matrix.tolist()
    squares = (
        1.0 + m[0][0] + m[1][1] + m[2][2],
        1.0 + m[0][0] - m[1][1] - m[2][2],
        1.0 - m[0][0] + m[1][1] - m[2][2],
        1.0 - m[0][0] - m[1][1] + m[2][2],
    )
    largest = max(range(4), key=lambda i: squares[i])
    root = math.sqrt(squares[largest])
    x, y, z = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    xy, xz, yz = m[1][0] + m[0][1], m[2][0] + m[0][2], m[2][1] + m[1][2]
    parts = ((squares[0], x, y, z), (x, squares[1], xy, xz), (y, xy, squares[2], yz), (z, xz, yz, squares[3]))[largest]
    return normalised(tuple(part / (2.0 * root) for part in parts))


def of_vector(rotation: Vector) -> Quaternion:
    """Return the quaternion of a rotation vector in rad."""
    x, y, z = rotation
    square = x * x + y * y + z * z
    if square < 1e-8:  # here the series is exact to the last bit
        scale, w = 0.5 - square / 48.0, 1.0 - square / 8.0 + square * square / 384.0
    else:
        size = math.sqrt(square)
        scale, w = math.sin(size / 2.0) / size, math.cos(size / 2.0)
    return w, x * scale, y * scale, z * scale


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the quaternion of the rotation b followed by a."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def normalised(q: tuple[float, ...]) -> Quaternion:
    """Return a quaternion of length 1."""
    size = math.sqrt(sum(part * part for part in q))
    w, x, y, z = (part / size for part in q)
    return w, x, y, z


def turned(q: Quaternion, v: Vector) -> Vector:
    """Return a body vector in navigation components."""
    w, x, y, z = q
    a, b, c = v
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def displaced(true: Array, misalignment_rad: Array) -> Array:
    """Return the matrix (3, 3) with a misalignment (3,): the inverse of `misalignment`."""
    x, y, z = (-misalignment_rad).tolist()
    return to_matrix(of_vector((x, y, z))) @ true
