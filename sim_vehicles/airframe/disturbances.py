"""Wind, disturbances and faults, scheduled by mission time.

Source of Dryden's turbulence: MIL-F-8785C (1980), section 3.7.1.2. Its axis u points along the horizontal motion
through the air and w downwards; v completes the axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import TypeAlias

import numpy as np

from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from flight_model.arrays import Array
from formation_scenario.extensions import ExtensionError
from formation_scenario.surroundings import (
    Disturbance,
    DrydenTurbulence,
    Fault,
    OwnDisturbance,
    RampDisturbance,
    SineDisturbance,
    StepDisturbance,
)
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.airframe.own_air import OwnAir
from sim_vehicles.board_clock import LOOP_S
from sim_vehicles.config import FleetConfig
from sim_vehicles.outside import Failures

MIN_AIRSPEED_MPS = 1.0
"""Lower bound of airspeed in gust filters: for a vehicle at rest a gust would never end."""
DRAWS_EACH = 5
BLOCK = 256
SQRT3 = math.sqrt(3.0)
Due = tuple[float, bool, Fault, frozenset[VehicleId]]
"""Mission time at which a fault begins or ends, s; whether it ends; the fault; the vehicles concerned."""


class Environment:
    """The velocity that the air has at each vehicle besides the wind, and the faults that are due.

    Vehicles don't know the path, so mission time is received from a ground station.
    """

    def __init__(self, config: FleetConfig, bodies: Sequence[InAir]) -> None:
        """Take disturbances and faults from the configuration; `bodies` are its vehicles' in the same order."""
        self.mission_zero: Instant | None = None
        self.failures = Failures()
        """What failed of the extensions of the fleet."""
        self._bodies = bodies
        self._wind_mps = config.wind_mps
        self._config = config
        self._disturbances = [
            _acting(config, index, keys, hit, bodies, self.failures)
            for index, (keys, hit) in enumerate(config.disturbances)
        ]
        due = [(at_s, ends, fault, hit) for fault, hit in config.faults for at_s, ends in fault.moments()]
        self._faults: list[Due] = sorted(due, key=itemgetter(0))
        self._scheduled: list[tuple[Instant, Due]] = []
        """Faults that are due at an instant instead of a mission time."""
        self._acting: list[tuple[Acting, float]] = []
        """The disturbances active at present, with their shares."""

    def receive_mission_time(self, mission_time_s: float, now: Instant) -> None:
        """Take a mission time from a ground station; only the first non-negative one is used."""
        if self.mission_zero is None and mission_time_s >= 0:
            self.mission_zero = after(now, -mission_time_s)

    def strike(self, fault: Fault, hit: frozenset[VehicleId], zero: Instant) -> None:
        """Add a fault of some vehicles, whose times count from `zero`."""
        for at_s, ends in fault.moments():
            self._scheduled.append((after(zero, at_s), (at_s, ends, fault, hit)))
        self._scheduled.sort(key=itemgetter(0))

    def disturb(self, keys: Disturbance, hit: frozenset[VehicleId], zero: Instant) -> None:
        """Add a disturbance of some vehicles, whose times count from `zero`."""
        try:
            added = _acting(self._config, len(self._disturbances), keys, hit, self._bodies, self.failures)
        except ExtensionError as error:
            self.failures.add(str(error))
            return
        added.zero = zero
        self._disturbances.append(added)

    def advance(self, now: Instant) -> list[Due]:
        """Update the air at every vehicle for `now`; return the faults that have become due."""
        if not (self._disturbances or self._faults or self._scheduled):
            return []
        if self._disturbances:
            self._disturb(now)
        struck: list[Due] = []
        while self._scheduled and self._scheduled[0][0] <= now:
            struck.append(self._scheduled.pop(0)[1])
        mission_zero = self.mission_zero
        if mission_zero is not None:
            mission_s = seconds_between(mission_zero, now)
            while self._faults and self._faults[0][0] <= mission_s:
                struck.append(self._faults.pop(0))
        return struck

    def _disturb(self, now: Instant) -> None:
        acting = list[tuple[Acting, float]]()
        for each in self._disturbances:
            zero = self.mission_zero if each.zero is None else each.zero
            since_s = math.nan if zero is None else seconds_between(zero, now)
            if each.keys.acts(since_s):
                acting.append((each, each.share(since_s)))
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

    def __init__(self, keys: StepDisturbance | RampDisturbance | SineDisturbance, hit: list[InAir]) -> None:
        self.keys, self._hit = keys, hit
        self.zero: Instant | None = None
        """From when times count; None: from mission time 0."""

    def share(self, mission_s: float) -> float:
        """Return the share of the velocity that acts, -1 to 1."""
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


