"""Remotes and their links: a stream parser for each, and what silence and heartbeats lead to."""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from enum import Enum
from typing import Final

from airlink.clock import NANOSECONDS, Instant, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, ParserCounts, StreamParser

STALE_AFTER_S: Final = 1.5
LOST_AFTER_S: Final = 5.0
MUTE_AFTER_S: Final = 3.5
"""Three and a half heartbeats, as is usual in ground stations."""
STALE_AFTER_NS, MUTE_AFTER_NS = round(STALE_AFTER_S * NANOSECONDS), round(MUTE_AFTER_S * NANOSECONDS)
ALL_LOST: Final = 1e-6
"""On a lossy link it takes longer: until losing all heartbeats that were due is less probable than this."""
MAX_REMOTES: Final = 1024
"""Parsers that are kept. The remote silent longest is forgotten first, so strangers can't fill the memory."""


class LinkState(Enum):
    """What is known of a vehicle's presence."""

    SEARCHING = "searching"
    CONNECTED = "connected"
    MUTE = "without heartbeats"
    STALE = "stale"
    LOST = "lost"


TALKING = frozenset({LinkState.CONNECTED, LinkState.MUTE})
"""States in which frames are received."""

SILENCE_LEADS_TO: Final = (
    (LinkState.STALE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, LOST_AFTER_S, LinkState.LOST),
    (LinkState.MUTE, STALE_AFTER_S, LinkState.STALE),
    (LinkState.CONNECTED, LOST_AFTER_S, LinkState.LOST),
    (LinkState.CONNECTED, STALE_AFTER_S, LinkState.STALE),
)
"""State, seconds of silence, next state. A heartbeat leads from any state to CONNECTED, but from MUTE only the second:
an autopilot whose heartbeats are switched off may still report a change of mode by a single one."""


@dataclass
class Connection:
    """Where a vehicle was last heard, and when."""

    socket: int
    peer: Address | None = None
    state: LinkState = LinkState.SEARCHING
    last_heard: Instant = Instant(0)
    last_heartbeat: Instant = Instant(0)
    """The last heartbeat, or when the vehicle was heard again after silence."""

    def heard(self, now: Instant, *, heartbeat: bool) -> bool:
        """Record a frame; return whether the state changed."""
        self.last_heard = now
        if not heartbeat and self.state is not LinkState.STALE:
            return False
        self.last_heartbeat, alone = now, seconds_between(self.last_heartbeat, now) > MUTE_AFTER_S
        if self.state is LinkState.CONNECTED or (self.state is LinkState.MUTE and alone):
            return False
        self.state = LinkState.CONNECTED
        return True

    def check(self, now: Instant, loss: float = 0.0) -> bool:
        """Check for silence, and for heartbeats missing beyond `loss`; return whether the state changed."""
        if self.state is LinkState.CONNECTED and self.mute_s(loss) > 0.0:
            self.state = LinkState.MUTE
            return True
        silence_s = seconds_between(self.last_heard, now)
        for state, limit_s, following in SILENCE_LEADS_TO:
            if self.state is state and silence_s > limit_s:
                self.state = following
                return True
        return False

    def in_order(self, now: Instant) -> bool:
        """Return whether frames and heartbeats come as they should, whatever the loss."""
        heard = now - self.last_heard <= STALE_AFTER_NS
        return heard and self.last_heard - self.last_heartbeat <= MUTE_AFTER_NS and self.state is LinkState.CONNECTED

    def mute_s(self, loss: float) -> float:
        """Return for how long heartbeats have been missing beyond what `loss` explains, s; negative if they aren't."""
        due_s = math.log(ALL_LOST) / math.log(loss) if 0.0 < loss < 1.0 else 0.0
        return seconds_between(self.last_heartbeat, self.last_heard) - max(MUTE_AFTER_S, due_s)


class Receiver:
    """Parses the datagrams of every remote, and counts what was dropped."""

    def __init__(self) -> None:
        """Start with no remote known."""
        self._parsers: OrderedDict[tuple[int, Address], StreamParser] = OrderedDict()
        self._forgotten = ParserCounts()

    def frames(self, datagram: Datagram) -> list[Frame]:
        """Return the frames that the datagram completes."""
        remote = (datagram.socket, datagram.peer)
        parser = self._parsers.get(remote)
        if parser is None:
            parser = self._parsers[remote] = StreamParser()
            if len(self._parsers) > MAX_REMOTES:
                self._forgotten += self._parsers.popitem(last=False)[1].counts
        else:
            self._parsers.move_to_end(remote)
        return parser.feed(datagram.data)

    def counts(self, socket: int, peer: Address | None) -> ParserCounts:
        """Return what has come from a remote, zeros for one that was never heard."""
        parser = self._parsers.get((socket, peer)) if peer else None
        return parser.counts if parser else ParserCounts()

    def total(self) -> ParserCounts:
        """Return what has come from all remotes."""
        return sum((parser.counts for parser in self._parsers.values()), self._forgotten)
