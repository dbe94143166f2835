"""An order that a vehicle acknowledged, against what its heartbeats show after that."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.telemetry import Telemetry

SHOWN_WITHIN_S = 2.0
SHOWN_IN_HEARTBEATS = 2
"""An order that neither this time nor so many heartbeats after its acknowledgement show isn't obeyed."""


class Promise(NamedTuple):
    """What an obeyed order shows."""

    words: str
    shown: Callable[[Telemetry], object]
    value: object


class Broken(NamedTuple):
    """An acknowledged order that isn't obeyed."""

    words: str
    after_s: float


class Orders:
    """The last acknowledged order of a vehicle, until it shows, or somebody else's does."""

    def __init__(self) -> None:
        """Start with none."""
        self.broken: Broken | None = None
        self._promise: Promise | None = None
        self._since = Instant(0)
        self._before: object = None
        self._heartbeats = 0

    def acknowledged(self, promise: Promise, seen: Telemetry, now: Instant) -> None:
        """Take an order; it takes the place of the one before."""
        self._promise, self._since = promise, now
        self._before, self._heartbeats = promise.shown(seen), seen.heartbeats

    def judge(self, seen: Telemetry, now: Instant) -> None:
        """Look whether the order shows. Where neither it does nor what was before, the pilot has changed it."""
        promise = self._promise
        if promise is None:
            return
        shown = promise.shown(seen)
        if shown in (promise.value, None) or shown != self._before:
            self._promise = self.broken = None
            return
        waited_s = seconds_between(self._since, now)
        if waited_s >= SHOWN_WITHIN_S and seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS:
            self.broken = self.broken or Broken(promise.words, waited_s)


class UnbrokenRun:
    """Since when something has come again and again, without longer gaps than are told."""

    def __init__(self) -> None:
        """Start with nothing come."""
        self._since: Instant | None = None
        self._last = Instant(0)
        self._gap_s = 0.0

    def note(self, now: Instant) -> None:
        """Take one that has come now."""
        if self._since is None or seconds_between(self._last, now) > self._gap_s:
            self._since = now
        self._last = now

    def since(self, now: Instant, gap_s: float) -> Instant | None:
        """Return when the run began that goes on now, None when none does; `gap_s` counts from the first call on."""
        self._gap_s = gap_s
        return None if seconds_between(self._last, now) > gap_s else self._since
