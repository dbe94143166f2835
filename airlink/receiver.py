"""Parses the datagrams of many remotes, each as a stream of its own."""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from airlink.clock import Instant
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.stream_parser import MAX_REFUSED, ParserCounts, StreamParser

MAX_REMOTES: Final = 1024
"""Largest number of addresses with parsers. The longest silent one is dropped first, so strangers can't fill memory."""
MANY_REMOTES: Final = MAX_REMOTES // 2
"""With more addresses, the order in which they were last received is kept."""


class Receiver:
    """Parses the datagrams of every remote, and counts dropped frames."""

    def __init__(self) -> None:
        """Start with no remote known."""
        self._parsers: OrderedDict[Address, dict[int, StreamParser]] = OrderedDict()
        """By address and by the socket that it sends to."""
        self._forgotten = ParserCounts()
        self._last_socket, self._last_peer = -1, Address("", 0)
        self._last = StreamParser()
        """Parser of the remote received last: several datagrams in a row come from it."""

    def first(self, datagram: Datagram, now: Instant) -> Frame | None:  # noqa: ARG002 - links with a key go by it
        """Return the first of the frames that a datagram completes, linked to the others; None if there is none."""
        if datagram.peer is not self._last_peer or datagram.socket != self._last_socket:
            self._last = self._parser(datagram.socket, datagram.peer)
            self._last_socket, self._last_peer = datagram.socket, datagram.peer
        return self._last.first(datagram.data)

    def _parser(self, socket: int, peer: Address) -> StreamParser:
        of_peer = self._parsers.get(peer)
        if of_peer is None:
            of_peer = self._parsers[peer] = {}
            if len(self._parsers) > MAX_REMOTES:
                for forgotten in self._parsers.popitem(last=False)[1].values():
                    self._forgotten += forgotten.counts
        elif len(self._parsers) > MANY_REMOTES:
            self._parsers.move_to_end(peer)
        parser = of_peer.get(socket)
        if parser is None:
            parser = of_peer[socket] = StreamParser(MAX_REFUSED)
        return parser

    def counts(self, socket: int, peer: Address | None) -> ParserCounts:
        """Return a remote's statistics, zeros if it was never received from."""
        of_peer = None if peer is None else self._parsers.get(peer)
        parser = None if of_peer is None else of_peer.get(socket)
        return ParserCounts() if parser is None else parser.counts

    def total(self) -> ParserCounts:
        """Return the statistics of all remotes together."""
        parsers = (parser for of_peer in self._parsers.values() for parser in of_peer.values())
        return sum((parser.counts for parser in parsers), self._forgotten)
