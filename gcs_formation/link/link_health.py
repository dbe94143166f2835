"""Health of a vehicle's link: its state (stale, lost) from silence and heartbeats."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from airlink.clock import LONG_AGO, NANOSECONDS, Instant, seconds_between
from airlink.endpoint import Address
from gcs_formation.link.frame_loss import STALE_AFTER_NS, STALE_AFTER_S
from gcs_formation.link.missing_heartbeats import MUTE_AFTER_S, Heartbeats

LOST_AFTER_S: Final = 5.0
"""Silence after which a link is lost. Tuned: s; 3 to 10; shown by `pytest tests/gcs_formation/link`."""
MUTE_AFTER_NS: Final = round(MUTE_AFTER_S * NANOSECONDS)


class LinkState(Enum):
    """State of the connection to a vehicle."""

    SEARCHING = "searching"
    CONNECTED = "connected"
    MUTE = "without heartbeats"
    STALE = "stale"
    LOST = "lost"


SILENCE_LEADS_TO: Final = (
    (LinkState.STALE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, STALE_AFTER_S, LinkState.STALE),
    (LinkState.CONNECTED, LOST_AFTER_S, LinkState.LOST),
    (LinkState.CONNECTED, STALE_AFTER_S, LinkState.STALE),
)
"""State, seconds of silence, next state. A heartbeat leads from any state to CONNECTED; from MUTE only the second does,
because an autopilot whose heartbeats are switched off may still announce a change of mode by a single one."""


@dataclass
class Connection:
    """Where a vehicle was last received, and when."""

    socket: int
    peer: Address | None = None
    state: LinkState = LinkState.SEARCHING
    last_received: Instant = Instant(0)
    back_at: Instant = LONG_AGO
    """When it was last received again after LOST."""
    heartbeats: Heartbeats = field(default_factory=Heartbeats)

    def skipped(self, now: Instant) -> None:
        """Record that frames before the one received now, and after the last one, were lost."""
        self.heartbeats.record_gap(self.last_received, now)

    def record_frame(self, now: Instant, *, heartbeat: bool) -> bool:
        """Record a frame; return whether the state changed."""
        self.last_received = now
        if not heartbeat and self.state is not LinkState.STALE:
            return False
        alone = seconds_between(self.heartbeats.last, now) > MUTE_AFTER_S
        if heartbeat:
            self.heartbeats.record(now)
        else:
            self.heartbeats.last = now
        if self.state is LinkState.CONNECTED or (self.state is LinkState.MUTE and alone):
            return False
        if self.state is LinkState.LOST:
            self.back_at = now
        self.state = LinkState.CONNECTED
        return True

    def check(self, now: Instant, loss: float = 0.0) -> bool:
        """Check for silence, and for more missing heartbeats than `loss` explains; return whether the state changed."""
        if self.state is LinkState.CONNECTED and self.mute_s(loss) > 0.0:
            self.state = LinkState.MUTE
            return True
        silence_s = seconds_between(self.last_received, now)
        for state, limit_s, following in SILENCE_LEADS_TO:
            if self.state is state and silence_s > limit_s:
                self.state = following
                return True
        return False

    def in_order(self, now: Instant) -> bool:
        """Return whether frames and heartbeats are on time, without allowance for loss."""
        in_contact = now - self.last_received <= STALE_AFTER_NS
        return in_contact and not self.overdue and self.state is LinkState.CONNECTED

    @property
    def overdue(self) -> bool:
        """Whether frames are received and heartbeats aren't, without allowance for loss."""
        return self.last_received - self.heartbeats.last > MUTE_AFTER_NS

    @property
    def talks(self) -> bool:
        """Whether frames are received."""
        return self.state is LinkState.CONNECTED or self.state is LinkState.MUTE

    def mute_s(self, loss: float) -> float:
        """Return for how long heartbeats have been missing beyond what `loss` explains, s; negative if they aren't."""
        return self.heartbeats.missing_s(self.last_received, loss)
