# Compiled by mypyc: it runs every tick.

"""How much later than its model says a vehicle answers its heading setpoints, at the frequency at which it swings."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from flight_model.arrays import Array

KEPT: Final = 1200
"""Ticks that are kept. Tuned: ticks; three periods and more, 600 to 3000; shown by `pytest
tests/gcs_formation/features/limit_cycle`."""
PERIODS: Final = 3.0
"""Periods of the oscillation that are used, the newest. Tuned: periods; 2 to 6; shown by `pytest
tests/gcs_formation/features/limit_cycle`."""


class Answer:
    """One vehicle's heading setpoints, and its headings."""

    def __init__(self) -> None:
        """Start without any."""
        self._rows: Array = np.zeros((KEPT, 4))
        """A ring: there from the start, so that no object is kept of a tick."""
        self._taken = 0

    def clear(self) -> None:
        """Begin again."""
        self._taken = 0

    def add(self, acts_s: float, setpoint_rad: float, seen_s: float, heading_rad: float) -> None:
        """Take a setpoint and when it acts, and the newest heading and when it was flown, s and rad."""
        self._rows[self._taken % KEPT] = (acts_s, setpoint_rad, seen_s, heading_rad)
        self._taken += 1

    def late_s(self, period_s: float, tau_psi_s: float) -> float:
        """Return the answer's time beyond that of a time constant, s; NaN if too little was seen.

        Both are fitted by an oscillation about a line; its phase is the time.
        """
        acts_s, setpoints_rad, seen_s, headings_rad = self._in_order().T
        last_s = seen_s[-1] if seen_s.size else 0.0
        radps, since_s = math.tau / period_s, last_s - PERIODS * period_s
        if not seen_s.size or seen_s[0] > since_s:
            return math.nan
        asked = _phase_rad(acts_s[acts_s >= since_s] - since_s, setpoints_rad[acts_s >= since_s], radps)
        flown = _phase_rad(seen_s[seen_s >= since_s] - since_s, headings_rad[seen_s >= since_s], radps)
        behind_rad = math.fmod(asked - flown, math.tau)
        behind_rad += math.tau if behind_rad < 0.0 else 0.0
        return (behind_rad - math.atan(radps * tau_psi_s)) / radps

    def _in_order(self) -> Array:
        """Return the rows that are kept, the oldest first."""
        if self._taken <= KEPT:
            return self._rows[: self._taken]
        return np.roll(self._rows, -(self._taken % KEPT), axis=0)


def _phase_rad(times_s: Array, angles_rad: Array, radps: float) -> float:
    """Return the phase of an oscillation about a line."""
    rows = np.stack((np.cos(radps * times_s), -np.sin(radps * times_s), np.ones_like(times_s), times_s), axis=1)
    cos, sin = np.linalg.lstsq(rows, np.unwrap(angles_rad), rcond=None)[0][:2].tolist()
    return math.atan2(sin, cos)
