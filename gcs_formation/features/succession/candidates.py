"""Which follower succeeds a lost leader."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple, Self

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.vehicle import Vehicle

RECEIVED_S: Final = 1.0
"""Largest age of a successor's telemetry, and of the latest time at which it is known to receive. Tuned: s; 0.5 to 2;
shown by `pytest tests/gcs_formation/features/succession`."""
DELAY_STEP_S, LOSS_STEP, JITTER_STEP_S = 0.02, 0.02, 0.005
"""Links that differ by less than about this are equally good: the measurements are no more certain."""


class Candidate(NamedTuple):
    """A follower that could become the leader."""

    vehicle_index: int
    distance_m: float
    """Distance from the leader's position."""
    delay_s: float
    """One-way delay; NaN while unknown, as is `jitter_s`."""
    loss: float
    jitter_s: float

    @classmethod
    def of(cls, index: int, vehicle: Vehicle, distance_m: float) -> Self:
        """Return a vehicle with its measured link."""
        return cls(index, distance_m, vehicle.clock.one_way_s, vehicle.sequence.loss, vehicle.jitter.jitter_s)


def can_lead(vehicle: Vehicle, age_s: float, now: Instant) -> bool:
    """Return whether a vehicle receives, and is received, with a state `age_s` old."""
    receives = seconds_between(vehicle.round_trips.received_at(now), now) <= RECEIVED_S
    return receives and age_s <= RECEIVED_S


def best_successor(candidates: Iterable[Candidate], spacing_m: float) -> int | None:
    """Return the index of the best successor, None if there is no candidate.

    Candidates are at most `spacing_m` farther from the leader's position than the nearest one. Among these the least
    delay decides, then the least loss, jitter and distance (to a metre), and the lowest index.
    """
    known = tuple(candidates)
    nearest_m = min((each.distance_m for each in known), default=0.0)
    suited = (each for each in known if each.distance_m <= nearest_m + spacing_m)
    best = min(suited, key=_rank, default=None)
    return None if best is None else best.vehicle_index


def _rank(each: Candidate) -> tuple[float, ...]:
    link = (each.delay_s, DELAY_STEP_S), (each.loss, LOSS_STEP), (each.jitter_s, JITTER_STEP_S)
    return *(_steps(*figure) for figure in link), round(each.distance_m), each.vehicle_index


def _steps(value: float, step: float) -> float:
    return math.inf if math.isnan(value) else round(value / step)
