"""Parses datagrams into frames, with a stream parser for each remote."""

from __future__ import annotations

from collections import OrderedDict

from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame, ParserCounts, StreamParser

MAX_REMOTES = 1024
"""Parsers that are kept. The remote silent longest is forgotten first, so strangers can't fill the memory."""


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
