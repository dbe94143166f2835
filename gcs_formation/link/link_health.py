"""Health of a vehicle's link: its state from silence and heartbeats (stale, lost), and its jitter."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from airlink.clock import LONG_AGO, NANOSECONDS, Instant, seconds_between
from airlink.endpoint import Address
from gcs_formation.link.frame_loss import STALE_AFTER_NS, STALE_AFTER_S
from gcs_formation.link.missing_heartbeats import MUTE_AFTER_S, Heartbeats

SHARE: Final = 1 / 16
"""Weight of each new difference in the running mean. Tuned: share; 1/64 to 1/8; shown by `pytest
tests/gcs_formation/link`."""
LOST_AFTER_S: Final = 5.0
"""Silence after which a link is lost. Tuned: s; 3 to 10; shown by `pytest tests/gcs_formation/link`."""
MUTE_AFTER_NS: Final = round(MUTE_AFTER_S * NANOSECONDS)


class JitterMeter:
    """Running mean of the absolute change in transit time from sample to sample.

    For independent, normally distributed delays it is 2/sqrt(pi) standard deviations. No common clock is needed; the
    vehicle's clock drift is removed.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self.jitter_s = math.nan
        """NaN before the second sample."""
        self._sent_s, self._arrived = math.nan, Instant(0)
        """Stamp and arrival of the last sample; NaN before the first."""

    def drop_sample(self) -> None:
        """Start without a sample again: the clock of the stamps is another."""
        self.jitter_s, self._sent_s = math.nan, math.nan

    def observe(self, stamp_s: float, arrived: Instant, drift: float) -> None:
        """Take a sample: its stamp on the vehicle's clock, which gains `drift` seconds a second, and its arrival."""
        if not math.isnan(self._sent_s):
            change_s = abs((arrived - self._arrived) / NANOSECONDS - (stamp_s - self._sent_s) / (1.0 + drift))
            known_s = 0.0 if math.isnan(self.jitter_s) else self.jitter_s
            self.jitter_s = known_s + SHARE * (change_s - known_s)
        self._sent_s, self._arrived = stamp_s, arrived


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
