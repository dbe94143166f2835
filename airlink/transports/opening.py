"""Which transport an endpoint's kind is. Those that few flights have are imported when one is opened."""

from __future__ import annotations

from airlink.endpoint import Endpoint
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
            from airlink.transports.tcp import TcpClient  # noqa: PLC0415

            return TcpClient(endpoint)
        case "tcpin":
            from airlink.transports.tcp import TcpListener  # noqa: PLC0415

            return TcpListener(endpoint)
        case "serial":
            from airlink.transports.serial_line import SerialLine  # noqa: PLC0415

            return SerialLine(endpoint)
        case "mcast":
            from airlink.transports.multicast import Multicast  # noqa: PLC0415

            return Multicast(endpoint)
