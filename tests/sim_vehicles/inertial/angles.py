"""Angles of an attitude, for assertions."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array


def angles(matrix: Array) -> Array:
    """Return heading, pitch and bank (..., 3) of body to navigation matrices (..., 3, 3)."""
    heading = np.arctan2(matrix[..., 0, 1], matrix[..., 1, 1])
    pitch = np.arcsin(np.clip(matrix[..., 2, 1], -1.0, 1.0))
    bank = np.arctan2(-matrix[..., 2, 0], matrix[..., 2, 2])
    return np.stack((heading, pitch, bank), axis=-1)
