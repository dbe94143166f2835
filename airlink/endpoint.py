"""Connection strings in the style of pymavlink and MAVProxy, addresses, identities of vehicles, airlink's errors."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from typing import Literal, NamedTuple

from mypy_extensions import mypyc_attr

MAX_PORT = 65535
ANY_HOST = "0.0.0.0"
LOOPBACK = "127.0.0.1"
MULTICAST = "239.255.145.50", 14550
"""The group and port of `mcast:`, as ArduPilot, MAVProxy and pymavlink have them."""
BAUD = 57600
"""Of a serial line, unless it is given: telemetry radios' default."""
MAX_BAUD = 12_500_000
_HOST = re.compile(r"([A-Za-z0-9_-]{1,63}\.)*[A-Za-z0-9_-]{1,63}")
_DEVICE = re.compile(r"(/[^:,]+|COM[0-9]+)[,:]?([0-9]*)")
SYNTAX = (
    "udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT, serial:DEVICE:BAUD, mcast:GROUP:PORT, "
    "with HOST a name, an IPv4 number or an IPv6 number in brackets"
)
BRIDGE = "anything else by a router, such as `mavlink-routerd -e 127.0.0.1:14550 DEVICE:BAUD` and udpin:127.0.0.1:14550"
FAR_END = "far end of "


class AirlinkError(Exception):
    """Root of every error that airlink raises."""


class EndpointError(AirlinkError):
    """A connection string that can't be used as written."""


class PortError(AirlinkError):
    """A local address that can't be opened: taken, forbidden or of another machine."""


class ImpairmentError(AirlinkError):
    """A setting of an impaired link that isn't allowed."""


@mypyc_attr(acyclic=True)
class Address:
    """Where a peer is: a host, by number or name, and a port; or a serial device and its baud rate. Immutable."""

    __slots__ = ("_hash", "host", "port")

    def __init__(self, host: str, port: int) -> None:
        """Take the host, by number or name, and the port."""
        self.host = host
        self.port = port
        self._hash = hash((host, port))  # used for every frame

    @property
    def pair(self) -> tuple[str, int]:
        """Host and port, as sockets take them."""
        return self.host, self.port

    def __hash__(self) -> int:
        """Return a hash of host and port."""
        return self._hash

    def __eq__(self, other: object) -> bool:
        """Return whether host and port are the same."""
        return isinstance(other, Address) and self.port == other.port and self.host == other.host

    def __reduce__(self) -> tuple[type[Address], tuple[str, int]]:
        """Return what pickle needs."""
        return Address, (self.host, self.port)

    def __repr__(self) -> str:
        """Return the expression that makes it."""
        return f"Address({self.host!r}, {self.port})"

    def __str__(self) -> str:
        """Return "host:port"; an IPv6 number is in brackets."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


Kind = Literal["udpin", "udpout", "tcp", "tcpin", "serial", "mcast"]
KINDS: dict[str, Kind] = {
    "udp": "udpin",
    "udpin": "udpin",
    "udpout": "udpout",
    "tcp": "tcp",
    "tcpout": "tcp",
    "tcpin": "tcpin",
    "serial": "serial",
    "mcast": "mcast",
}
"""Kinds by the words of pymavlink, MAVProxy and MAVSDK."""
_OPPOSITE: dict[str, Kind] = {"udpin": "udpout", "udpout": "udpin", "tcp": "tcpin", "tcpin": "tcp"}


@dataclass(frozen=True)
class Endpoint:
    """One end of a link.

    `udpin` and `tcpin` listen at the address, and answer the senders that they receive from; `udpout` and `tcp` send to
    it; `serial` is a device, with the baud rate as its port; `mcast` is a group, in which every member receives from
    every other.
    """

    kind: Kind
    address: Address

    def __str__(self) -> str:
        """Return the connection string."""
        return f"{self.kind}:{self.address}"

    @property
    def far_end(self) -> Address:
        """A serial line's other end, as the peer of this one."""
        host = self.address.host
        return Address(host.removeprefix(FAR_END) if host.startswith(FAR_END) else FAR_END + host, self.address.port)

    @property
    def peer(self) -> Address | None:
        """Where everything is sent; None for an end that listens, and answers the senders that it receives from."""
        if self.kind in {"udpin", "tcpin"}:
            return None
        return self.far_end if self.kind == "serial" else self.address

    def opposite(self) -> Endpoint:
        """Return the endpoint that talks to this one from the same machine or, by address, from another."""
        if self.kind == "serial":
            return Endpoint("serial", self.far_end)
        if self.kind == "mcast":
            return self
        anywhere = self.peer is None and self.address.host == ANY_HOST
        return Endpoint(_OPPOSITE[self.kind], Address(LOOPBACK if anywhere else self.address.host, self.address.port))


def parse_endpoint(text: str) -> Endpoint:
    """Parse a connection string, spelled as users of pymavlink, MAVProxy and MAVSDK do.

    Raises:
        EndpointError: the text isn't of that form; the message says what is allowed.
    """
    word, _, rest = text.partition(":")
    device = _DEVICE.fullmatch(text if text.startswith(("/dev/", "COM")) else rest.removeprefix("//"))
    if text.startswith(("/dev/", "COM")) or word == "serial":
        return _serial(text, device)
    kind = KINDS.get(word)
    if kind is None:
        raise EndpointError(f"connection string '{text}': found '{word}'; allowed: {SYNTAX}; {BRIDGE}")
    if kind == "mcast" and rest.strip(":/") == "":
        return Endpoint("mcast", Address(*MULTICAST))
    host, _, port_text = rest.removeprefix("//").rpartition(":")
    if not _is_host(host) or not (port_text.isascii() and port_text.isdigit()):
        raise EndpointError(f"connection string '{text}': host and port not found; allowed: {SYNTAX}")
    port = int(port_text)
    if not 1 <= port <= MAX_PORT:
        raise EndpointError(f"connection string '{text}': found port {port}; allowed: 1 to {MAX_PORT}")
    if kind == "mcast" and not _is_group(host):
        raise EndpointError(f"connection string '{text}': found {host}; allowed: a group, 224.0.0.0 to 239.255.255.255")
    return Endpoint(kind, Address(host.strip("[]"), port))


def _serial(text: str, device: re.Match[str] | None) -> Endpoint:
    if device is None:
        raise EndpointError(f"connection string '{text}': device not found; allowed: serial:DEVICE:BAUD")
    baud = int(device[2] or BAUD)
    if not 1 <= baud <= MAX_BAUD:
        raise EndpointError(f"connection string '{text}': found {baud} baud; allowed: 1 to {MAX_BAUD}")
    return Endpoint("serial", Address(device[1], baud))


def _is_host(text: str) -> bool:
    if text.startswith("["):
        return text.endswith("]") and _is_ip(text[1:-1], 6)
    return _HOST.fullmatch(text) is not None


def _is_ip(text: str, version: int) -> bool:
    try:
        return ipaddress.ip_address(text).version == version
    except ValueError:
        return False


def _is_group(host: str) -> bool:
    return _is_ip(host, 4) and ipaddress.ip_address(host).is_multicast


class ComponentId(NamedTuple):
    """A sender on a MAVLink network: its system id and its component id there."""

    system: int
    component: int

    def __str__(self) -> str:
        """Return "system/component"."""
        return f"{self.system}/{self.component}"


class VehicleId(NamedTuple):
    """A vehicle's identity: the MAVLink network it is received on, and its system id there."""

    network: int
    system: int

    def __str__(self) -> str:
        """Return the system id alone on the first network, "network:system" elsewhere."""
        return str(self.system) if self.network == 1 else f"{self.network}:{self.system}"
