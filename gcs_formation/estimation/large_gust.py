"""A gust that is too large for the innovation gate: accepted once a second sample shows it."""

from __future__ import annotations

from typing import Final

from flight_model.autopilot_model import squared
from gcs_formation.estimation.noise_and_plausibility import (
    UNKNOWN_MOTION,
    UNKNOWN_TURN,
    Values,
)

GUST_SIGMAS: Final = 4.0
"""A wind shown by a sample that differs by more standard deviations from the estimate is a gust, accepted at once.
Tuned: standard deviations; 3 to 5; shown by `python -m benchmarks.gust_grid`."""


def explained(difference: Values) -> bool:
    """Return whether a changed airspeed or heading shows what looks like a gust."""
    return squared(difference[6]) > UNKNOWN_MOTION or squared(difference[7]) > UNKNOWN_TURN


class LargeGust:
    """A gust that a single sample shows and that is too large to be accepted from it: its wind, and where it was."""

    def __init__(self, wind_north_mps: float, wind_east_mps: float, north_m: float, east_m: float) -> None:
        """Take the wind that the sample shows, and its position."""
        self.wind_north_mps = wind_north_mps
        self.wind_east_mps = wind_east_mps
        self.north_m = north_m
        self.east_m = east_m

    def repeats(self, before: LargeGust, values: Values, noise: float, elapsed_s: float) -> bool:
        """Return whether this sample, of `values`, shows the gust of the one before, and moved with it.

        `noise`: variance of a component of the wind that one sample shows, (m/s)². Where a stamp went back no time has
        passed, and it hasn't moved.
        """
        if elapsed_s <= 0.0:
            return False
        change = squared(self.wind_north_mps - before.wind_north_mps) + squared(
            self.wind_east_mps - before.wind_east_mps
        )
        north_mps = (self.north_m - before.north_m) / elapsed_s - values[3]
        east_mps = (self.east_m - before.east_m) / elapsed_s - values[4]
        maximum = squared(GUST_SIGMAS) * noise + UNKNOWN_MOTION
        return change < 2.0 * maximum and squared(north_mps) + squared(east_mps) < 2.0 * maximum
