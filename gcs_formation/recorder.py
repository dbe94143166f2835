"""The interface between the station and its recorder: the station reports, the recorder stores."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.tick import Tick
from gcs_formation.vehicle.vehicle import Vehicle

Detail = str | int | float | bool | None
GiveUp = Callable[[str, Instant], None]
"""Ends a run that can't go on, with the reason."""


@dataclass(frozen=True)
class Event:
    """Something that happened, in words and figures."""

    now: Instant
    kind: str
    text: str
    vehicle: VehicleId | None = None
    details: Mapping[str, Detail] = field(default_factory=dict[str, Detail])


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
