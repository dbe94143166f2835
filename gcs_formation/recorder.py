"""What the station tells its recorder. The station decides what happened; the recorder, where it's kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from airlink.clock import Instant
from airlink.identity import VehicleId
from gcs_formation.arrays import Array, Mask
from gcs_formation.estimation.flight_state import FlightState, Setpoints
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
    """One control tick: (C,) columns, the scenario's leader's or a virtual one's first."""

    now: Instant
    mission_time_s: float
    """NaN before it's known when the path begins."""
    phase: str
    leader: int
    """The column that leads."""
    state: FlightState
    """What the law acted on: predicted to when the setpoints act."""
    setpoints: Setpoints
    age_s: Array
    delay_s: Array
    """One-way delay as measured, (C,)."""
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
    """Keeps what it's told."""

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
    """Takes what happened, to a vehicle or to the run."""

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
    """Takes why a run can't go on."""

    def __call__(self, text: str, now: Instant) -> None:
        """End it."""
        ...
