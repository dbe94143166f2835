"""Rotations: matrices for arrays of samples, quaternions of plain floats for single ones.

Angles: heading clockwise from north, pitch upwards, bank to the right. A matrix rotates body components (right,
forward, up) into navigation components (east, north, up).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from flight_model.arrays import Array

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
"""Scalar first; rotates body components into navigation components."""


def attitude(heading_rad: Array, pitch_rad: Array, bank_rad: Array) -> Array:
    """Return body to navigation matrices (..., 3, 3) of angles (...)."""
    sin_h, cos_h, sin_p, cos_p = np.sin(heading_rad), np.cos(heading_rad), np.sin(pitch_rad), np.cos(pitch_rad)
    sin_b, cos_b = np.sin(bank_rad), np.cos(bank_rad)
    rows = (
        (cos_h * cos_b + sin_h * sin_p * sin_b, sin_h * cos_p, cos_h * sin_b - sin_h * sin_p * cos_b),
        (-sin_h * cos_b + cos_h * sin_p * sin_b, cos_h * cos_p, -sin_h * sin_b - cos_h * sin_p * cos_b),
        (-cos_p * sin_b, sin_p, cos_p * cos_b),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def misalignment(computed: Array, true: Array) -> Array:
    """Return the small rotation phi (..., 3) by which a computed matrix is off: computed = (I - [phi x]) true."""
    off = computed @ np.swapaxes(true, -1, -2)
    skew = (np.swapaxes(off, -1, -2) - off) / 2.0
    return np.stack((skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]), axis=-1)


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
    if square < 1e-8:  # the series is exact to the last bit there
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
    """Return the matrix (3, 3) that is off by a misalignment (3,): the inverse of `misalignment`."""
    x, y, z = (-misalignment_rad).tolist()
    return to_matrix(of_vector((x, y, z))) @ true
