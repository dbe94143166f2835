"""A flown flight as a metric sees it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flight_model.arrays import Array


@dataclass(frozen=True)
class FlightWindow:
    """The ticks of a flight in a window of mission time, both ends included."""

    time_s: Array
    """(T,) mission times, s."""
    dt_s: float
    """Time between ticks, s."""
    truth: bool
    """Whether there is ground truth (columns `true_north_m` and so on), as with emulated vehicles."""
    vehicles: Mapping[str, Mapping[str, Array]]
    """By vehicle id, each (T,) column of timeseries.parquet by its name (docs/timeseries.md); NaN where unknown."""
