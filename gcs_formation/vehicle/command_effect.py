"""Whether an acknowledged command takes effect: what the vehicle's heartbeats show after it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from airlink.clock import Instant, seconds_between
from gcs_formation.vehicle.telemetry import Telemetry

SHOWN_WITHIN_S = 2.0
SHOWN_IN_HEARTBEATS = 2
"""A command has no effect when both this time and so many heartbeats have passed since its acknowledgement."""


class Effect(NamedTuple):
    """What heartbeats show once a vehicle has carried out a command."""

    description: str
    shown: Callable[[Telemetry], object]
    """Reads from telemetry what the command changes: the mode, or whether the vehicle is armed."""
    expected: object


class MissingEffect(NamedTuple):
    """A command that was acknowledged and not carried out."""

    description: str
    after_s: float


class EffectWatch:
    """Watches the last command that a vehicle acknowledged until it takes effect, or somebody else's does."""

    def __init__(self) -> None:
        """Start with no command."""
        self.missing: MissingEffect | None = None
        self._effect: Effect | None = None
        self._since = Instant(0)
        self._before: object = None
        self._heartbeats = 0

    def acknowledged(self, effect: Effect, seen: Telemetry, now: Instant) -> None:
        """Watch for the effect of a command that has just been acknowledged, instead of the one before it."""
        self._effect, self._since = effect, now
        self._before, self._heartbeats = effect.shown(seen), seen.heartbeats

    def judge(self, seen: Telemetry, now: Instant) -> None:
        """Update `missing`. A state that is neither the expected one nor the one before is the pilot's choice."""
        effect = self._effect
        if effect is None:
            return
        shown = effect.shown(seen)
        if shown in (effect.expected, None) or shown != self._before:
            self._effect = self.missing = None
            return
        waited_s = seconds_between(self._since, now)
        if waited_s >= SHOWN_WITHIN_S and seen.heartbeats >= self._heartbeats + SHOWN_IN_HEARTBEATS:
            self.missing = self.missing or MissingEffect(effect.description, waited_s)
