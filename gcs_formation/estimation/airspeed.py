"""Airspeed sensors: whether a reading is accepted, and the ratio of true airspeed to readings.

A failed sensor reads 0, or sticks. Used as airspeed, such readings show accelerations and winds that don't exist. A
reading outside the flight envelope is rejected as long as the velocity over ground and the wind estimate give an
airspeed inside the envelope. This synthetic airspeed then replaces it: the wind along the nose is held, the wind across
it is still estimated. A gust changes airspeed or velocity over ground but keeps the airspeed within the envelope, so
gusts are accepted whatever their size.

Autopilots report and accept readings, indicated airspeed (IAS): equivalent airspeed (EAS), if the sensor is calibrated.
At density altitude true airspeed is higher, by 8 % at 1600 m. Used as true airspeed, readings show a wind that turns
with the aircraft.

The scale of the readings is estimated from the wind triangle: velocity over ground is wind plus the scaled reading
along the heading. In turns, scale and wind can be distinguished. The equation is linear in both, so a Kalman filter of
three states estimates them.

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
"""Lower end of the envelope, by the lower airspeed limit: there a wing needs twice its lift coefficient. Tuned: share;
0.6 to 0.8; shown by `pytest tests/gcs_formation/estimation`."""
FASTEST_SHARE: Final = 1.2
"""Upper end of the envelope, by the upper airspeed limit: there drag is larger by half. Tuned: share; 1.1 to 1.4; shown
by `pytest tests/gcs_formation/estimation`."""
OFF_SHARE: Final = 0.25
"""A rejected reading also differs from the synthetic airspeed by more than this share of the lower airspeed limit.
Tuned: share; 0.15 to 0.4; shown by `pytest tests/gcs_formation/estimation`."""
RETURN_SHARE: Final = 0.5
"""Share of these margins that a reading must keep, for `RETURN_S`, to be accepted again. Tuned: share; 0.3 to 0.7;
shown by `pytest tests/gcs_formation/estimation`."""
RETURN_S: Final = 2.0
"""How long a rejected reading must keep that share. Tuned: s; 1 to 5; shown by `pytest
tests/gcs_formation/estimation`."""
WIND_S: Final = 30.0
"""Averaging time of the wind: a sensor that ices up, and so loses 1 m/s each second, changes it little before it is
detected. Tuned: s; 15 to 60; shown by `pytest tests/gcs_formation/estimation`."""

SCALE_SIGMA: Final = 0.08
"""Prior standard deviation of a sensor's scale about 1. Tuned: a number; 0.05 to 0.15; shown by `pytest
tests/gcs_formation/estimation`."""
SCALE_WALK: Final = 2e-4
"""Random walk of the scale, per square root of a second. Tuned: 1/√s; 5e-5 to 1e-3; shown by `pytest
tests/gcs_formation/estimation`."""
SCALES: Final[tuple[float, ...]] = (0.75, 1.35)
"""Limits of the estimated scale. Tuned: a number; 0.6 to 1.5; shown by `pytest tests/gcs_formation/estimation`."""
WIND_SIGMA_MPS: Final = 15.0
"""Prior standard deviation of each component of the wind. Tuned: m/s; 8 to 20; shown by `pytest
tests/gcs_formation/estimation`."""
WIND_WALK_MPS: Final = 0.1
"""Random walk of each component of the wind, per square root of a second. Tuned: m/s/√s; 0.05 to 0.3; shown by `pytest
tests/gcs_formation/estimation`."""
TRIANGLE_SIGMA_MPS: Final = 3.0
"""Standard deviation of a wind triangle's error: gusts, sideslip, and time constants of the measurements. It makes up
for correlation: gusts of 0.7 m/s that last for 10 s give all triangles in that time the same error. Tuned: m/s; 2 to 5;
shown by `pytest tests/gcs_formation/estimation`."""
PERIOD_S: Final = 0.5
"""Least time between two wind triangles that are used. Tuned: s; 0.2 to 2; shown by `pytest
tests/gcs_formation/estimation`."""
GAP_S: Final = 10.0
"""After a longer gap in the telemetry the wind is unknown again. Tuned: s; 5 to 60; shown by `pytest
tests/gcs_formation/estimation`."""
MIN_MPS: Final = 5.0
"""Smaller readings aren't used. Tuned: m/s; 3 to 8; shown by `pytest tests/gcs_formation/estimation`."""
LIMITS_STEP: Final = 0.005
"""Smallest change of the ratio that the airspeed limits follow. Tuned: a number; 0.001 to 0.02; shown by `pytest
tests/gcs_formation/estimation`."""


class AirspeedCheck:
    """Whether one aircraft's readings are accepted, and its synthetic airspeed, which replaces rejected ones."""

    def __init__(self, slowest_mps: float, fastest_mps: float) -> None:
        """Start by accepting readings; the two limits are those of commanded airspeeds."""
        self._slowest_mps, self._fastest_mps = slowest_mps, fastest_mps
        self._north_mps: float = 0.0
        self._east_mps: float = 0.0
        """The wind; calm before the first reading."""
        self._stamp_s: float = math.nan
        self._plausible_s: float = 0.0
        """How long rejected readings have been plausible again."""
        self.accepted = True
        """Whether the newest reading is accepted."""
        self.synthetic_mps: float = math.nan
        """The newest true airspeed by velocity over ground and wind."""

    def restart(self) -> None:
        """Judge readings as if they were the first ones: the aircraft, its clock and its sensor have restarted.

        The wind stays: it is the air's, and if the sensor still fails, the synthetic airspeed is by what was known.
        """
        self._stamp_s, self._plausible_s, self.accepted = math.nan, 0.0, True

    def accepts(
        self,
        stamp_s: float,
        north_mps: float,
        east_mps: float,
        heading_rad: float,
        ias_mps: float,
        ratio: float,
    ) -> bool:
        """Return whether an aircraft's reading in the air is accepted.

        Args:
            stamp_s: when it was measured, by the vehicle's clock.
            north_mps: velocity over ground.
            east_mps: likewise.
            heading_rad: of the nose.
            ias_mps: indicated airspeed, what the sensor reads.
            ratio: of true airspeed to the reading.
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        begins, elapsed_s = math.isnan(self._stamp_s), stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        self.synthetic_mps = (north_mps - self._north_mps) * cos + (east_mps - self._east_mps) * sin
        self._judge(ias_mps, self.synthetic_mps / ratio, elapsed_s)
        airspeed_mps = ratio * ias_mps if self.accepted else self.synthetic_mps
        share = 1.0 if begins else 1.0 - math.exp(-max(elapsed_s, 0.0) / WIND_S)
        self._north_mps += share * (north_mps - airspeed_mps * cos - self._north_mps)
        self._east_mps += share * (east_mps - airspeed_mps * sin - self._east_mps)
        return self.accepted

    def _judge(self, ias_mps: float, expected_mps: float, elapsed_s: float) -> None:
        if self.accepted:
            self.accepted = self._is_plausible(ias_mps, expected_mps, 1.0) or not self._is_flown(expected_mps, 1.0)
            self._plausible_s = 0.0
            return
        self._plausible_s += max(elapsed_s, 0.0)
        if not self._is_plausible(ias_mps, expected_mps, RETURN_SHARE):
            self._plausible_s = 0.0
        self.accepted = self._plausible_s >= RETURN_S

    def _is_plausible(self, ias_mps: float, expected_mps: float, share: float) -> bool:
        """Return whether a reading is in the envelope or as expected, within a share of the margins."""
        off_mps = abs(ias_mps - expected_mps)
        return off_mps < share * OFF_SHARE * self._slowest_mps or self._is_flown(ias_mps, share)

    def _is_flown(self, ias_mps: float, share: float) -> bool:
        """Return whether a reading is in the envelope, within a share of its margins around the airspeed limits."""
        lowest = 1.0 - share * (1.0 - SLOWEST_SHARE)
        highest = 1.0 + share * (FASTEST_SHARE - 1.0)
        return lowest * self._slowest_mps <= ias_mps <= highest * self._fastest_mps


class AirspeedScale:
    """The scale of one aircraft's readings, estimated from its wind triangles."""

    def __init__(self, field_m: float, slowest_mps: float, fastest_mps: float) -> None:
        """Start with a calibrated sensor, `field_m` above sea level; the two limits are those of commanded readings."""
        self.ratio = true_by_equivalent_airspeed(field_m)
        """Ratio of true airspeed to the reading at the present height."""
        self._slowest_mps, self._fastest_mps = slowest_mps, fastest_mps
        self._limits_ratio = self.ratio
        self._stamp_s = math.nan
        self._states = [0.0, 0.0, 1.0]
        """Wind north and east, m/s, and the scale."""
        self._covariance = [[0.0] * 3 for _ in range(3)]
        self._covariance[2][2] = squared(SCALE_SIGMA)

    @property
    def scale(self) -> float:
        """Ratio of true airspeed to the one that a calibrated sensor with the same reading would mean."""
        return self._states[2]

    @property
    def speeds_mps(self) -> tuple[float, float]:
        """Limits of true airspeed: both it and its reading stay within the limits of readings."""
        ratio = self._limits_ratio
        return self._slowest_mps * max(1.0, ratio), self._fastest_mps * min(1.0, ratio)

    def bound(self, slowest_mps: float, fastest_mps: float) -> None:
        """Narrow the limits of commanded readings: the vehicle has reported its own."""
        self._slowest_mps = max(self._slowest_mps, slowest_mps)
        self._fastest_mps = min(self._fastest_mps, fastest_mps)

    def true(self, ias_mps: float) -> float:
        """Return the true airspeed of a reading."""
        return self.ratio * ias_mps

    def indicated(self, true_mps: float) -> float:
        """Return the reading to command for a true airspeed, within the limits."""
        return within(true_mps / self.ratio, self._slowest_mps, self._fastest_mps)

    def update(
        self,
        stamp_s: float,
        above_sea_m: float,
        velocity_mps: tuple[float, float, float],
        ias_mps: float,
        heading_rad: float,
    ) -> None:
        """Take a wind triangle of an aircraft in the air.

        Args:
            stamp_s: when it was measured, by the vehicle's clock.
            above_sea_m: the height.
            velocity_mps: over ground: north, east and up.
            ias_mps: indicated airspeed, what the sensor reads.
            heading_rad: of the nose.
        """
        by_density = true_by_equivalent_airspeed(above_sea_m)
        gap_s = stamp_s - self._stamp_s
        if not 0.0 <= gap_s < PERIOD_S and ias_mps >= MIN_MPS:
            self._stamp_s = stamp_s
            self._predict(gap_s)
            north_mps, east_mps, climb_mps = velocity_mps
            level_mps = math.sqrt(max(squared(by_density * ias_mps) - squared(climb_mps), 0.0))
            self._update((1.0, 0.0, level_mps * math.cos(heading_rad)), north_mps)
            self._update((0.0, 1.0, level_mps * math.sin(heading_rad)), east_mps)
            self._states[2] = within(self._states[2], *SCALES)
        self.ratio = self._states[2] * by_density
        if abs(self.ratio - self._limits_ratio) > LIMITS_STEP:
            self._limits_ratio = self.ratio

    def _predict(self, gap_s: float) -> None:
        """Grow the covariance over a time, s; after a gap, a step back in time or NaN the wind is unknown."""
        covariance = self._covariance
        if not 0.0 <= gap_s <= GAP_S:
            for wind in (0, 1):
                for other in range(3):
                    covariance[wind][other] = covariance[other][wind] = 0.0
                covariance[wind][wind] = squared(WIND_SIGMA_MPS)
            return
        for wind in (0, 1):
            covariance[wind][wind] += squared(WIND_WALK_MPS) * gap_s
        covariance[2][2] += squared(SCALE_WALK) * gap_s

    def _update(self, of: tuple[float, float, float], seen_mps: float) -> None:
        """Correct the states by a measured component of the velocity over ground; `of` is its derivative by them."""
        states, covariance = self._states, self._covariance
        shared = [each[0] * of[0] + each[1] * of[1] + each[2] * of[2] for each in covariance]
        expected_mps = states[0] * of[0] + states[1] * of[1] + states[2] * of[2]
        spread = shared[0] * of[0] + shared[1] * of[1] + shared[2] * of[2] + squared(TRIANGLE_SIGMA_MPS)
        for state in range(3):
            share = shared[state] / spread
            states[state] += share * (seen_mps - expected_mps)
            for other in range(3):
                covariance[state][other] -= share * shared[other]
