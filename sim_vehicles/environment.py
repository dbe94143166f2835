"""The air and what happens in it: wind, disturbances and faults, by mission time."""

from __future__ import annotations

import numpy as np

from airlink.clock import Instant, after, seconds_between
from sim_vehicles.config import Fault, FleetConfig
from sim_vehicles.dynamics import Array


class Environment:
    """What carries N vehicles through the air, and when faults strike.

    Mission time begins when a ground station says so: vehicles don't know the path.
    """

    def __init__(self, config: FleetConfig) -> None:
        """Take wind, disturbances and faults from the configuration."""
        count = len(config.vehicles)
        self.mission_zero: Instant | None = None
        self._wind = np.repeat(np.array(config.wind_mps)[:, None], count, axis=1)
        self._waiting = sorted(config.disturbances, key=lambda each: each.at_s)
        self._faults = sorted(config.faults, key=lambda each: each.at_s)
        self._identities = [vehicle.identity for vehicle in config.vehicles]
        self.velocity_mps: Array = self._wind.copy()
        """(3, N) north, east, down, added to the velocity through the air."""

    def mission_told(self, mission_time_s: float, now: Instant) -> None:
        """Take a ground station's mission time; the first one that isn't negative counts."""
        if self.mission_zero is None and mission_time_s >= 0:
            self.mission_zero = after(now, -mission_time_s)

    def advance(self, now: Instant) -> list[Fault]:
        """Put into force what is due; return the faults that strike."""
        if self.mission_zero is None or not (self._waiting or self._faults):
            return []
        mission_s = seconds_between(self.mission_zero, now)
        while self._waiting and self._waiting[0].at_s <= mission_s:
            disturbance = self._waiting.pop(0)
            hit = np.array([identity in disturbance.vehicles for identity in self._identities])
            self.velocity_mps = self.velocity_mps + np.outer(disturbance.velocity_mps, hit)
        struck: list[Fault] = []
        while self._faults and self._faults[0].at_s <= mission_s:
            struck.append(self._faults.pop(0))
        return struck
