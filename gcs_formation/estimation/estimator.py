"""The newest state of every vehicle at its own time stamp, on the station's clock, and its wind estimate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from airlink.clock import Instant, seconds_between
from gcs_formation.arrays import Array, Instants, Mask
from gcs_formation.estimation.flight_state import FlightState
from gcs_formation.estimation.fusion import Fusion

ROWS = 8
WIND = slice(6, 8)
"""Rows of the wind."""
LEAST_AIRSPEED_MPS = 1.0
"""What an airspeed below it is taken as: equations divide by it, and what flies has more."""


class Sample(NamedTuple):
    """What a vehicle measured at one instant: ground velocity, and position north, east and up from the origin."""

    stamp: Instant
    north_m: float
    east_m: float
    height_m: float
    north_mps: float
    east_mps: float
    climb_mps: float
    heading_rad: float
    airspeed_mps: float


class StateEstimator:
    """Combines each vehicle's messages into a state at one time stamp; one column for each vehicle.

    The disturbance observer is a first-order filter on ground velocity minus airspeed along the heading. What remains
    is wind, or anything else that displaces the vehicle.
    """

    def __init__(self, columns: int, observer_radps: float, fusions: Mapping[int, Fusion] | None = None) -> None:
        """Start with nothing known. An observer bandwidth of 0 rad/s keeps the wind estimate at 0.

        `fusions` are the Kalman filters of the columns whose samples are noisy; they estimate the wind too.
        """
        self._table = np.full((ROWS, columns), np.nan)
        self._stamps = np.zeros(columns, dtype=np.int64)
        self._observer_radps = observer_radps
        self._fusions = dict(fusions or {})

    @property
    def state(self) -> FlightState:
        """The newest states; NaN where none has arrived yet."""
        return FlightState.of(self._table.copy())

    @property
    def stamps(self) -> Instants:
        """The time stamps of those states on the station's clock: (columns,) instants."""
        return self._stamps.copy()

    @property
    def known(self) -> Mask:
        """Which columns have a state: (columns,)."""
        known: Mask = np.logical_and.reduce(np.isfinite(self._table))
        return known

    def age_s(self, column: int, now: Instant) -> float:
        """Return how old a column's state is, in s; NaN when it has none."""
        if math.isnan(self._table[0, column]):
            return math.nan
        return seconds_between(Instant(int(self._stamps[column])), now)

    def forget(self, column: int) -> None:
        """Forget a vehicle that has restarted."""
        self._table[:, column] = np.nan
        if column in self._fusions:
            self._fusions[column].begin()

    def place(self, column: int, state: Array, stamp: Instant) -> None:
        """Set a column to (8,) values in the order of FlightState."""
        self._table[:, column] = state
        self._stamps[column] = stamp

    def update(self, column: int, sample: Sample) -> None:
        """Take a vehicle's newest sample."""
        if column in self._fusions and not math.isnan(self._table[0, column]):
            before, since = self._table[:, column].copy(), self._stamps[column : column + 1].copy()
            measured = np.array((*sample[1:7], sample.airspeed_mps, sample.heading_rad))
            stamp = np.maximum(since, np.int64(sample.stamp))
            self._table[:, column] = self._fusions[column].update(before, since, measured, stamp)
            self._stamps[column] = stamp[0]
            return
        wind_north, wind_east = self._observe(column, sample)
        self._table[:, column] = (
            sample.north_m,
            sample.east_m,
            sample.height_m,
            sample.climb_mps,
            max(sample.airspeed_mps, LEAST_AIRSPEED_MPS),
            sample.heading_rad,
            wind_north,
            wind_east,
        )
        self._stamps[column] = sample.stamp

    def _observe(self, column: int, sample: Sample) -> tuple[float, float]:
        if self._observer_radps == 0.0:
            return 0.0, 0.0
        north = sample.north_mps - sample.airspeed_mps * math.cos(sample.heading_rad)
        east = sample.east_mps - sample.airspeed_mps * math.sin(sample.heading_rad)
        before_north, before_east = self._table[WIND, column].tolist()
        if math.isnan(before_north):
            return north, east
        elapsed_s = max(0.0, seconds_between(Instant(int(self._stamps[column])), sample.stamp))
        share = 1.0 - math.exp(-self._observer_radps * elapsed_s)
        return before_north + share * (north - before_north), before_east + share * (east - before_east)
