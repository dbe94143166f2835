"""Wind, disturbances and faults, scheduled by mission time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from formation_scenario.surroundings import (
    DrydenTurbulence,
    Fault,
    RampDisturbance,
    SineDisturbance,
    StepDisturbance,
)
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.turbulence import DrydenGusts
from sim_vehicles.autopilot.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig

Due = tuple[float, bool, Fault, frozenset[VehicleId]]
"""The mission time at which a fault begins or ends, s; whether it ends then; the fault; who has it."""


class Environment:
    """The velocity that the air adds to each vehicle besides the wind, and the faults that are due.

    Vehicles don't know the path, so mission time is what a ground station sends.
    """

    def __init__(self, config: FleetConfig, bodies: Sequence[Body]) -> None:
        """Take disturbances and faults from the configuration; `bodies` are the vehicles' in its order."""
        self.mission_zero: Instant | None = None
        self._bodies = bodies
        self._wind_mps = config.wind_mps
        self._disturbances = [_acting(config, index, bodies) for index in range(len(config.disturbances))]
        due = [(at_s, ends, fault, hit) for fault, hit in config.faults for at_s, ends in fault.moments()]
        self._faults: list[Due] = sorted(due, key=itemgetter(0))
        self._acting: list[tuple[_Steady | _Turbulent, float]] = []
        """What acts now, with the share of it."""

    def hear_mission_time(self, mission_time_s: float, now: Instant) -> None:
        """Take a mission time from a ground station; only the first one that isn't negative is used."""
        if self.mission_zero is None and mission_time_s >= 0:
            self.mission_zero = after(now, -mission_time_s)

    def advance(self, now: Instant) -> list[Due]:
        """Let the air carry the vehicles as it does at `now`; return the faults that have become due."""
        if self.mission_zero is None or not (self._disturbances or self._faults):
            return []
        mission_s = seconds_between(self.mission_zero, now)
        if self._disturbances:
            self._disturb(mission_s)
        struck: list[Due] = []
        while self._faults and self._faults[0][0] <= mission_s:
            struck.append(self._faults.pop(0))
        return struck

    def _disturb(self, mission_s: float) -> None:
        acting = [(each, each.share(mission_s)) for each in self._disturbances if each.keys.acts(mission_s)]
        if acting == self._acting:
            return
        self._acting = acting
        for body in self._bodies:
            body.disturbance_mps = (0.0, 0.0, 0.0)
        for each, share in acting:
            each.add(share)
        north_mps, east_mps, down_mps = self._wind_mps
        for body in self._bodies:
            north, east, down = body.disturbance_mps
            body.air_north_mps, body.air_east_mps = north_mps + north, east_mps + east
            body.air_down_mps = down_mps + down


class _Steady:
    """A disturbance that depends on time only."""

    def __init__(self, keys: StepDisturbance | RampDisturbance | SineDisturbance, hit: list[Body]) -> None:
        self.keys, self._hit = keys, hit

    def share(self, mission_s: float) -> float:
        """Return the share of the velocity that acts: of a sine, -1 to 1."""
        keys, age_s = self.keys, mission_s - self.keys.at_s
        if isinstance(keys, RampDisturbance):
            return min(age_s / keys.duration_s, 1.0)
        if isinstance(keys, SineDisturbance):
            return math.sin(math.tau * age_s / keys.period_s + math.radians(keys.phase_deg))
        return 1.0

    def add(self, share: float) -> None:
        north_mps, east_mps, down_mps = self.keys.velocity_mps
        for body in self._hit:
            _add(body, share * north_mps, share * east_mps, share * down_mps)


class _Turbulent:
    """Gusts that depend on each vehicle's own flight through the air."""

    def __init__(self, keys: DrydenTurbulence, hit: list[Body], streams: list[np.random.Generator]) -> None:
        self.keys, self._hit = keys, hit
        self._gusts = DrydenGusts(streams, keys)

    def share(self, mission_s: float) -> float:
        return mission_s  # each instant has gusts of its own

    def add(self, share: float) -> None:  # noqa: ARG002 - all of them act
        states = [body.state for body in self._hit]
        airspeed_mps, height_m = np.array([(each.airspeed_mps, each.height_m) for each in states]).T
        gusts_mps = self._gusts.advance(airspeed_mps, height_m, LOOP_S).T.tolist()
        for body, state, (forward, right, down) in zip(self._hit, states, gusts_mps, strict=True):
            cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
            _add(body, forward * cos - right * sin, forward * sin + right * cos, down)


def _add(body: Body, north_mps: float, east_mps: float, down_mps: float) -> None:
    north, east, down = body.disturbance_mps
    body.disturbance_mps = (north + north_mps, east + east_mps, down + down_mps)


def _acting(config: FleetConfig, index: int, bodies: Sequence[Body]) -> _Steady | _Turbulent:
    """Return the disturbance of the entry at `index`; each vehicle's gusts in each entry are independent."""
    keys, vehicles = config.disturbances[index]
    met_by = [
        (vehicle.identity, body)
        for vehicle, body in zip(config.vehicles, bodies, strict=True)
        if vehicle.identity in vehicles
    ]
    hit = [body for _, body in met_by]
    if not isinstance(keys, DrydenTurbulence):
        return _Steady(keys, hit)
    streams = [random_stream(config.seed, "turbulence", index, *identity) for identity, _ in met_by]
    return _Turbulent(keys, hit, streams)
