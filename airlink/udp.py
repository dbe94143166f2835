"""Drives one engine with UDP sockets and the real clock."""

from __future__ import annotations

import ctypes
import errno
import mmap
import selectors
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Final, Self

from librt.strings import read_i64_le

from airlink.clock import RealClock
from airlink.endpoint import Address, Endpoint, PortError
from airlink.engine import Datagram, Engine
from airlink.host_system import recvmmsg
from airlink.stranger_limit import StrangerLimit

MAX_DATAGRAM: Final = 65535
RECEIVE_BUFFER: Final = 4 * 1024 * 1024
"""Bytes: holds a burst of 250 vehicles' telemetry while we are busy, kernel overhead included."""
DRAIN_LIMIT: Final = 4096
"""Most datagrams taken from one socket at a time."""
BATCH: Final = 64
"""Datagrams requested by one system call."""
MAX_KNOWN: Final = 4096
"""Most senders whose addresses are kept, so that strangers can't fill memory."""
SOCKADDR_BYTES: Final = 16
"""Size of `struct sockaddr_in`: family, then port and host in network order."""
IOVEC_BYTES: Final = 16
"""Size of `struct iovec`: where a datagram goes, and how much of it."""
MMSGHDR_BYTES: Final = 64
"""Size of `struct mmsghdr`, its padding included."""
MSG_LEN_AT: Final = 56
"""Offset in it of the length of the received datagram."""
SOCKADDRS_AT: Final = BATCH * MAX_DATAGRAM
IOVECS_AT: Final = SOCKADDRS_AT + BATCH * SOCKADDR_BYTES
HEADERS_AT: Final = IOVECS_AT + BATCH * IOVEC_BYTES
ROOM: Final = HEADERS_AT + BATCH * MMSGHDR_BYTES
"""Layout of the receive buffer, and its size: a batch of datagrams, then sockaddr_in, iovec and mmsghdr of each."""
PORTION: Final = 4096
"""Bytes from one socket that an engine gets before the next one's turn: more than any MAVLink sender packs."""
DATAGRAM_COST: Final = 32
"""Bytes added to the size of each datagram for that."""
PATIENCE_NS: Final = 20_000_000
MOST_PATIENCE_NS: Final = 1_000_000_000
"""Limits of how long a due timer waits until arrived datagrams are passed on; between them, as long as the process was
held up."""
IDLE_WAIT_S: Final = 0.1
IDLE_WAIT_NS: Final = 100_000_000
SELECTOR_RESOLUTION_S: Final = 1e-3


