"""What a protocol engine offers to whatever moves its datagrams: no clock, no socket, no sleep inside."""

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

    After each call the driver takes what `datagrams_to_send` gives and arms one timer at `next_timer`.
    """

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets that the engine wants, in the order of `Datagram.socket`."""
        ...

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Take a datagram that arrived at `now`. Never raises, whatever the bytes."""
        ...

    def datagrams_to_send(self) -> list[Datagram]:
        """Return what is to be sent now, and forget it."""
        ...

    def next_timer(self) -> Instant | None:
        """Return when `handle_timer` is wanted, None when never."""
        ...

    def handle_timer(self, now: Instant) -> None:
        """Do what is due at `now`."""
        ...
