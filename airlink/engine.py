"""The interface between a protocol engine and the driver that moves its datagrams; a queue of what is in transit.

An engine never reads a clock, opens a socket or sleeps.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Generic, Protocol, TypeVar

from airlink.clock import Instant
from airlink.endpoint import Address, Endpoint

T = TypeVar("T")


class Datagram:
    """A UDP payload at one of an engine's sockets, with the address at the other end; it isn't changed."""

    __slots__ = ("data", "peer", "socket")

    def __init__(self, socket: int, peer: Address, data: bytes) -> None:
        """Take the payload; `socket` is an index into the engine's `endpoints()`."""
        self.socket = socket
        self.peer = peer
        self.data = data

    @property
    def remote(self) -> tuple[int, Address]:
        """The socket, and the address at the other end."""
        return self.socket, self.peer

    def __eq__(self, other: object) -> bool:
        """Return whether all three are the same."""
        return isinstance(other, Datagram) and (self.remote, self.data) == (other.remote, other.data)

    def __hash__(self) -> int:
        """Return a hash of all three."""
        return hash((self.remote, self.data))


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


class DelayQueue(Generic[T]):
    """Items, each with the instant at which it comes out; items of one instant come out first in, first out."""

    def __init__(self) -> None:
        """Start empty."""
        self._items: list[tuple[Instant, int, T]] = []
        self._count = 0

    def push(self, instant: Instant, item: T) -> None:
        """Add an item that comes out at `instant`."""
        heappush(self._items, (instant, self._count, item))
        self._count += 1

    def pop_due(self, now: Instant) -> list[T]:
        """Remove and return the items that have come out by `now`."""
        due: list[T] = []
        while self._items and self._items[0][0] <= now:
            due.append(heappop(self._items)[2])
        return due

    def next(self) -> Instant | None:
        """Return when the next item comes out, None if the queue is empty."""
        return self._items[0][0] if self._items else None
