"""What the station's filter leaves of the telemetry's noise.

The law sees states that went through a Kalman filter by model (7), which averages noise over many samples: what it
moves them by from tick to tick is a small part of a sample's. Source: Gelb, "Applied Optimal Estimation" (1974), 4.4.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flight_model.arrays import Array

UNMODELLED: Final[tuple[float, float, float]] = (0.05, 0.05, 0.003)
"""How far climb, airspeed (m/s) and heading (rad) of a vehicle are taken to stray from model (7) in a square root
of a second."""
WIND_WALK: Final = 0.02
"""The same of the wind without gusts, m/s."""
SAMPLES = 400
"""After which the filter's gain is taken for its steady one, and its answer to one sample for over."""
SEEN = np.array(((1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 0.0)))
"""Position, velocity over ground and airspeed by the states: position, airspeed and wind."""


def left_by_filter(
    sample: tuple[float, float, float], walk_mps: float, lag_s: float, period_s: float
) -> tuple[float, float]:
    """Return the noise along one axis that the filter leaves of position (m) and airspeed (m/s).

    They are the standard deviations of white noise that would move them as much from one sample to the next.

    Args:
        sample: standard deviations of a sample's position (m), velocity over ground and airspeed (m/s), all above 0.
        walk_mps: how far the airspeed strays from its model in a square root of a second.
        lag_s: the airspeed's time constant.
        period_s: from one sample to the next.
    """
    kept = math.exp(-period_s / lag_s)
    carry = np.array(((1.0, lag_s * (1.0 - kept), period_s), (0.0, kept, 0.0), (0.0, 0.0, 1.0)))
    variances: Array = np.square(sample)
    covariance, gain = np.diag(variances), np.zeros((3, 3))
    for _ in range(SAMPLES):
        covariance = carry @ covariance @ carry.T + period_s * np.diag((0.0, walk_mps**2, WIND_WALK**2))
        gain = np.linalg.solve(SEEN @ covariance @ SEEN.T + np.diag(variances), SEEN @ covariance).T
        covariance -= gain @ SEEN @ covariance
    answer, before, squares = gain, np.zeros((3, 3)), np.zeros((3, 3))
    for _ in range(SAMPLES):
        squares += np.square(answer - before)
        before, answer = answer, carry @ answer - gain @ (SEEN @ (carry @ answer))
    position_m, airspeed_mps, _ = np.sqrt(squares @ variances / 2.0).tolist()
    return position_m, airspeed_mps
