"""How much faster an aircraft flies than its airspeed sensor reads.

Autopilots tell, and are told, what the sensor reads: equivalent airspeed, if it is calibrated. In thin air the aircraft
flies faster than that, by 8 % at 1600 m. Taken for true airspeed, readings show a wind that turns with the aircraft.

The readings' scale is learnt from the wind triangle, which a turn tells from wind: velocity over ground is wind, plus
the scaled reading along the heading. Linear in wind and scale, it takes a Kalman filter of three states.

Source: Cho, Kim, Lee, Kee, "Wind Estimation and Airspeed Calibration using a UAV with a Single-Antenna GPS Receiver and
Pitot Tube", IEEE Transactions on Aerospace and Electronic Systems 47 (2011).
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import squared, within
from flight_model.earth import true_by_equivalent_airspeed

SCALE_SIGMA: Final = 0.08
"""Standard deviation of a sensor's scale about 1 before anything is learnt."""
SCALE_WALK: Final = 2e-4
"""How far the scale strays in a square root of a second."""
SCALES: Final = (0.75, 1.35)
"""A scale beyond these isn't believed, whatever flies."""
WIND_SIGMA_MPS: Final = 15.0
WIND_WALK_MPS: Final = 0.1
"""How far each component of the wind strays in a square root of a second."""
TRIANGLE_SIGMA_MPS: Final = 3.0
"""By how much a wind triangle is off: gusts, slip, and lags of what is measured. Gusts of 0.7 m/s that last for 10 s
make each of the triangles in that time as wrong as the others, so that each says no more than one of this error."""
PERIOD_S: Final = 0.5
GAP_S: Final = 10.0
"""After a longer one the wind may be any."""
LEAST_MPS: Final = 5.0
"""Slower aircraft show no scale."""
LIMITS_STEP: Final = 0.005
"""By how much the ratio differs before limits of airspeed follow it."""


class AirspeedScale:
    """One aircraft's."""

    def __init__(self, field_m: float, slowest_mps: float, fastest_mps: float) -> None:
        """Start with a calibrated sensor, `field_m` above sea level; readings told are between the two limits."""
        self.ratio = true_by_equivalent_airspeed(field_m)
        """True airspeed by what the sensor reads, where it flies now."""
        self._slowest_mps, self._fastest_mps = slowest_mps, fastest_mps
        self._limited_by = self.ratio
        self._stamp_s = math.nan
        self._states = [0.0, 0.0, 1.0]
        """Wind north and east, m/s, and the scale: true airspeed by what a calibrated sensor would make of it."""
        self._covariance = [[0.0] * 3 for _ in range(3)]
        self._covariance[2][2] = squared(SCALE_SIGMA)

    @property
    def scale(self) -> float:
        """True airspeed by what it would be if the sensor were calibrated."""
        return self._states[2]

    @property
    def scale_sigma(self) -> float:
        """Standard deviation of the scale."""
        return math.sqrt(self._covariance[2][2])

    @property
    def speeds_mps(self) -> tuple[float, float]:
        """The least and the highest true airspeed: readings within their limits, and none faster than those."""
        ratio = self._limited_by
        return self._slowest_mps * max(1.0, ratio), self._fastest_mps * min(1.0, ratio)

    def true(self, reading_mps: float) -> float:
        """Return the true airspeed of a reading."""
        return self.ratio * reading_mps

    def reading(self, true_mps: float) -> float:
        """Return what to tell the aircraft for a true airspeed: a reading within the limits."""
        return within(true_mps / self.ratio, self._slowest_mps, self._fastest_mps)

    def learn(
        self,
        stamp_s: float,
        above_sea_m: float,
        velocity_mps: tuple[float, float, float],
        reading_mps: float,
        heading_rad: float,
    ) -> None:
        """Take a wind triangle of an aircraft in the air.

        Args:
            stamp_s: when it was measured, by the vehicle's clock.
            above_sea_m: the height.
            velocity_mps: over ground: north, east and up.
            reading_mps: what the sensor reads.
            heading_rad: of the nose.
        """
        by_density = true_by_equivalent_airspeed(above_sea_m)
        apart_s = stamp_s - self._stamp_s
        if not 0.0 <= apart_s < PERIOD_S and reading_mps >= LEAST_MPS:
            self._stamp_s = stamp_s
            self._stray(apart_s)
            north_mps, east_mps, climb_mps = velocity_mps
            level_mps = math.sqrt(max(squared(by_density * reading_mps) - squared(climb_mps), 0.0))
            self._see((1.0, 0.0, level_mps * math.cos(heading_rad)), north_mps)
            self._see((0.0, 1.0, level_mps * math.sin(heading_rad)), east_mps)
            self._states[2] = within(self._states[2], *SCALES)
        self.ratio = self._states[2] * by_density
        if abs(self.ratio - self._limited_by) > LIMITS_STEP:
            self._limited_by = self.ratio

    def _stray(self, apart_s: float) -> None:
        """Let wind and scale be what they are after a time, s; NaN or back in time: any wind."""
        covariance = self._covariance
        if not 0.0 <= apart_s <= GAP_S:
            for wind in (0, 1):
                for other in range(3):
                    covariance[wind][other] = covariance[other][wind] = 0.0
                covariance[wind][wind] = squared(WIND_SIGMA_MPS)
            return
        for wind in (0, 1):
            covariance[wind][wind] += squared(WIND_WALK_MPS) * apart_s
        covariance[2][2] += squared(SCALE_WALK) * apart_s

    def _see(self, of: tuple[float, float, float], seen_mps: float) -> None:
        """Correct the states by a component of the velocity over ground, which is `of` times them."""
        states, covariance = self._states, self._covariance
        shared = [each[0] * of[0] + each[1] * of[1] + each[2] * of[2] for each in covariance]
        expected_mps = states[0] * of[0] + states[1] * of[1] + states[2] * of[2]
        spread = shared[0] * of[0] + shared[1] * of[1] + shared[2] * of[2] + squared(TRIANGLE_SIGMA_MPS)
        for state in range(3):
            share = shared[state] / spread
            states[state] += share * (seen_mps - expected_mps)
            for other in range(3):
                covariance[state][other] -= share * shared[other]
