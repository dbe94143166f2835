"""Drives one engine with transports and the real clock."""

from __future__ import annotations

import selectors
import time
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Final, Self

from airlink.clock import RealClock
from airlink.endpoint import AirlinkError, Endpoint
from airlink.engine import Datagram, Engine
from airlink.stranger_limit import StrangerLimit
from airlink.transports.opening import open_transport
from airlink.transports.transport import Transport
from airlink.transports.udp import BATCH, Inbox

PORTION: Final = 4096
"""Bytes from one socket that an engine gets before the next one's turn: more than any MAVLink sender packs."""
DATAGRAM_COST: Final = 32
"""Bytes added to the size of each datagram for that."""
PATIENCE_NS: Final = 20_000_000
MAX_PATIENCE_NS: Final = 1_000_000_000
"""Limits of how long a due timer waits until arrived datagrams are passed on; between them, as long as the process was
held up."""
IDLE_WAIT_S: Final = 0.1
IDLE_WAIT_NS: Final = 100_000_000
SELECTOR_RESOLUTION_S: Final = 1e-3


def select_for(selector: selectors.BaseSelector, wait_s: float) -> list[tuple[selectors.SelectorKey, int]]:
    """Return what is ready, after `wait_s` at the latest.

    The selector rounds its timeout up to milliseconds; the last millisecond is slept instead. If the process was
    stopped until the timeout expired, the selector doesn't check for data again, so it is polled once more.
    """
    coarse_s = max(0.0, wait_s - SELECTOR_RESOLUTION_S)
    ready = selector.select(coarse_s)
    if not ready and wait_s > 0:
        if coarse_s == 0.0:
            time.sleep(wait_s)
        ready = selector.select(0)
    return ready


