"""Is a vehicle there? One table says what silence and a heartbeat lead to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from airlink.clock import Instant, seconds_between
from airlink.endpoint import Address

STALE_AFTER_S = 1.5
LOST_AFTER_S = 5.0
MUTE_AFTER_S = 3.5
"""Three heartbeats and a half, as ground stations have it."""
ALL_LOST = 1e-6
"""More heartbeats than that where a link loses frames: this is how likely it is to lose all that were due."""


class LinkState(Enum):
    """What we know of a vehicle's presence."""

    SEARCHING = "searching"
    CONNECTED = "connected"
    MUTE = "without heartbeats"
    STALE = "stale"
    LOST = "lost"


TALKING = frozenset({LinkState.CONNECTED, LinkState.MUTE})
"""States in which frames come."""

SILENCE_LEADS_TO = (
    (LinkState.STALE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, STALE_AFTER_S, LinkState.STALE),
    (LinkState.CONNECTED, LOST_AFTER_S, LinkState.LOST),
    (LinkState.CONNECTED, STALE_AFTER_S, LinkState.STALE),
)
"""State, seconds of silence, next state; a heartbeat leads from any state to CONNECTED, from MUTE the second one: an
autopilot that sends none may yet tell a change of mode by one."""


@dataclass
class Connection:
    """Where a vehicle was last heard, and when."""

    socket: int
    peer: Address | None = None
    state: LinkState = LinkState.SEARCHING
    last_heard: Instant = Instant(0)
    last_heartbeat: Instant = Instant(0)
    """Or when it began to be heard again."""

    def heard(self, now: Instant, *, heartbeat: bool) -> bool:
        """Note a frame; return whether the state changed."""
        self.last_heard, alone = now, seconds_between(self.last_heartbeat, now) > MUTE_AFTER_S
        if not heartbeat and self.state is not LinkState.STALE:
            return False
        self.last_heartbeat = now
        if self.state is LinkState.CONNECTED or (self.state is LinkState.MUTE and alone):
            return False
        self.state = LinkState.CONNECTED
        return True

    def check(self, now: Instant, loss: float = 0.0) -> bool:
        """Judge the silence, of heartbeats alone too where a share of all is lost; return whether the state changed."""
        if self.state is LinkState.CONNECTED and self.mute_s(loss) > 0.0:
            self.state = LinkState.MUTE
            return True
        silence_s = seconds_between(self.last_heard, now)
        for state, limit_s, following in SILENCE_LEADS_TO:
            if self.state is state and silence_s > limit_s:
                self.state = following
                return True
        return False

    def mute_s(self, loss: float) -> float:
        """Return for how many seconds heartbeats that were due are missing; negative while they may yet come."""
        due_s = math.log(ALL_LOST) / math.log(loss) if 0.0 < loss < 1.0 else 0.0
        return seconds_between(self.last_heartbeat, self.last_heard) - max(MUTE_AFTER_S, due_s)
