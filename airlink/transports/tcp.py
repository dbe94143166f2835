"""TCP: a client that connects again, and a listener that any number of clients connect to."""

from __future__ import annotations

import errno
import selectors
import socket
from typing import Final

from airlink.endpoint import Address, Endpoint, PortError
from airlink.engine import Datagram
from airlink.transports.backlog import Backlog
from airlink.transports.transport import Transport
from airlink.transports.udp import family_of

READ_BYTES: Final = 16384
BACKLOG_BYTES: Final = 16384
"""Longest wait for room, in bytes: some seconds of one vehicle's frames."""
MAX_CLIENTS: Final = 64
FIRST_RETRY_NS: Final = 200_000_000
LAST_RETRY_NS: Final = 2_000_000_000
"""Shortest and longest interval between attempts to connect; it doubles from one to the other."""


class Stream:
    """A connected TCP socket."""

    def __init__(self, connected: socket.socket, peer: Address) -> None:
        """Send small frames at once, rather than wait for more."""
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket, self.peer, self.lost = connected, peer, False
        self._backlog = Backlog(BACKLOG_BYTES)

    def drain(self, index: int, found: list[Datagram]) -> None:
        """Append what has arrived; note the end of the connection."""
        try:
            data = self.socket.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            found.append(Datagram(index, self.peer, data))
        else:
            self.lost = True

    def send(self, data: bytes) -> None:
        """Send, or keep until there is room."""
        self._backlog.add(data)
        self.flush()

    def flush(self) -> None:
        """Send what waits for room."""
        self._backlog.flush(self._write)

    def _write(self, data: bytes) -> int:
        if self.lost:
            return 0
        try:
            return self.socket.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.lost = True
            return 0


class TcpClient(Transport):
    """Connects to a listener, and again whenever the connection is lost; until then what is sent is lost."""

    def __init__(self, endpoint: Endpoint) -> None:
        """Begin to connect; whether a peer listens shows later."""
        self._peer = endpoint.address
        self._connecting: socket.socket | None = None
        self._stream: Stream | None = None
        self._selector: selectors.BaseSelector | None = None
        self._index, self._retry_ns, self._next_ns = 0, FIRST_RETRY_NS, 0

    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let the selector wait for data whenever it is connected."""
        self._selector, self._index = selector, index

    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:  # noqa: ARG002 - a stream has no datagrams to count
        """Return a piece of the stream."""
        found = list[Datagram]()
        if self._stream is not None:
            self._stream.drain(index, found)
        return found

    def send(self, data: bytes, peer: Address) -> None:  # noqa: ARG002 - there is one
        """Send while connected."""
        if self._stream is not None:
            self._stream.send(data)

    def maintain(self, now_ns: int) -> None:
        """Connect again after a loss, with growing intervals."""
        stream = self._stream
        if stream is not None and not stream.lost:
            stream.flush()
            return
        if stream is not None:
            self._drop(stream.socket)
            self._stream, self._next_ns = None, now_ns + self._retry_ns
        elif self._connecting is not None:
            self._complete(self._connecting)
        if self._stream is None and now_ns >= self._next_ns:
            self._begin(now_ns)

    def _begin(self, now_ns: int) -> None:
        if self._connecting is not None:
            self._connecting.close()
        self._next_ns, self._retry_ns = now_ns + self._retry_ns, min(2 * self._retry_ns, LAST_RETRY_NS)
        self._connecting = socket.socket(family_of(self._peer.host), socket.SOCK_STREAM)
        self._connecting.setblocking(False)
        self._complete(self._connecting)

    def _complete(self, connecting: socket.socket) -> None:
        try:
            result = connecting.connect_ex(self._peer.pair)
        except OSError:  # the host isn't known
            result = errno.EHOSTUNREACH
        if result in {errno.EINPROGRESS, errno.EALREADY}:
            return
        self._connecting = None
        if result not in {0, errno.EISCONN}:
            connecting.close()
            return
        self._stream, self._retry_ns = Stream(connecting, self._peer), FIRST_RETRY_NS
        if self._selector is not None:
            self._selector.register(connecting, selectors.EVENT_READ, self._index)

    def _drop(self, lost: socket.socket) -> None:
        if self._selector is not None:
            self._selector.unregister(lost)
        lost.close()

    def close(self) -> None:
        """Close the connection."""
        for each in (self._connecting, None if self._stream is None else self._stream.socket):
            if each is not None:
                each.close()


class TcpListener(Transport):
    """Listens at an address; each client is a peer, by its own address."""

    def __init__(self, endpoint: Endpoint) -> None:
        """Listen.

        Raises:
            PortError: the address is taken or isn't this machine's.
        """
        self._clients: dict[Address, Stream] = {}
        self._selector: selectors.BaseSelector | None = None
        self._index = 0
        self._listening = socket.socket(family_of(endpoint.address.host), socket.SOCK_STREAM)
        try:
            self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listening.setblocking(False)
            self._listening.bind(endpoint.address.pair)
            self._listening.listen()
        except OSError as error:
            self._listening.close()
            cause = "is taken by another program" if error.errno == errno.EADDRINUSE else error.strerror
            raise PortError(f"cannot listen at {endpoint}: {endpoint.address} {cause}") from error

    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let the selector wait for clients and their data."""
        self._selector, self._index = selector, index
        selector.register(self._listening, selectors.EVENT_READ, index)

    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:  # noqa: ARG002 - as above
        """Return a piece of each client's stream; take new clients."""
        self._accept()
        found = list[Datagram]()
        for each in self._clients.values():
            each.drain(index, found)
        self._drop_lost()
        return found

    def _accept(self) -> None:
        while len(self._clients) < MAX_CLIENTS:
            try:
                connected, sender = self._listening.accept()
            except OSError:  # no other client waits, or it has gone
                return
            stream = Stream(connected, Address(sender[0], sender[1]))
            self._clients[stream.peer] = stream
            if self._selector is not None:
                self._selector.register(connected, selectors.EVENT_READ, self._index)

    def _drop_lost(self) -> None:
        for peer in [each.peer for each in self._clients.values() if each.lost]:
            gone = self._clients.pop(peer).socket
            if self._selector is not None:
                self._selector.unregister(gone)
            gone.close()

    def send(self, data: bytes, peer: Address) -> None:
        """Send to a client; who has gone misses it."""
        stream = self._clients.get(peer)
        if stream is not None:
            stream.send(data)

    def maintain(self, now_ns: int) -> None:  # noqa: ARG002 - nothing waits for an instant
        """Send what waits for room."""
        for each in self._clients.values():
            each.flush()
        self._drop_lost()

    def close(self) -> None:
        """Close the listening socket and all connections."""
        for each in self._clients.values():
            each.socket.close()
        self._listening.close()
