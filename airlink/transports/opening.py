"""Which transport an endpoint's kind is."""

from __future__ import annotations

from airlink.endpoint import Endpoint
from airlink.transports.multicast import Multicast
from airlink.transports.serial_line import SerialLine
from airlink.transports.tcp import TcpClient, TcpListener
from airlink.transports.transport import Transport
from airlink.transports.udp import Inbox, UdpTransport


def open_transport(endpoint: Endpoint, inbox: Inbox, from_port: int = 0) -> Transport:
    """Return an endpoint's transport, opened.

    Args:
        endpoint: the near end.
        inbox: receives the datagrams of all UDP sockets.
        from_port: the local port of a `udpout` in an earlier process; 0 for any.

    Raises:
        PortError: it can't be opened; a TCP client tries again instead.
    """
    match endpoint.kind:
        case "udpin" | "udpout":
            return UdpTransport(endpoint, inbox, from_port)
        case "tcp":
            return TcpClient(endpoint)
        case "tcpin":
            return TcpListener(endpoint)
        case "serial":
            return SerialLine(endpoint)
        case "mcast":
            return Multicast(endpoint)
