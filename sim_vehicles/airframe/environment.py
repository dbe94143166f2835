"""Wind, disturbances and faults, scheduled by mission time."""

from __future__ import annotations

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from sim_vehicles.airframe.disturbances import Disturbance, DrydenGusts, Turbulence
from sim_vehicles.airframe.dynamics import State
from sim_vehicles.autopilot.clock import LOOP_S
from sim_vehicles.config import Fault, FleetConfig


class Environment:
    """The velocity that the air adds to each of N vehicles, and the faults that are due.

    Vehicles don't know the path, so mission time is what a ground station sends.
    """

    def __init__(self, config: FleetConfig) -> None:
        """Take wind, disturbances and faults from the configuration."""
        count = len(config.vehicles)
        self.mission_zero: Instant | None = None
        self._wind = np.repeat(np.array(config.wind_mps)[:, None], count, axis=1)
        self._disturbances = [_acting(config, index) for index in range(len(config.disturbances))]
        self._faults = sorted(config.faults, key=lambda each: each.at_s)
        self._calm = True
        self.disturbance_mps: Array = np.zeros((3, count))
        """(3, N) north, east, down: the sum of all disturbances."""
        self.velocity_mps: Array = self._wind.copy()
        """The same including the wind: what is added to the velocity through the air."""

    def mission_told(self, mission_time_s: float, now: Instant) -> None:
        """Take a mission time from a ground station; only the first one that isn't negative is used."""
        if self.mission_zero is None and mission_time_s >= 0:
            self.mission_zero = after(now, -mission_time_s)

    def advance(self, now: Instant, state: State) -> list[Fault]:
        """Update the velocities at `now` for vehicles in `state`; return the faults that have become due."""
        if self.mission_zero is None or not (self._disturbances or self._faults):
            return []
        mission_s = seconds_between(self.mission_zero, now)
        if self._disturbances:
            self._disturb(mission_s, state)
        struck: list[Fault] = []
        while self._faults and self._faults[0].at_s <= mission_s:
            struck.append(self._faults.pop(0))
        return struck

    def _disturb(self, mission_s: float, state: State) -> None:
        acting = [each for each in self._disturbances if each.passing.acts(mission_s)]
        if not acting and self._calm:
            return
        velocity_mps = np.zeros_like(self._wind)
        for each in acting:
            each.add_to(velocity_mps, mission_s, state)
        self._calm = not acting
        self.disturbance_mps = velocity_mps
        self.velocity_mps = self._wind + velocity_mps


class _Steady:
    """A disturbance that depends on time only."""

    def __init__(self, passing: Disturbance, hit: Array) -> None:
        self.passing = passing
        self._whole_mps = np.outer(passing.velocity_mps, hit)

    def add_to(self, velocity_mps: Array, mission_s: float, state: State) -> None:  # noqa: ARG002 - the same for all
        velocity_mps += self.passing.share(mission_s - self.passing.at_s) * self._whole_mps


class _Turbulent:
    """Gusts that depend on each vehicle's own flight through the air."""

    def __init__(self, passing: Turbulence, hit: Array, streams: list[np.random.SeedSequence]) -> None:
        self.passing = passing
        self._hit = np.flatnonzero(hit)
        self._gusts = DrydenGusts(streams, passing.intensity)

    def add_to(self, velocity_mps: Array, mission_s: float, state: State) -> None:  # noqa: ARG002 - they have no age
        hit = self._hit
        forward, right, down = self._gusts.advance(state.airspeed_mps[hit], state.height_m[hit], LOOP_S)
        cos, sin = np.cos(state.heading_rad[hit]), np.sin(state.heading_rad[hit])
        velocity_mps[:, hit] += forward * cos - right * sin, forward * sin + right * cos, down


def _acting(config: FleetConfig, index: int) -> _Steady | _Turbulent:
    """Return the disturbance of the entry at `index`; each vehicle's gusts in each entry are independent."""
    passing = config.disturbances[index]
    identities = [vehicle.identity for vehicle in config.vehicles]
    hit = np.array([identity in passing.vehicles for identity in identities], dtype=np.float64)
    if isinstance(passing, Disturbance):
        return _Steady(passing, hit)
    met_by = [identity for identity in identities if identity in passing.vehicles]
    streams = [random_stream(config.seed, "turbulence", index, *identity) for identity in met_by]
    return _Turbulent(passing, hit, streams)
