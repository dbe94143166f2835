"""The interface between a protocol engine and its driver, and an in-memory network under a virtual clock.

An engine never reads a clock, opens a socket or sleeps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Final, Generic, TypeVar

from mypy_extensions import i64, mypyc_attr

from airlink.clock import Instant, VirtualClock
from airlink.endpoint import ANY_HOST, LOOPBACK, Address, Endpoint, PortError

T = TypeVar("T")
FIRST_EPHEMERAL_PORT = 49152
SHARED = frozenset({"serial", "mcast", "tcpin"})
"""Kinds of endpoints of which several may have one address."""
MANY_POPPED: Final = 64
"""So many popped items, if they are the half of all, are cut off a queue."""


@mypyc_attr(acyclic=True, free_list_len=1)
class Datagram:
    """A UDP payload at one of an engine's sockets, with the address at the other end; owned by its receiver."""

    __slots__ = ("arrived", "data", "peer", "socket")

    def __init__(self, socket: int, peer: Address, data: bytes) -> None:
        """Take the payload; `socket` is an index into the engine's `endpoints()`."""
        self.socket = socket
        self.peer = peer
        self.data = data
        self.arrived = Instant(0)
        """Arrival time, set by the receiver."""

    @property
    def remote(self) -> tuple[int, Address]:
        """The socket, and the address at the other end."""
        return self.socket, self.peer

    def __eq__(self, other: object) -> bool:
        """Return whether socket, peer and payload are the same."""
        return isinstance(other, Datagram) and (self.remote, self.data) == (other.remote, other.data)

    def __hash__(self) -> int:
        """Return a hash of socket, peer and payload."""
        return hash((self.remote, self.data))


@mypyc_attr(allow_interpreted_subclasses=True)
class Engine(ABC):
    """A ground station or a fleet of vehicles, driven by `receive` and `handle_timer`.

    After the calls of an instant the driver sends `datagrams_to_send` and arms one timer at `next_timer`.
    """

    @abstractmethod
    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets that the engine needs; `Datagram.socket` is an index into them."""

    @abstractmethod
    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Take datagrams that arrived at `now`, in their order. Never raises, whatever the bytes."""

    @abstractmethod
    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""

    @abstractmethod
    def next_timer(self) -> Instant | None:
        """Return when to call `handle_timer`, None if never."""

    @abstractmethod
    def handle_timer(self, now: Instant) -> None:
        """Do what is due at `now`."""

    def known_peers(self) -> frozenset[Address] | None:
        """Return the addresses of which everything is received; a driver limits what it reads of others. None: all."""
        return None

    def left_unread(self, octets: int) -> None:  # noqa: B027 - only an engine that limits strangers wants to know
        """Take the number of bytes that a driver has received from strangers and dropped unread."""


class _Due(Generic[T]):
    """An item of a queue."""

    __slots__ = ("instant", "item")

    def __init__(self, instant: Instant, item: T) -> None:
        self.instant: i64 = instant
        self.item = item


class DelayQueue(Generic[T]):
    """Items, each with the instant at which it is due; items due at the same instant are first in, first out.

    They are sorted, as most are due in the order in which they are pushed: so one is found without comparing objects.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._items: list[_Due[T]] = []
        self._first: i64 = 0
        """Index of the first item; those before were popped."""

    def push(self, instant: Instant, item: T) -> None:
        """Add an item that is due at `instant`."""
        items = self._items
        at: i64 = instant
        low: i64 = self._first
        high: i64 = len(items)
        if low == high or items[high - 1].instant <= at:
            items.append(_Due(instant, item))
            return
        while low < high:
            middle = (low + high) // 2
            if items[middle].instant <= at:
                low = middle + 1
            else:
                high = middle
        items.insert(low, _Due(instant, item))

    def pop_due(self, now: Instant) -> list[T]:
        """Remove and return the items that are due by `now`."""
        due: list[T] = []
        items = self._items
        at: i64 = now
        first: i64 = self._first
        end: i64 = len(items)
        while first < end and items[first].instant <= at:
            due.append(items[first].item)
            first += 1
        if first == end or (first >= MANY_POPPED and 2 * first >= end):
            del items[:first]
            first = 0
        self._first = first
        return due

    def drop(self, unwanted: Callable[[Instant, T], bool]) -> None:
        """Remove the items for which `unwanted`, called with the instant and the item, holds."""
        self._items = [each for each in self._items[self._first :] if not unwanted(Instant(each.instant), each.item)]
        self._first = 0

    def next(self) -> Instant | None:
        """Return when the next item is due, None if the queue is empty."""
        return Instant(self._items[self._first].instant) if self._first < len(self._items) else None


class _Socket:
    """A socket of an engine in memory."""

    __slots__ = ("arrived", "members", "number", "peer", "source", "target")

    def __init__(self, number: int, source: Address, arrived: list[Datagram]) -> None:
        """Take its number, the source address of its datagrams, and the list of its engine's arrived datagrams."""
        self.number = number
        self.source = source
        self.arrived = arrived
        self.peer: Address | None = None
        """Destination of its last datagram: most have the same."""
        self.target: _Socket | None = None
        """The socket listening there, None if there is none."""
        self.members: list[_Socket] = []
        """All sockets at its address, where several share it: a serial line's end, a multicast group."""


