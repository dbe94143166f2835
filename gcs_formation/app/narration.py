"""Which events are told to a user while a flight lasts, and in which words."""

from __future__ import annotations

import math

from airlink.clock import NANOSECONDS
from airlink.identity import VehicleId
from gcs_formation.preflight import IN_ORDER
from gcs_formation.recorder import Event

QUIET = ("mode", "statustext", "ready")
"""Kinds that every start is full of. They are in events.jsonl."""
PASSING = {"link": ("stale",), "parameters": (IN_ORDER,)}
USUAL = {"link": ("connected",), "member": ("flying in formation", "starting")}
"""Words that are worth telling only after others of the kind: a link is back, a vehicle is in the formation again."""


class Narration:
    """Tells events of weight, each in a line."""

    def __init__(self) -> None:
        """Begin with vehicles of which nothing unusual has been told."""
        self._unusual = set[tuple[str, VehicleId | None]]()

    def line(self, event: Event, mission_s: float) -> str | None:
        """Return an event's line, with the mission time in s (NaN before the path); None if it has no weight."""
        if not self._has_weight(event):
            return None
        since = f"start + {event.now / NANOSECONDS:6.1f} s" if math.isnan(mission_s) else f"t     = {mission_s:6.1f} s"
        return f"{since}  {words(event)}"

    def _has_weight(self, event: Event) -> bool:
        if event.kind in QUIET or event.text in PASSING.get(event.kind, ()):
            return False
        about = event.kind, event.vehicle
        if event.text not in USUAL.get(event.kind, ()):
            self._unusual.add(about)
            return True
        was_unusual = about in self._unusual
        self._unusual.discard(about)
        return was_unusual


def words(event: Event) -> str:
    """Return an event in words: `vehicle 3, link: lost`; phases by their name and what led to them."""
    if event.kind == "phase":
        return f"{event.text}: {event.details['cause']}" if "cause" in event.details else event.text
    kind = event.kind.replace("_", " ")
    return f"{kind}: {event.text}" if event.vehicle is None else f"vehicle {event.vehicle}, {kind}: {event.text}"
