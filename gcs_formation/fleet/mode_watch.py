"""Whether somebody else has changed the mode of a vehicle that had obeyed our commands.

While vehicles follow setpoints every mode but the guided one is a pilot's (gcs_formation/fleet/membership_table.py). At
the flight's end they circle, go home or land in several modes; there a pilot is recognised by the change.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.vehicle.command_delivery import Outcome
from gcs_formation.vehicle.vehicle import Vehicle

SETTLES: Final = 2
"""Heartbeats after which a mode counts: one may have left before the command acted, or just after a restart."""


class ObeyedMode(NamedTuple):
    """A mode that a vehicle is in by our commands."""

    lists: int
    """Number of lists of commands begun by then: another one may change the mode again."""
    mode: int
    heartbeats: int
    """Heartbeats received when it was shown first."""
    changed_at: int | None = None
    """Heartbeats received when another mode was shown instead."""


class ModeWatch:
    """Watches the modes of vehicles in the air whose commands are carried out."""

    def __init__(self) -> None:
        """Start without any."""
        self._obeyed = dict[VehicleId, ObeyedMode]()

    def is_taken_over(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether a vehicle has been in another mode for two heartbeats than the one that we brought it into."""
        seen, mode, lists = vehicle.telemetry, vehicle.telemetry.custom_mode, vehicle.commands.lists
        vehicle.effects.update(seen, now)
        obeys = vehicle.commands.outcome is Outcome.ACCEPTED and not vehicle.effects.watching
        if mode is None or seen.boots or not obeys or not vehicle.airborne:
            self._obeyed.pop(vehicle.identity, None)
            return False
        known = self._obeyed.get(vehicle.identity)
        if known is None or known.lists != lists:
            known = ObeyedMode(lists, mode, seen.heartbeats)
        elif mode == known.mode:
            known = known._replace(changed_at=None)
        elif known.changed_at is not None:
            return seen.heartbeats >= known.changed_at + SETTLES - 1
        elif seen.heartbeats < known.heartbeats + SETTLES:
            known = ObeyedMode(lists, mode, seen.heartbeats)
        else:
            known = known._replace(changed_at=seen.heartbeats)
        self._obeyed[vehicle.identity] = known
        return False
