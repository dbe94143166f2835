"""What heartbeats show after a command has been carried out."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from gcs_formation.vehicle.telemetry import Telemetry


class Effect(NamedTuple):
    """What heartbeats show after a command has been carried out."""

    description: str
    shown: Callable[[Telemetry], int | None]
    """Reads what the command changes from telemetry: the mode, or whether the vehicle is armed."""
    expected: int


def mode_shown(seen: Telemetry) -> int | None:
    """Return the mode, numbered as in heartbeats."""
    return seen.custom_mode


def armed_shown(seen: Telemetry) -> bool | None:
    """Return whether it is armed; None before the first heartbeat."""
    return seen.armed if seen.heartbeat else None
