"""Intensity and scale lengths of turbulence at low altitude.

Source: MIL-F-8785C (1980), section 3.7.3.4.
"""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array

FOOT_M = 0.3048
LOWEST_FT, HIGHEST_FT = 10.0, 1000.0
"""Heights for which the formulas hold; other heights are clipped to these."""


def low_altitude_turbulence(wind_6m_mps: float, height_m: Array) -> tuple[Array, Array]:
    """Return rms velocities, m/s, and scale lengths, m, forward, right and down at heights (N,) above ground: (3, N).

    With h in feet: L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2, sigma_w = 0.1 W_20,
    sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4.

    Args:
        wind_6m_mps: W_20, the mean wind 6 m (20 ft) above ground.
        height_m: heights above ground.
    """
    height_ft = np.clip(height_m / FOOT_M, LOWEST_FT, HIGHEST_FT)
    shape = 0.177 + 0.000823 * height_ft
    across_ft, down_mps = height_ft / shape**1.2, np.full_like(height_ft, 0.1 * wind_6m_mps)
    across_mps = down_mps / shape**0.4
    return np.stack((across_mps, across_mps, down_mps)), FOOT_M * np.stack((across_ft, across_ft, height_ft))
