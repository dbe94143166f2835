"""In-memory recorders of what a part of the station reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from airlink.clock import NANOSECONDS, Instant


class LoggedEvent(NamedTuple):
    """An event, with its time in seconds and the vehicle's number."""

    at_s: float
    kind: str
    text: str
    vehicle: int | None
    details: Mapping[str, Any]


class EventLog(list[LoggedEvent]):
    """A recorder of events (`recorder.LogEvent`)."""

    def __call__(self, now: Instant, kind: str, text: str, vehicle: Any = None, details: Any = None) -> None:
        number = None if vehicle is None else vehicle.identity.system
        self.append(LoggedEvent(now / NANOSECONDS, kind, text, number, details or {}))

    def of(self, kind: str, number: int | None = None) -> list[str]:
        """Return the texts of the events of a kind, of one vehicle or of all."""
        return [each.text for each in self if each.kind == kind and number in (None, each.vehicle)]


class GivenUp(list[str]):
    """Takes the reason why a run can't go on (`recorder.GiveUp`)."""

    def __call__(self, text: str, now: Instant) -> None:
        self.append(text)
