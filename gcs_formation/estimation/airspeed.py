"""What an aircraft's airspeed sensor is worth: whether its reading is believed, and how much faster the aircraft flies.

A sensor that fails reads 0, or sticks. Taken for airspeed, that shows an acceleration that nobody flies and a wind that
nobody feels. What no flight reads isn't believed as long as velocity over ground and the wind known so far show an
airspeed that is flown: that one, the synthetic airspeed, is taken instead. While it is, wind along the nose is kept
and wind across it still followed. A gust changes airspeed or velocity over ground, but keeps the former within what
is flown, so gusts are believed whatever their size.

Autopilots tell, and are told, what the sensor reads: equivalent airspeed, if it is calibrated. In thin air the aircraft
flies faster than that, by 8 % at 1600 m. Taken for true airspeed, readings show a wind that turns with the aircraft.

The readings' scale is learnt from the wind triangle, which a turn tells from wind: velocity over ground is wind, plus
the scaled reading along the heading. Linear in wind and scale, it takes a Kalman filter of three states.

Sources: ArduPilot, synthetic airspeed of EKF3. PX4, Airspeed Validation. Cho, Kim, Lee, Kee, "Wind Estimation and
Airspeed Calibration using a UAV with a Single-Antenna GPS Receiver and Pitot Tube", IEEE Transactions on Aerospace and
Electronic Systems 47 (2011).
"""

from __future__ import annotations

import math
from typing import Final

from flight_model.autopilot_model import squared, within
from flight_model.earth import true_by_equivalent_airspeed

SLOWEST_SHARE: Final = 0.7
"""Share of the lowest airspeed told below which nobody flies: a wing has to lift twice as well as there."""
FASTEST_SHARE: Final = 1.2
"""Share of the highest one above which nobody flies for long: drag grows by half."""
OFF_SHARE: Final = 0.25
"""Share of the lowest one by which a reading has to be off what velocity over ground and wind show as well."""
RETURN_SHARE: Final = 0.5
"""The share of all these margins within which a reading has to be to be believed again."""
RETURN_S: Final = 2.0
"""For how long it has to."""
WIND_S: Final = 30.0
"""Over about so long the wind is averaged: a sensor that ices up loses 1 m/s in a second, and what it shows until it is
found out makes little of that."""

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


class AirspeedCheck:
    """Whether one aircraft's readings are believed, and its synthetic airspeed in the place of those that aren't."""

    def __init__(self, slowest_mps: float, fastest_mps: float) -> None:
        """Believe readings; those that are told are between the two limits."""
        self._slowest_mps, self._fastest_mps = slowest_mps, fastest_mps
        self._north_mps: float = 0.0
        self._east_mps: float = 0.0
        """The wind; calm before the first reading."""
        self._stamp_s: float = math.nan
        self._plausible_s: float = 0.0
        """For how long readings that aren't believed have been plausible again."""
        self.believes = True
        """Whether the newest reading is believed."""
        self.synthetic_mps: float = math.nan
        """The newest true airspeed by velocity over ground and wind."""

    def take(
        self,
        stamp_s: float,
        north_mps: float,
        east_mps: float,
        heading_rad: float,
        reading_mps: float,
        ratio: float,
    ) -> bool:
        """Return whether an aircraft's reading in the air is believed.

        Args:
            stamp_s: when it was measured, by the vehicle's clock.
            north_mps: velocity over ground.
            east_mps: likewise.
            heading_rad: of the nose.
            reading_mps: what the sensor reads.
            ratio: true airspeed by what the sensor reads.
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        begins, elapsed_s = math.isnan(self._stamp_s), stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        self.synthetic_mps = (north_mps - self._north_mps) * cos + (east_mps - self._east_mps) * sin
        self._judge(reading_mps, self.synthetic_mps / ratio, elapsed_s)
        airspeed_mps = ratio * reading_mps if self.believes else self.synthetic_mps
        share = 1.0 if begins else 1.0 - math.exp(-max(elapsed_s, 0.0) / WIND_S)
        self._north_mps += share * (north_mps - airspeed_mps * cos - self._north_mps)
        self._east_mps += share * (east_mps - airspeed_mps * sin - self._east_mps)
        return self.believes

    def _judge(self, reading_mps: float, expected_mps: float, elapsed_s: float) -> None:
        if self.believes:
            self.believes = self._is_plausible(reading_mps, expected_mps, 1.0) or not self._is_flown(expected_mps, 1.0)
            self._plausible_s = 0.0
            return
        self._plausible_s += elapsed_s
        if not self._is_plausible(reading_mps, expected_mps, RETURN_SHARE):
            self._plausible_s = 0.0
        self.believes = self._plausible_s >= RETURN_S

    def _is_plausible(self, reading_mps: float, expected_mps: float, share: float) -> bool:
        """Return whether a reading is flown or as expected, within a share of the margins."""
        off_mps = abs(reading_mps - expected_mps)
        return off_mps < share * OFF_SHARE * self._slowest_mps or self._is_flown(reading_mps, share)

    def _is_flown(self, reading_mps: float, share: float) -> bool:
        """Return whether a reading is within a share of the margins around those that are told."""
        lowest = 1.0 - share * (1.0 - SLOWEST_SHARE)
        highest = 1.0 + share * (FASTEST_SHARE - 1.0)
        return lowest * self._slowest_mps <= reading_mps <= highest * self._fastest_mps


class AirspeedScale:
    """The scale of one aircraft's readings, learnt from its wind triangles."""

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