def open_socket(endpoint: Endpoint, from_port: int = 0) -> socket.socket:
    """Return a non-blocking UDP socket: bound to the address (`udpin`), or to `from_port` or any free port (`udpout`).

    Raises:
        PortError: the address is taken or isn't this machine's.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        opened.setblocking(False)
        if endpoint.kind == "udpin":
            opened.bind(endpoint.address.pair)
        else:
            _bind(opened, from_port)
    except OSError as error:
        opened.close()
        cause = "is taken by another program" if error.errno == errno.EADDRINUSE else error.strerror
        raise PortError(f"cannot listen at {endpoint}: {endpoint.address} {cause}") from error
    return opened


def resolved(endpoint: Endpoint) -> Endpoint:
    """Return a `udpout` endpoint with its host as a number, the source address of replies; others unchanged.

    Raises:
        PortError: the host isn't known.
    """
    address = endpoint.address
    if endpoint.kind == "udpin":
        return endpoint
    try:
        return Endpoint(endpoint.kind, Address(socket.gethostbyname(address.host), address.port))
    except OSError as error:
        raise PortError(f"cannot send to {endpoint}: {error.strerror}") from error


def _bind(opened: socket.socket, port: int) -> None:
    try:
        opened.bind(("", port))
    except OSError:
        opened.bind(("", 0))


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


class Inbox:
    """Receives datagrams from UDP sockets; on Linux a batch with one system call (recvmmsg(2))."""

    def __init__(self) -> None:
        """Make room for a batch."""
        self._known = dict[bytes, Address]()
        """Addresses of senders, by the kernel's sockaddr_in."""
        self._receive: Any = recvmmsg()
        if self._receive is not None:
            self._make_room()

    def _make_room(self) -> None:
        number = ctypes.c_int
        self._receive.argtypes = (number, ctypes.c_void_p, ctypes.c_uint, number, ctypes.c_void_p)
        room = self._room = mmap.mmap(-1, ROOM)  # only pages that are written to take memory
        begin = ctypes.addressof(ctypes.c_char.from_buffer(room))
        for each in range(BATCH):
            data, sockaddr = begin + each * MAX_DATAGRAM, begin + SOCKADDRS_AT + each * SOCKADDR_BYTES
            iovec, header = IOVECS_AT + each * IOVEC_BYTES, HEADERS_AT + each * MMSGHDR_BYTES
            room[iovec : iovec + IOVEC_BYTES] = struct.pack("=2Q", data, MAX_DATAGRAM)
            fields = sockaddr, SOCKADDR_BYTES, begin + iovec, 1, 0, 0, 0, 0
            room[header : header + MMSGHDR_BYTES] = struct.pack("=8Q", *fields)
        self._headers = begin + HEADERS_AT

    def take(self, opened: socket.socket, index: int = 0, most: int = DRAIN_LIMIT) -> list[Datagram]:
        """Return arrived datagrams for an engine's socket `index`, about `most` of them (whole batches)."""
        found: list[Datagram] = []
        if self._receive is None:
            self._take_singly(opened, index, most, found)
            return found
        room, known, handle = self._room, self._known, opened.fileno()
        for _ in range(DRAIN_LIMIT // BATCH):
            count: int = self._receive(handle, self._headers, BATCH, socket.MSG_DONTWAIT, None)
            if count > 0:
                senders: bytes = room[SOCKADDRS_AT : SOCKADDRS_AT + count * SOCKADDR_BYTES]
                headers: bytes = room[HEADERS_AT : HEADERS_AT + count * MMSGHDR_BYTES]
                for place in range(count):
                    sender = senders[place * SOCKADDR_BYTES : (place + 1) * SOCKADDR_BYTES]
                    begin = place * MAX_DATAGRAM
                    length = read_i64_le(headers, place * MMSGHDR_BYTES + MSG_LEN_AT)
                    data: bytes = room[begin : begin + length]
                    found.append(Datagram(index, known.get(sender) or self._add_sender(sender), data))
            # Another error is the kernel's report that an earlier datagram was undeliverable: ignored.
            short = 0 <= count < BATCH or (count < 0 and ctypes.get_errno() == errno.EAGAIN)
            if short or len(found) >= most:
                break
        return found

    def _add_sender(self, sockaddr: bytes) -> Address:
        """Return and store the sender of a raw sockaddr_in."""
        if len(self._known) == MAX_KNOWN:
            self._known.clear()
        address = self._known[sockaddr] = Address(socket.inet_ntoa(sockaddr[4:8]), int.from_bytes(sockaddr[2:4], "big"))
        return address

    def _take_singly(self, opened: socket.socket, index: int, most: int, found: list[Datagram]) -> None:
        for _ in range(DRAIN_LIMIT):
            try:
                data, peer = opened.recvfrom(MAX_DATAGRAM)
            except BlockingIOError:
                return
            except OSError:  # as above
                continue
            found.append(Datagram(index, Address(peer[0], peer[1]), data))
            if len(found) == most:
                return


class UdpDriver:
    """Moves an engine's datagrams through sockets and calls its timer, in the calling thread.

    Sockets are read in turns and in portions, with timers in between, so that a flood at one of them stops neither the
    others nor the timers. Engines detect timeouts at timers, so all sockets are read before a due timer is handled.
    Of addresses that the engine doesn't know only a limited amount is passed on.
    """

    def __init__(self, engine: Engine, clock: RealClock, from_ports: Mapping[str, int] | None = None) -> None:
        """Open the engine's sockets; `from_ports`: local ports of `udpout` endpoints in an earlier process.

        Raises:
            PortError: one of them can't be opened; none is left open.
        """
        self._engine = engine
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._sockets: list[socket.socket] = []
        self._inbox = Inbox()
        self._held: dict[int, deque[Datagram]] = {}
        """By socket, datagrams taken from it but not yet passed to the engine."""
        self._attended_ns = time.monotonic_ns()
        """When the last timer was handled."""
        self._strangers = StrangerLimit(self._attended_ns)
        try:
            for index, endpoint in enumerate(engine.endpoints()):
                opened = open_socket(endpoint, (from_ports or {}).get(str(endpoint), 0))
                self._sockets.append(opened)
                self._selector.register(opened, selectors.EVENT_READ, index)
        except PortError:
            self.close()
            raise

    @property
    def from_ports(self) -> dict[str, int]:
        """Local port of each `udpout` endpoint, to which its peer replies."""
        each = zip(self._engine.endpoints(), self._sockets, strict=True)
        return {str(endpoint): opened.getsockname()[1] for endpoint, opened in each if endpoint.kind == "udpout"}

    def __enter__(self) -> Self:
        """Return the driver."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the sockets."""
        self.close()

    def close(self) -> None:
        """Close the sockets."""
        for opened in self._sockets:
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
        ends_ns = begun_ns + min(max(held_up_ns, PATIENCE_NS), MOST_PATIENCE_NS)
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
            taken = self._inbox.take(self._sockets[index], index, BATCH)
            more = more or len(taken) == BATCH
            taken = self._read(taken)
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
            try:
                self._sockets[each.socket].sendto(each.data, each.peer.pair)
            except OSError:  # a full buffer or an unreachable peer loses the datagram, as any network may
                continue


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
