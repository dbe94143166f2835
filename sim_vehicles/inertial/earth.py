"""The Earth as navigation needs it: WGS-84's ellipsoid, rotation and normal gravity.

Source: NIMA TR8350.2 (WGS-84); Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems (2013), section 2.4.
"""

from __future__ import annotations

import math
from typing import Final, overload

import numpy as np

from airlink.geodesy import ECCENTRICITY_SQUARED, SEMI_MAJOR_M
from formation_scenario.arrays import Array

RATE_RADPS: Final = 7.292115e-5
EQUATOR_MPS2: Final = 9.7803253359
SOMIGLIANA: Final = 1.93185265241e-3
FLATTENING: Final = 1 / 298.257223563
CENTRIFUGAL_RATIO: Final = 3.449786506841e-3
"""Centrifugal acceleration at the equator by gravity there."""


@overload
def gravity_mps2(lat_rad: float, height_m: float) -> float: ...
@overload
def gravity_mps2(lat_rad: Array, height_m: Array) -> Array: ...
def gravity_mps2(lat_rad: float | Array, height_m: float | Array) -> float | Array:
    """Return normal gravity, positive downwards, at a latitude and a height above the ellipsoid."""
    squared = np.sin(lat_rad) ** 2 if isinstance(lat_rad, np.ndarray) else math.sin(lat_rad) ** 2
    surface = EQUATOR_MPS2 * (1.0 + SOMIGLIANA * squared) / (1.0 - ECCENTRICITY_SQUARED * squared) ** 0.5
    first = 2.0 / SEMI_MAJOR_M * (1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * squared)
    return surface * (1.0 - first * height_m + 3.0 * (height_m / SEMI_MAJOR_M) ** 2)


@overload
def radii_m(lat_rad: float) -> tuple[float, float]: ...
@overload
def radii_m(lat_rad: Array) -> tuple[Array, Array]: ...
def radii_m(lat_rad: float | Array) -> tuple[float | Array, float | Array]:
    """Return the radii of curvature along the meridian and across it (in the prime vertical)."""
    sine = np.sin(lat_rad) if isinstance(lat_rad, np.ndarray) else math.sin(lat_rad)
    squeeze = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    across_m = SEMI_MAJOR_M / squeeze**0.5
    return across_m * (1.0 - ECCENTRICITY_SQUARED) / squeeze, across_m
