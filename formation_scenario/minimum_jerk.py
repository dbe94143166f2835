"""The minimum-jerk step: the quintic from 0 to 1 that begins and ends at rest.

Source: Flash and Hogan, "The coordination of arm movements", J. Neuroscience 5 (1985).
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T", float, npt.NDArray[np.float64])

PEAK_RATE = 1.875
"""Largest first derivative, at u = 1/2."""
PEAK_CHANGE = 5.77
"""Largest second derivative, 10 / sqrt(3)."""
PEAK_JERK = 60.0
"""Largest third derivative, at both ends."""


def minimum_jerk(u: T) -> tuple[T, T, T]:
    """Return the step at u, 0 to 1, and its first two derivatives by u."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)
