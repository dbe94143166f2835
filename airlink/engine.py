"""The interface between a protocol engine and the driver that moves its datagrams.

An engine never reads a clock, opens a socket or sleeps.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

from airlink.clock import Instant
from airlink.endpoint import Address, Endpoint


class Datagram(NamedTuple):
    """A UDP payload at one of an engine's sockets, with the address at the other end."""

    socket: int
    """Index into the engine's `endpoints()`."""
    peer: Address
    data: bytes


class Engine(Protocol):
    """A ground station or a fleet of vehicles, driven by `receive` and `handle_timer`.

    After the calls of an instant the driver takes what `datagrams_to_send` gives and arms one timer at `next_timer`.
    """

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets that the engine needs; `Datagram.socket` is an index into them."""
        ...

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Take a datagram that arrived at `now`. Never raises, whatever the bytes."""
        ...

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        ...

    def next_timer(self) -> Instant | None:
        """Return when to call `handle_timer`, None if never."""
        ...

    def handle_timer(self, now: Instant) -> None:
        """Do what is due at `now`."""
        ...