def discretised(duration: Array) -> tuple[Array, Array]:
    """Return transition (..., 2, 2) and noise factor (..., 2, 2) of the lateral filter over `duration` times V / L.

    The filter (1 + sqrt(3) T s) / (1 + T s)^2 is p' = (n - p) / T, q' = (p - q) / T with white noise n. The factor is
    the Cholesky factor of the covariance of the integrated noise. Both are exact; in the stationary state E p^2 = 1/2,
    E p q = E q^2 = 1/4.
    """
    d = np.asarray(duration, dtype=np.float64)
    kept, lost = np.exp(-d), -np.expm1(-2 * d)
    square = np.exp(-2 * d)
    pp, pq = lost / 2, lost / 4 - square * d / 2
    qq = lost / 4 - square * (d + d**2) / 2
    factor = np.zeros((*d.shape, 2, 2))
    factor[..., 0, 0] = np.sqrt(pp)
    factor[..., 1, 0] = pq / np.sqrt(pp)
    factor[..., 1, 1] = np.sqrt(np.maximum(qq - pq**2 / pp, 0.0))
    transition = np.zeros((*d.shape, 2, 2))
    transition[..., 0, 0] = transition[..., 1, 1] = kept
    transition[..., 1, 0] = kept * d
    return transition, factor


class DrydenGusts:
    """Gusts of N vehicles, each along its own flight through the air and from its own random numbers.

    The filters' states are normalised to unit variance, so that the gusts have the right rms velocities while airspeed
    and height change. They start in the stationary state.
    """

    def __init__(
        self,
        keys: DrydenTurbulence,
        hit: list[InAir],
        streams: Sequence[np.random.Generator],
        wind_mps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Draw the gusts of `hit[i]` from `streams[i]`, with the intensity of `keys`.

        A multirotor's gusts are along and across the wind, a fixed wing's along and across its heading: a multirotor's
        course is arbitrary when it hardly moves.
        """
        self.keys, self._hit = keys, hit
        self.zero: Instant | None = None
        """From when times count; None: from mission time 0."""
        self._along_wind_rad = math.atan2(wind_mps[1], wind_mps[0])
        self._random = streams
        self._drawn: Array = np.zeros((0, DRAWS_EACH, len(streams)))
        self._next = 0
        first = self._draw()
        self._along: Array = first[0]
        p = first[1:3] * math.sqrt(1 / 2)
        self._across: Array = np.stack((p, p / 2 + first[3:5] * math.sqrt(1 / 8)))

    def share(self, mission_s: float) -> float:
        """Return the time instead of a share, so that gusts are updated at each instant."""
        return mission_s

    def add(self, share: float) -> None:  # noqa: ARG002 - gusts act in full
        """Advance the gusts by a cycle of the main loop, and add them to the vehicles' disturbances."""
        states = [body.state for body in self._hit]
        airspeed_mps, height_m = np.array([(each.airspeed_mps, each.height_m) for each in states]).T
        gusts_mps = self.advance(airspeed_mps, height_m, LOOP_S).T.tolist()
        for body, state, (forward, right, down) in zip(self._hit, states, gusts_mps, strict=True):
            axis_rad = self._along_wind_rad if body.model.may_hover else state.heading_rad
            cos, sin = math.cos(axis_rad), math.sin(axis_rad)
            _add(body, forward * cos - right * sin, forward * sin + right * cos, down)

    def advance(self, airspeed_mps: Array, height_m: Array, dt_s: float) -> Array:
        """Advance by `dt_s` and return the gusts (3, N) forward, right and down, m/s."""
        sigma_mps, length_m = self.keys.scales(height_m)
        duration = dt_s * np.maximum(airspeed_mps, MIN_AIRSPEED_MPS) / length_m
        noise = self._draw()
        kept = np.exp(-duration[0])
        self._along = kept * self._along + np.sqrt(-np.expm1(-2 * duration[0])) * noise[0]
        transition, factor = discretised(duration[1:])
        driven = np.stack((noise[1:3], noise[3:5]))
        self._across = np.einsum("anij,jan->ian", transition, self._across) + np.einsum("anij,jan->ian", factor, driven)
        right_down = SQRT3 * self._across[0] + (1 - SQRT3) * self._across[1]
        return sigma_mps * np.concatenate((self._along[None], right_down))

    def _draw(self) -> Array:
        """Return one step's standard normal variates, (5, N)."""
        if self._next == len(self._drawn):
            self._drawn = np.stack([each.standard_normal((BLOCK, DRAWS_EACH)) for each in self._random], axis=-1)
            self._next = 0
        self._next += 1
        return self._drawn[self._next - 1]


Acting: TypeAlias = "_Steady | DrydenGusts | OwnAir"


def _add(body: InAir, north_mps: float, east_mps: float, down_mps: float) -> None:
    north, east, down = body.disturbance_mps
    body.disturbance_mps = (north + north_mps, east + east_mps, down + down_mps)


def _acting(
    config: FleetConfig,
    index: int,
    keys: Disturbance,
    vehicles: frozenset[VehicleId],
    bodies: Sequence[InAir],
    failures: Failures,
) -> Acting:
    """Return the disturbance that is the `index`-th; each vehicle's gusts in each are independent.

    Raises:
        ExtensionError: one of an extension can't begin.
    """
    met_by = [
        (vehicle.identity, body)
        for vehicle, body in zip(config.vehicles, bodies, strict=True)
        if vehicle.identity in vehicles
    ]
    hit = [body for _, body in met_by]
    if isinstance(keys, OwnDisturbance):
        return OwnAir(keys, config, index, met_by, failures)
    if not isinstance(keys, DrydenTurbulence):
        return _Steady(keys, hit)
    streams = [random_stream(config.seed, "turbulence", index, *identity) for identity, _ in met_by]
    return DrydenGusts(keys, hit, streams, config.wind_mps)
