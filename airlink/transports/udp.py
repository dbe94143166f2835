"""UDP: sockets, datagrams received in batches, and the two ways of using them.

`udpin` listens at an address and answers its senders; `udpout` sends to one address.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import selectors
import socket
import struct
from typing import Any, Final

from librt.strings import read_i64_le

from airlink.endpoint import Address, Endpoint, PortError
from airlink.engine import Datagram
from airlink.host_system import recvmmsg
from airlink.transports.transport import Transport

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


def family_of(host: str) -> socket.AddressFamily:
    """Return the address family of a host: IPv6 for a number with colons."""
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def open_socket(endpoint: Endpoint, from_port: int = 0) -> socket.socket:
    """Return a non-blocking UDP socket: bound to the address (`udpin`), or to `from_port` or any free port (`udpout`).

    Raises:
        PortError: the address is taken or isn't this machine's.
    """
    opened = socket.socket(family_of(endpoint.address.host), socket.SOCK_DGRAM)
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
    if endpoint.kind != "udpout" or ":" in address.host:
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

    def drain(self, opened: socket.socket, index: int = 0, max_datagrams: int = DRAIN_LIMIT) -> list[Datagram]:
        """Return arrived datagrams for an engine's socket `index`, about `max_datagrams` of them (whole batches)."""
        found: list[Datagram] = []
        if self._receive is None or opened.family != socket.AF_INET:
            self._take_singly(opened, index, max_datagrams, found)
            return found
        room, known, handle = self._room, self._known, opened.fileno()
        for _ in range(DRAIN_LIMIT // BATCH):
            count: int = self._receive(handle, self._headers, BATCH, socket.MSG_DONTWAIT, None)
            if count > 0:
                senders: bytes = room[SOCKADDRS_AT : SOCKADDRS_AT + count * SOCKADDR_BYTES]
                headers: bytes = room[HEADERS_AT : HEADERS_AT + count * MMSGHDR_BYTES]
                for entry in range(count):
                    sender = senders[entry * SOCKADDR_BYTES : (entry + 1) * SOCKADDR_BYTES]
                    begin = entry * MAX_DATAGRAM
                    length = read_i64_le(headers, entry * MMSGHDR_BYTES + MSG_LEN_AT)
                    data: bytes = room[begin : begin + length]
                    found.append(Datagram(index, known.get(sender) or self._add_sender(sender), data))
            # Another error is the kernel's report that an earlier datagram was undeliverable: ignored.
            short = 0 <= count < BATCH or (count < 0 and ctypes.get_errno() == errno.EAGAIN)
            if short or len(found) >= max_datagrams:
                break
        return found

    def _add_sender(self, sockaddr: bytes) -> Address:
        """Return and store the sender of a raw sockaddr_in."""
        if len(self._known) == MAX_KNOWN:
            self._known.clear()
        address = self._known[sockaddr] = Address(socket.inet_ntoa(sockaddr[4:8]), int.from_bytes(sockaddr[2:4], "big"))
        return address

    def _take_singly(self, opened: socket.socket, index: int, max_datagrams: int, found: list[Datagram]) -> None:
        for _ in range(DRAIN_LIMIT):
            try:
                data, peer = opened.recvfrom(MAX_DATAGRAM)
            except BlockingIOError:
                return
            except OSError:  # as above
                continue
            found.append(Datagram(index, Address(peer[0], peer[1]), data))
            if len(found) == max_datagrams:
                return


class UdpTransport(Transport):
    """A UDP socket."""

    maintained = False

    def __init__(self, endpoint: Endpoint, inbox: Inbox, from_port: int = 0) -> None:
        """Open it as `open_socket` does; `inbox` is shared by all sockets of a driver."""
        self._socket, self._inbox = open_socket(endpoint, from_port), inbox

    @property
    def local_port(self) -> int:
        """The port that it is bound to."""
        port: int = self._socket.getsockname()[1]
        return port

    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let the selector wait for datagrams."""
        selector.register(self._socket, selectors.EVENT_READ, index)

    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:
        """Return arrived datagrams."""
        return self._inbox.drain(self._socket, index, max_datagrams)

    def send(self, data: bytes, peer: Address) -> None:
        """Send a datagram; a full buffer or an unreachable peer loses it, as any network may."""
        try:
            self._socket.sendto(data, peer.pair)
        except OSError:
            return

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
