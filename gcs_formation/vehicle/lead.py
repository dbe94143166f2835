"""Leads what an autopilot is told, so that it flies it as if it left no part of a change to its integrator.

Of a speed w told it flies prompt_share w + (1 - prompt_share) m with its lag, and m follows w with the time constant
rest_s; so it flies u with that lag when it is told w = (u - (1 - prompt_share) m) / prompt_share.
"""

from __future__ import annotations

import math

from flight_model.autopilot import within


class _Rest:
    """What an autopilot's integrator has come to, of one component of a speed."""

    def __init__(self, prompt_share: float, rest_s: float, period_s: float) -> None:
        """Begin at rest; a speed is told every `period_s`."""
        self._prompt = prompt_share
        self._filled = -math.expm1(-period_s / rest_s)
        self.integrated_mps: float = 0.0

    def led(self, speed_mps: float) -> float:
        """Return what to tell for a speed to be flown."""
        return (speed_mps - (1.0 - self._prompt) * self.integrated_mps) / self._prompt

    def flown(self, told_mps: float) -> float:
        """Return the speed that is flown for one that is told: `led` the other way round."""
        return self._prompt * told_mps + (1.0 - self._prompt) * self.integrated_mps

    def take(self, told_mps: float) -> None:
        """Take note of what is told for a period."""
        self.integrated_mps += self._filled * (told_mps - self.integrated_mps)


class SpeedLead:
    """Leads the airspeeds that a fixed wing is told."""

    def __init__(self, prompt_share: float, rest_s: float, limits_mps: tuple[float, float], period_s: float) -> None:
        """Begin with the airspeed that it has; one between the limits is told every `period_s`."""
        self._rest, self._limits_mps, self._begun = _Rest(prompt_share, rest_s, period_s), limits_mps, False

    @property
    def within_reach_mps(self) -> tuple[float, float]:
        """The least and the highest airspeed that it can be had to fly now; its integrator does the rest in time."""
        if not self._begun:
            return self._limits_mps
        return self._rest.flown(self._limits_mps[0]), self._rest.flown(self._limits_mps[1])

    def lead(self, speed_mps: float, airspeed_mps: float) -> float:
        """Return the airspeed to tell now for one to be flown; `airspeed_mps` is what it flies."""
        if not self._begun:
            self._rest.integrated_mps, self._begun = airspeed_mps, True
        told_mps = within(self._rest.led(speed_mps), self._limits_mps[0], self._limits_mps[1])
        self._rest.take(told_mps)
        return told_mps


class VelocityLead:
    """Leads the velocities over ground that a multirotor is told."""

    def __init__(self, prompt_share: float, rest_s: float, most_mps: float, period_s: float) -> None:
        """Begin at rest; a velocity is told every `period_s`, none faster than `most_mps`."""
        self._north, self._east = (_Rest(prompt_share, rest_s, period_s) for _ in range(2))
        self._most_mps = most_mps

    def lead(self, north_mps: float, east_mps: float) -> tuple[float, float]:
        """Return the velocity to tell now for one to be flown."""
        north, east = self._north.led(north_mps), self._east.led(east_mps)
        share = min(1.0, self._most_mps / max(math.hypot(north, east), 1e-9))
        told = share * north, share * east
        self._north.take(told[0])
        self._east.take(told[1])
        return told
