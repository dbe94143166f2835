"""Leads what an autopilot is told, so that it flies it as if it left no part of a change to its integrator.

Of a speed w told it flies prompt_share w + (1 - prompt_share) m with its lag, and m follows w with the time constant
rest_s; so it flies u with that lag when it is told w = (u - (1 - prompt_share) m) / prompt_share.
"""

from __future__ import annotations

import math

from flight_model.autopilot import within


class SpeedLead:
    """Leads the airspeeds that a fixed wing is told."""

    def __init__(self, prompt_share: float, rest_s: float, limits_mps: tuple[float, float], period_s: float) -> None:
        """Begin with the airspeed that it has; one between the limits is told every `period_s`."""
        self._prompt, (self._least_mps, self._most_mps) = prompt_share, limits_mps
        self._filled = -math.expm1(-period_s / rest_s)
        self._integrated_mps = math.nan

    def lead(self, speed_mps: float, airspeed_mps: float) -> float:
        """Return the airspeed to tell now for one to be flown; `airspeed_mps` is what it flies."""
        done_mps = self._integrated_mps
        if math.isnan(done_mps):
            done_mps = airspeed_mps
        led_mps = (speed_mps - (1.0 - self._prompt) * done_mps) / self._prompt
        told_mps = within(led_mps, self._least_mps, self._most_mps)
        self._integrated_mps = done_mps + self._filled * (told_mps - done_mps)
        return told_mps


class VelocityLead:
    """Leads the velocities over ground that a multirotor is told."""

    def __init__(self, prompt_share: float, rest_s: float, most_mps: float, period_s: float) -> None:
        """Begin at rest; a velocity is told every `period_s`, none faster than `most_mps`."""
        self._prompt, self._most_mps = prompt_share, most_mps
        self._filled = -math.expm1(-period_s / rest_s)
        self._integrated_mps: tuple[float, float] = (0.0, 0.0)

    def lead(self, north_mps: float, east_mps: float) -> tuple[float, float]:
        """Return the velocity to tell now for one to be flown."""
        rest, done = 1.0 - self._prompt, self._integrated_mps
        north = (north_mps - rest * done[0]) / self._prompt
        east = (east_mps - rest * done[1]) / self._prompt
        share = min(1.0, self._most_mps / max(math.hypot(north, east), 1e-9))
        told = share * north, share * east
        self._integrated_mps = (
            done[0] + self._filled * (told[0] - done[0]),
            done[1] + self._filled * (told[1] - done[1]),
        )
        return told
