"""Decay factors of time constants over a step; kept for reuse, since most steps have the same few lengths."""

from __future__ import annotations

import math
from typing import Final

EARLY: Final = 0.1127016653792583
MIDDLE: Final = 0.5
LATE: Final = 0.8872983346207417
"""Gauss points of a time interval, as shares of it: exact for polynomials of degree 5."""
CLOSE: Final = 2e-4
"""The difference of two exponentials loses too many digits if their exponents are closer than this."""


def between(difference: float, slow_left: float, fast_left: float) -> float:
    """Return the mean of e^x from the logarithm of `slow_left` to that of `fast_left`, which differ by `difference`.

    A small difference uses a series. The relative error is below 1e-12 either way.
    """
    if abs(difference) > CLOSE:
        return (fast_left - slow_left) / difference
    return slow_left * (1.0 + difference / 2.0 * (1.0 + difference / 3.0))


def of_climb(time_s: float, slow_s: float, fast_s: float, slow_left: float, fast_left: float) -> float:
    """Return the height error after a time that a climb rate of 1 m/s leads to, by the height's two time constants.

    With equal time constants `between` gives the solution for a double pole.
    """
    return time_s * between(time_s / slow_s - time_s / fast_s, slow_left, fast_left)


class Decay:
    """Decay factors of the time constants of airspeed, heading and height over a time."""

    __slots__ = (
        "_tau_ha_s",
        "_tau_hb_s",
        "_tau_psi_s",
        "_tau_v_s",
        "_time_s",
        "climb_s",
        "fast",
        "fast_s",
        "heading",
        "slow",
        "slow_s",
        "speed",
    )

    def __init__(self) -> None:
        """Start with no time."""
        self._time_s = self._tau_v_s = self._tau_psi_s = self._tau_ha_s = self._tau_hb_s = math.nan
        self.speed = self.heading = 1.0
        self.slow = self.fast = 1.0
        """Decay factors of the height's slower and faster time constant."""
        self.slow_s = self.fast_s = 0.0
        """The slower and the faster of those time constants, s."""
        self.climb_s = 0.0
        """Result of `of_climb`."""

    def holds(self, time_s: float, tau_v_s: float, tau_psi_s: float, tau_ha_s: float, tau_hb_s: float) -> bool:
        """Return whether the factors are for this time and these time constants, s."""
        return (
            self._time_s == time_s
            and self._tau_v_s == tau_v_s
            and self._tau_psi_s == tau_psi_s
            and self._tau_ha_s == tau_ha_s
            and self._tau_hb_s == tau_hb_s
        )

    def compute(self, time_s: float, tau_v_s: float, tau_psi_s: float, tau_ha_s: float, tau_hb_s: float) -> None:
        """Compute the factors for this time and these time constants, s."""
        self._time_s, self._tau_v_s, self._tau_psi_s = time_s, tau_v_s, tau_psi_s
        self._tau_ha_s, self._tau_hb_s = tau_ha_s, tau_hb_s
        self.slow_s, self.fast_s = max(tau_ha_s, tau_hb_s), min(tau_ha_s, tau_hb_s)
        self.slow, self.fast = math.exp(-time_s / self.slow_s), math.exp(-time_s / self.fast_s)
        self.climb_s = of_climb(time_s, self.slow_s, self.fast_s, self.slow, self.fast)
        self.speed, self.heading = math.exp(-time_s / tau_v_s), math.exp(-time_s / tau_psi_s)


class GaussDecay(Decay):
    """Decay factors over a time; for airspeed and heading also at the three Gauss points of that time."""

    __slots__ = ("early_heading", "early_speed", "late_heading", "late_speed", "middle_heading", "middle_speed")

    def __init__(self) -> None:
        """Start with no time."""
        super().__init__()
        self.early_speed = self.middle_speed = self.late_speed = 1.0
        self.early_heading = self.middle_heading = self.late_heading = 1.0

    def compute(self, time_s: float, tau_v_s: float, tau_psi_s: float, tau_ha_s: float, tau_hb_s: float) -> None:
        """Compute the factors for this time, its Gauss points and these time constants, s."""
        super().compute(time_s, tau_v_s, tau_psi_s, tau_ha_s, tau_hb_s)
        early_s, between_s = EARLY * time_s, (MIDDLE - EARLY) * time_s
        self.early_speed, between = math.exp(-early_s / tau_v_s), math.exp(-between_s / tau_v_s)
        self.middle_speed = self.early_speed * between
        self.late_speed = self.middle_speed * between
        self.early_heading, between = math.exp(-early_s / tau_psi_s), math.exp(-between_s / tau_psi_s)
        self.middle_heading = self.early_heading * between
        self.late_heading = self.middle_heading * between
