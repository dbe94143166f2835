"""The interface between the station and its recorder: the station reports, the recorder stores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask
from gcs_formation.estimation.flight_state import FlightStates, Setpoints
from gcs_formation.vehicle.vehicle import Vehicle

Detail = str | int | float | bool | None


@dataclass(frozen=True)
class Event:
    """Something that happened, in words and figures."""

    now: Instant
    kind: str
    text: str
    vehicle: VehicleId | None = None
    details: Mapping[str, Detail] = field(default_factory=dict[str, Detail])


@dataclass(frozen=True)
class Tick:
    """One control tick, in arrays of C columns; column 0 is the scenario's leader, real or virtual."""

    now: Instant
    mission_time_s: float
    """NaN before the path has begun."""
    phase: str
    leader: int
    """The column that leads."""
    state: FlightStates
    """What the law acted on: predicted to when the setpoints act."""
    setpoints: Setpoints
    age_s: Array
    delay_s: Array
    """One-way delay as measured, half the round trip, (C,)."""
    ways_s: Array
    """Delay up and down, (C, 2); NaN where it isn't known how the round trip is split."""
    jitter_s: Array
    """Interarrival jitter of the telemetry, (C,)."""
    margin_used: Array
    """Share of the delay margin that the loops use, (C,)."""
    active: Mask
    """Which columns were commanded, (C,)."""
    airborne: Mask
    """Which columns fly as far as the station knows, (C,)."""
    yielding: Mask
    """Which columns' setpoints are the separation rule's, not the law's, (C,)."""
    slots_m: Array
    error_m: Array
    mixed: Array
    gains: Array
    """k_p, k_i, k_d of the three channels, (C, 9). NaN for the leader; so are slots, errors, mixed errors, (C, 3)."""


class Recorder(Protocol):
    """Stores what the station reports."""

    def frame(self, now: Instant, raw: bytes) -> None:
        """Keep a frame that came in or went out."""
        ...

    def tick(self, tick: Tick) -> None:
        """Keep a control tick."""
        ...

    def event(self, event: Event) -> None:
        """Keep an event."""
        ...


class Note(Protocol):
    """Reports an event, of a vehicle or of the run."""

    def __call__(
        self,
        now: Instant,
        kind: str,
        text: str,
        vehicle: Vehicle | None = None,
        details: Mapping[str, Detail] | None = None,
    ) -> None:
        """Record it."""
        ...


class GiveUp(Protocol):
    """Ends a run that can't go on, with the reason."""

    def __call__(self, text: str, now: Instant) -> None:
        """End the run."""
        ...
