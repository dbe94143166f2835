"""A multicast group: every member receives from every other, as in ArduPilot's swarm scripts (`mcast:`)."""

from __future__ import annotations

import selectors
import socket
import struct
from typing import Final

from airlink.endpoint import ANY_HOST, Address, Endpoint, PortError
from airlink.engine import Datagram
from airlink.transports.transport import Transport
from airlink.transports.udp import MAX_DATAGRAM, RECEIVE_BUFFER

HOPS: Final = 1
"""Datagrams stay in the local network."""


class Multicast(Transport):
    """A member of a group: one socket receives, another sends, so that its own datagrams are known."""

    maintained = False

    def __init__(self, endpoint: Endpoint) -> None:
        """Join the group.

        Raises:
            PortError: the group can't be joined.
        """
        self._group = endpoint.address
        self._hearing = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._hearing.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._hearing.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
            self._hearing.setblocking(False)
            self._hearing.bind(self._group.pair)
            member = struct.pack("=4s4s", socket.inet_aton(self._group.host), socket.inet_aton(ANY_HOST))
            self._hearing.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
            self._sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, HOPS)
            self._sending.setblocking(False)
            self._sending.bind(("", 0))
        except OSError as error:
            self.close()
            raise PortError(f"cannot join {endpoint}: {error.strerror}") from error
        self._own_port: int = self._sending.getsockname()[1]

    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let the selector wait for datagrams."""
        selector.register(self._hearing, selectors.EVENT_READ, index)

    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:
        """Return what others have sent: of one peer, the group, to which every answer goes."""
        found = list[Datagram]()
        for _ in range(max_datagrams):
            try:
                data, sender = self._hearing.recvfrom(MAX_DATAGRAM)
            except OSError:  # no more
                break
            if sender[1] != self._own_port:
                found.append(Datagram(index, self._group, data))
        return found

    def send(self, data: bytes, peer: Address) -> None:  # noqa: ARG002 - everybody is meant
        """Send to the group; a full buffer loses it."""
        try:
            self._sending.sendto(data, self._group.pair)
        except OSError:
            return

    def close(self) -> None:
        """Leave the group."""
        self._hearing.close()
        self._sending.close()
