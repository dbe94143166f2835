"""Is a vehicle there? One table says what silence and a heartbeat lead to."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from airlink.clock import Instant, seconds_between
from airlink.endpoint import Address

STALE_AFTER_S = 1.5
LOST_AFTER_S = 5.0


class LinkState(Enum):
    """What we know of a vehicle's presence."""

    SEARCHING = "searching"
    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


SILENCE_LEADS_TO = (
    (LinkState.STALE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.CONNECTED, LOST_AFTER_S, LinkState.LOST),
    (LinkState.CONNECTED, STALE_AFTER_S, LinkState.STALE),
)
"""State, seconds of silence, next state; a heartbeat leads from any state to CONNECTED."""


@dataclass
class Connection:
    """Where a vehicle was last heard, and when."""

    socket: int
    peer: Address | None = None
    state: LinkState = LinkState.SEARCHING
    last_heard: Instant = Instant(0)

    def heard(self, now: Instant, *, heartbeat: bool) -> bool:
        """Note a frame; return whether the state changed."""
        self.last_heard = now
        if self.state is LinkState.CONNECTED or not (heartbeat or self.state is LinkState.STALE):
            return False
        self.state = LinkState.CONNECTED
        return True

    def check(self, now: Instant) -> bool:
        """Judge the silence; return whether the state changed."""
        silence_s = seconds_between(self.last_heard, now)
        for state, limit_s, following in SILENCE_LEADS_TO:
            if self.state is state and silence_s > limit_s:
                self.state = following
                return True
        return False
