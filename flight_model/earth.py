"""The Earth: WGS-84's ellipsoid, rotation and normal gravity, positions from an origin, and the density of the air.

Source: NIMA TR8350.2 (WGS-84); Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems (2013), section 2.4; ICAO Doc 7488 (standard atmosphere).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, overload

import numpy as np

from flight_model.arrays import Array
from flight_model.autopilot_model import signed

RATE_RADPS: Final = 7.292115e-5
EQUATOR_MPS2: Final = 9.7803253359
SOMIGLIANA: Final = 1.93185265241e-3
FLATTENING: Final = 1 / 298.257223563
CENTRIFUGAL_RATIO: Final = 3.449786506841e-3
"""Ratio of the centrifugal acceleration at the equator to gravity there."""
SEMI_MAJOR_M: Final = 6_378_137.0
ECCENTRICITY_SQUARED: Final = 6.694379990141317e-3
INVERSION_STEPS: Final = 4
"""Each step reduces the error by the ratio of the distance to the Earth's radius."""
LAPSE_PER_M: Final = 0.0065 / 288.15
"""Lapse rate of the standard atmosphere's troposphere, per metre, as a share of the temperature at sea level."""
DENSITY_POWER: Final = 9.80665 / (287.05287 * 0.0065) - 1.0
"""Exponent that gives the ratio of densities from that of temperatures there."""
TROPOPAUSE_M: Final = 11_000.0
SEA_LEVEL_KGM3: Final = 1.225


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
    if not isinstance(lat_rad, np.ndarray):
        return _radii_m(lat_rad)
    squeeze = 1.0 - ECCENTRICITY_SQUARED * np.sin(lat_rad) ** 2
    across_m = SEMI_MAJOR_M / np.sqrt(squeeze)
    return across_m * (1.0 - ECCENTRICITY_SQUARED) / squeeze, across_m


def _radii_m(lat_rad: float) -> tuple[float, float]:
    """Return the same at one latitude, for compiled callers, to which overloads and arrays cost time."""
    sine = math.sin(lat_rad)
    squeeze = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    across_m = SEMI_MAJOR_M / math.sqrt(squeeze)
    return across_m * (1.0 - ECCENTRICITY_SQUARED) / squeeze, across_m


def true_by_equivalent_airspeed(above_sea_m: float) -> float:
    """Return the ratio of true airspeed to equivalent airspeed in the standard atmosphere, up to the tropopause.

    Equivalent airspeed is the airspeed with the same dynamic pressure at sea level.
    """
    colder: float = 1.0 - LAPSE_PER_M * min(above_sea_m, TROPOPAUSE_M)
    return math.pow(colder, -0.5 * DENSITY_POWER)


def air_density_kgm3(above_sea_m: float) -> float:
    """Return the density of the air in the standard atmosphere, kg/m³, up to the tropopause."""
    ratio = true_by_equivalent_airspeed(above_sea_m)
    return SEA_LEVEL_KGM3 / (ratio * ratio)


@dataclass(frozen=True)
class GeodeticOrigin:
    """The origin of NED positions: radians, and metres above sea level.

    North is the arc of the meridian and east that of the parallel, with the radii of curvature at the latitude
    halfway to the origin. Below 70 degrees of latitude and up to 10 km away, distances from the origin are accurate to
    a millimetre per kilometre. Distances between two other points are stretched: from east to west by 0.2 mm per metre
    3 km north of the origin, and by 1.1 mm per metre 20 km north of it.
    """

    lat_rad: float
    lon_rad: float
    alt_m: float

    def to_ned(self, lat_rad: float, lon_rad: float, alt_m: float) -> tuple[float, float, float]:
        """Return north, east and down in m."""
        halfway_rad = (lat_rad + self.lat_rad) / 2
        meridian_m, across_m = _radii_m(halfway_rad)
        east_m = signed(lon_rad - self.lon_rad) * (across_m * math.cos(halfway_rad))
        return (lat_rad - self.lat_rad) * meridian_m, east_m, self.alt_m - alt_m

    def from_ned(self, north_m: float, east_m: float, down_m: float) -> tuple[float, float, float]:
        """Return latitude, longitude (radians, -pi to pi) and altitude: the inverse of `to_ned`."""
        lat_rad = halfway_rad = self.lat_rad
        meridian_m, across_m = _radii_m(halfway_rad)
        for _step in range(INVERSION_STEPS):
            before_rad = lat_rad
            lat_rad = self.lat_rad + north_m / meridian_m
            if lat_rad == before_rad:
                break
            halfway_rad = (lat_rad + self.lat_rad) / 2
            meridian_m, across_m = _radii_m(halfway_rad)
        lon_rad = self.lon_rad + east_m / (across_m * math.cos(halfway_rad))
        return lat_rad, signed(lon_rad), self.alt_m - down_m

    def positions(self, north_m: Array, east_m: Array) -> tuple[Array, Array]:
        """Return latitudes and longitudes, rad, of many points: `from_ned` for arrays of one shape."""
        lat_rad = np.full_like(north_m, self.lat_rad)
        for _ in range(INVERSION_STEPS):
            lat_rad = self.lat_rad + north_m / radii_m((lat_rad + self.lat_rad) / 2)[0]
        halfway_rad = (lat_rad + self.lat_rad) / 2
        return lat_rad, self.lon_rad + east_m / (radii_m(halfway_rad)[1] * np.cos(halfway_rad))
