"""Array types, and angles on arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

TURN = 2 * np.pi


def wrap(angle_rad: Array) -> Array:
    """Return each angle as its equal in [-pi, pi)."""
    return (angle_rad + np.pi) % TURN - np.pi
