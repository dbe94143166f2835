# Compiled by mypyc: it runs every tick.

"""How long a battery lasts: by what is measured in flight, by the scenario, or by the autopilot's own estimate.

In flight the mean since the vehicle has climbed out counts, between the first and the last change of the percentage
that is reported: the rounding of both is the same then. What nothing reports is unknown, and prevents nothing.
"""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.reported_battery import ReportedBattery

MIN_USED: Final = 0.05
"""Share of a battery that must have been used in flight before its use counts as measured: five steps of 1 %."""
ROUNDING: Final = 1e-9


class Endurance:
    """How long a full battery of one vehicle lasts."""

    def __init__(self, stated_s: float | None) -> None:
        """Take what the scenario states, s; None: nothing."""
        self._stated_s = math.nan if stated_s is None else stated_s
        self._left = math.nan
        self._first: tuple[float, Instant] | None = None
        self._last: tuple[float, Instant] | None = None

    def observe(self, battery: ReportedBattery, now: Instant, *, flies: bool) -> None:
        """Take what is left now; on the ground, and after another battery was put in, the measurement begins again."""
        left, before = battery.left, self._left
        self._left = left
        if not flies or left > before:
            self._first = self._last = None
        elif left < before:
            self._last = left, now
            self._first = self._first or self._last

    @property
    def measured_s(self) -> float:
        """How long a full battery lasts as measured in this flight, s; NaN before enough has been used."""
        if self._first is None or self._last is None or self._first[0] - self._last[0] < MIN_USED - ROUNDING:
            return math.nan
        return seconds_between(self._first[1], self._last[1]) / (self._first[0] - self._last[0])

    def full_s(self, battery: ReportedBattery) -> float:
        """Return how long a full battery lasts, s; NaN if nothing tells."""
        measured_s = self.measured_s
        return planned_full_s(battery, self._stated_s) if math.isnan(measured_s) else measured_s


def planned_full_s(battery: ReportedBattery, stated_s: float) -> float:
    """Return how long a full battery lasts, s: as stated, or else by the autopilot's estimate; NaN if neither tells."""
    if not math.isnan(stated_s):
        return stated_s
    return battery.lasts_s / battery.left if battery.left > 0.0 else math.nan
