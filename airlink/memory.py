"""A network in memory under a virtual clock, as fast as the processor allows."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from airlink.clock import Instant, VirtualClock
from airlink.endpoint import ANY_HOST, LOOPBACK, Address
from airlink.engine import Datagram, Engine
from airlink.errors import PortError

FIRST_EPHEMERAL_PORT = 49152


class MemoryNetwork:
    """Carries datagrams between attached engines without delay or loss, and runs their timers in order.

    A run depends only on the engines and the order in which they were attached, so it repeats byte for byte.
    """

    def __init__(self, clock: VirtualClock) -> None:
        """Run everything under `clock`."""
        self.clock = clock
        self._engines: list[Engine] = []
        self._addresses: list[list[Address]] = []
        self._listeners: dict[Address, tuple[int, int]] = {}
        self._in_flight: deque[tuple[int, Datagram]] = deque()
        self._next_port = FIRST_EPHEMERAL_PORT

    def attach(self, engine: Engine) -> None:
        """Open the engine's sockets.

        Raises:
            PortError: two engines want the same address.
        """
        index = len(self._engines)
        addresses: list[Address] = []
        for socket, endpoint in enumerate(engine.endpoints()):
            address = endpoint.address if endpoint.kind == "udpin" else self._ephemeral()
            if self._is_taken(address):
                raise PortError(f"cannot listen at {endpoint}: {address} is taken by another engine")
            self._listeners[address] = (index, socket)
            addresses.append(address)
        self._engines.append(engine)
        self._addresses.append(addresses)
        self._collect(index)

    def run(self, until: Callable[[], bool]) -> None:
        """Run until `until` holds, or no engine has a timer left."""
        self._deliver(self.clock.now())
        while not until():
            timers = [(engine.next_timer(), index) for index, engine in enumerate(self._engines)]
            due = [(timer, index) for timer, index in timers if timer is not None]
            if not due:
                return
            instant, index = min(due)
            self.clock.move_to(instant)
            self._engines[index].handle_timer(self.clock.now())
            self._collect(index)
            self._deliver(self.clock.now())

    def _deliver(self, now: Instant) -> None:
        while self._in_flight:
            index, datagram = self._in_flight.popleft()
            self._engines[index].receive(datagram, now)
            self._collect(index)

    def _collect(self, sender: int) -> None:
        for socket, peer, data in self._engines[sender].datagrams_to_send():
            target = self._listeners.get(peer) or self._listeners.get(Address(ANY_HOST, peer.port))
            if target is not None:
                index, target_socket = target
                source = _source(self._addresses[sender][socket])
                self._in_flight.append((index, Datagram(target_socket, source, data)))

    def _is_taken(self, address: Address) -> bool:
        """Return whether an address is in use; a socket on all interfaces uses its port on each of them."""
        if address.host == ANY_HOST:
            return any(port == address.port for _, port in self._listeners)
        return address in self._listeners or Address(ANY_HOST, address.port) in self._listeners

    def _ephemeral(self) -> Address:
        address = Address(LOOPBACK, self._next_port)
        while self._is_taken(address):
            address = Address(LOOPBACK, address.port + 1)
        self._next_port = address.port + 1
        return address


def _source(local: Address) -> Address:
    """Return the address from which the other end sees a socket's datagrams come."""
    return Address(LOOPBACK, local.port) if local.host == ANY_HOST else local
