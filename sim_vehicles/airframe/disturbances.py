"""Disturbances: velocities that the air has at some vehicles, for a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from airlink.random_streams import random_stream
from formation_scenario.surroundings import (
    Disturbance,
    DrydenTurbulence,
    OwnDisturbance,
    RampDisturbance,
    SineDisturbance,
    StepDisturbance,
)
from sim_vehicles.airframe.in_air import InAir
from sim_vehicles.airframe.own_air import OwnAir
from sim_vehicles.airframe.turbulence import DrydenGusts
from sim_vehicles.config import FleetConfig
from sim_vehicles.outside import Failures


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
            body.disturb(share * north_mps, share * east_mps, share * down_mps)


Acting: TypeAlias = "_Steady | DrydenGusts | OwnAir"


def acting(
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