class Driver:
    """Moves an engine's datagrams through transports and calls its timer, in the calling thread.

    Endpoints that are equal share a transport: each of the engine's sockets there gets what arrives. Transports are
    read in turns and in portions, with timers in between, so that a flood at one of them stops neither the others nor
    the timers. Engines detect timeouts at timers, so all transports are read before a due timer is handled. Of
    addresses that the engine doesn't know only a limited amount is passed on.
    """

    def __init__(self, engine: Engine, clock: RealClock, from_ports: Mapping[str, int] | None = None) -> None:
        """Open the engine's endpoints; `from_ports`: local ports of `udpout` endpoints in an earlier process.

        Raises:
            PortError: one of them can't be opened; none is left open.
        """
        self._engine = engine
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._transports: list[Transport] = []
        """By the engine's socket."""
        self._others: dict[int, list[int]] = {}
        """Further sockets that share a transport, by the first."""
        self._maintained: list[Transport] = []
        self._held: dict[int, deque[Datagram]] = {}
        """By socket, datagrams taken from it but not yet passed to the engine."""
        self._attended_ns = time.monotonic_ns()
        """When the last timer was handled."""
        self._strangers = StrangerLimit(self._attended_ns)
        try:
            self._open(engine.endpoints(), from_ports or {})
        except AirlinkError:
            self.close()
            raise

    def _open(self, endpoints: tuple[Endpoint, ...], from_ports: Mapping[str, int]) -> None:
        inbox, first = Inbox(), dict[Endpoint, int]()
        for index, endpoint in enumerate(endpoints):
            owner = index if endpoint.kind == "udpout" else first.setdefault(endpoint, index)
            if owner != index:
                self._transports.append(self._transports[owner])
                self._others.setdefault(owner, []).append(index)
                continue
            opened = open_transport(endpoint, inbox, from_ports.get(str(endpoint), 0))
            self._transports.append(opened)
            opened.register(self._selector, index)
            if opened.maintained:
                self._maintained.append(opened)

    @property
    def from_ports(self) -> dict[str, int]:
        """Local port of each `udpout` endpoint, to which its peer replies."""
        each = zip(self._engine.endpoints(), self._transports, strict=True)
        ports = {str(endpoint): opened.local_port for endpoint, opened in each if endpoint.kind == "udpout"}
        return {endpoint: port for endpoint, port in ports.items() if port is not None}

    def __enter__(self) -> Self:
        """Return the driver."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the transports."""
        self.close()

    def close(self) -> None:
        """Close the transports."""
        for opened in self._transports:
            opened.close()
        self._selector.close()

    def replace(self, engine: Engine) -> None:
        """Let an engine that wraps this driver's, with its sockets, take its place; between two events."""
        self._engine = engine

    def run(self, until: Callable[[], bool]) -> None:
        """Run until `until` holds; it is checked after every timer, and ten times a second at least."""
        self._send()
        while not until():
            self._go_on()

    def _go_on(self) -> None:
        """Move datagrams until a timer was handled, or for `IDLE_WAIT_S`."""
        ends_ns = time.monotonic_ns() + IDLE_WAIT_NS
        while True:
            timer = self._engine.next_timer()
            wait_s = IDLE_WAIT_S if timer is None else min(self._clock.wall_seconds_until(timer), IDLE_WAIT_S)
            for each in self._maintained:
                each.maintain(time.monotonic_ns())
            self._pass_on(wait_s)
            attended = self._handle_due_timer()
            self._send()
            if attended or time.monotonic_ns() >= ends_ns:
                return

    def _handle_due_timer(self) -> bool:
        """Handle the timer if it is due, after passing on arrived datagrams; return whether it was."""
        timer, now = self._engine.next_timer(), self._clock.now()
        if timer is None or timer > now:
            return False
        begun_ns = time.monotonic_ns()
        late_ns = int((now - timer) / self._clock.speedup)
        held_up_ns = min(late_ns, begun_ns - self._attended_ns)
        ends_ns = begun_ns + min(max(held_up_ns, PATIENCE_NS), MAX_PATIENCE_NS)
        while self._pass_on(0.0) and time.monotonic_ns() < ends_ns:
            pass
        self._engine.handle_timer(self._clock.now())
        self._attended_ns = time.monotonic_ns()
        return True

    def _pass_on(self, wait_s: float) -> bool:
        """Pass a portion of each socket's datagrams to the engine, after waiting `wait_s` at most.

        Return whether more may have arrived before the sockets were read.
        """
        more, arrived = False, list[Datagram]()
        for key, _ in select_for(self._selector, 0.0 if self._held else wait_s):
            index: int = key.data
            if index in self._held:
                more = True
                continue
            taken = self._transports[index].drain(index, BATCH)
            more = more or len(taken) == BATCH
            taken = self._read(taken)
            if index in self._others:
                taken = [Datagram(to, each.peer, each.data) for each in taken for to in (index, *self._others[index])]
            if DATAGRAM_COST * len(taken) + sum([len(each.data) for each in taken]) <= PORTION:
                arrived += taken
            else:
                self._held[index] = deque(taken)
        for index in list(self._held):
            _move_portion(self._held[index], arrived)
            if not self._held[index]:
                del self._held[index]
        if arrived:
            self._engine.receive(arrived, self._clock.now())
        return more or len(self._held) > 0

    def _read(self, taken: list[Datagram]) -> list[Datagram]:
        """Return the datagrams to pass on: all from known addresses, and as many of strangers as are read."""
        known = self._engine.known_peers()
        if known is None:
            return taken
        now_ns, unread, found = time.monotonic_ns(), 0, list[Datagram]()
        for each in taken:
            if each.peer in known or self._strangers.admits(each.peer, len(each.data), now_ns):
                found.append(each)
            else:
                unread += len(each.data)
        if unread:
            self._engine.left_unread(unread)
        return found

    def _send(self) -> None:
        for each in self._engine.datagrams_to_send():
            self._transports[each.socket].send(each.data, each.peer)


def _move_portion(held: deque[Datagram], arrived: list[Datagram]) -> None:
    """Move a portion of the held datagrams to the arrived ones; a datagram longer than a portion is split."""
    room = PORTION
    while held and room > 0:
        datagram = held.popleft()
        if len(datagram.data) > PORTION:
            socket_index, peer, data = datagram.socket, datagram.peer, datagram.data
            held.appendleft(Datagram(socket_index, peer, data[PORTION:]))
            datagram = Datagram(socket_index, peer, data[:PORTION])
        room -= DATAGRAM_COST + len(datagram.data)
        arrived.append(datagram)