class MemoryNetwork:
    """Carries datagrams between attached engines without delay or loss, and runs their timers in order.

    A run depends only on the engines and the order in which they were attached, so it repeats byte for byte.
    """

    def __init__(self, clock: VirtualClock) -> None:
        """Run everything under `clock`."""
        self.clock = clock
        self._engines: list[Engine] = []
        self._sockets: list[list[_Socket]] = []
        self._arrived: list[list[Datagram]] = []
        """By engine, arrived datagrams that haven't been delivered to it."""
        self._listeners: dict[Address, _Socket] = {}
        self._listeners_anywhere: dict[int, _Socket] = {}
        """By port: those that listen on all interfaces."""
        self._next_port = FIRST_EPHEMERAL_PORT

    def attach(self, engine: Engine) -> None:
        """Open the engine's sockets.

        Raises:
            PortError: two engines want the same address.
        """
        index, arrived = len(self._engines), list[Datagram]()
        sockets: list[_Socket] = []
        for number, endpoint in enumerate(engine.endpoints()):
            address = self._ephemeral() if endpoint.kind in {"udpout", "tcp"} else endpoint.address
            socket = _Socket(number, _source(address), arrived)
            sockets.append(socket)
            if endpoint.kind in SHARED and address in self._listeners:
                _join(self._listeners[address], socket)
                continue
            if self._is_taken(address):
                raise PortError(f"cannot listen at {endpoint}: {address} is taken by another engine")
            self._listeners[address] = socket
            if address.host == ANY_HOST:
                self._listeners_anywhere[address.port] = socket
        self._engines.append(engine)
        self._sockets.append(sockets)
        self._arrived.append(arrived)
        for each in self._listeners.values():
            each.peer = None  # a socket may listen there now
        self._collect(index)

    def replace(self, engine: Engine, wrapped: Engine) -> None:
        """Let an engine that wraps an attached one, with its sockets, take its place; between two events."""
        self._engines[self._engines.index(engine)] = wrapped

    def run(self, until: Callable[[], bool]) -> None:
        """Run until `until` holds, or no engine has a timer left."""
        self._deliver(self.clock.now())
        while not until():
            index = self._next_timer()
            if index is None:
                return
            self._engines[index].handle_timer(self.clock.now())
            self._collect(index)
            self._deliver(self.clock.now())

    def _next_timer(self) -> int | None:
        """Move the clock to the earliest timer and return its engine; None if there is no timer."""
        first: Instant | None = None
        owner: int | None = None
        for index, engine in enumerate(self._engines):
            timer = engine.next_timer()
            if timer is not None and (first is None or timer < first):
                first, owner = timer, index
        if first is not None:
            self.clock.move_to(first)
        return owner

    def _deliver(self, now: Instant) -> None:
        """Deliver datagrams in flight, then those sent in response, and so on."""
        receivers = self._receivers()
        while receivers:
            for index in receivers:
                arrived = self._arrived[index]
                datagrams = arrived.copy()
                arrived.clear()
                self._engines[index].receive(datagrams, now)
            for index in receivers:
                self._collect(index)
            receivers = self._receivers()

    def _receivers(self) -> list[int]:
        return [index for index, arrived in enumerate(self._arrived) if arrived]

    def _collect(self, sender: int) -> None:
        """Move an engine's sent datagrams to the sockets they are for; without a listener they are lost."""
        sockets = self._sockets[sender]
        for sent in self._engines[sender].datagrams_to_send():
            socket = sockets[sent.socket]
            if sent.peer is not socket.peer:
                socket.peer = sent.peer
                socket.target = self._listeners.get(sent.peer) or self._listeners_anywhere.get(sent.peer.port)
            target = socket.target
            if target is None:
                continue
            if target.members:
                for each in target.members:
                    if each is not socket:
                        each.arrived.append(Datagram(each.number, socket.source, sent.data))
                continue
            sent.socket, sent.peer = target.number, socket.source
            target.arrived.append(sent)

    def _is_taken(self, address: Address) -> bool:
        """Return whether an address is in use; a socket on all interfaces uses its port on each of them."""
        if address.host == ANY_HOST:
            return any(each.port == address.port for each in self._listeners)
        return address in self._listeners or Address(ANY_HOST, address.port) in self._listeners

    def _ephemeral(self) -> Address:
        address = Address(LOOPBACK, self._next_port)
        while self._is_taken(address):
            address = Address(LOOPBACK, address.port + 1)
        self._next_port = address.port + 1
        return address


def _join(first: _Socket, socket: _Socket) -> None:
    """Let a socket share the address of another."""
    first.members.extend([socket] if first.members else [first, socket])
    socket.members = first.members


def _source(local: Address) -> Address:
    """Return the source address of a socket's datagrams as the other end sees it."""
    return Address(LOOPBACK, local.port) if local.host == ANY_HOST else local
