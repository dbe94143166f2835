"""Connection strings in the style of pymavlink and MAVProxy, addresses, identities of vehicles, airlink's errors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, NamedTuple

from mypy_extensions import mypyc_attr

MAX_PORT = 65535
ANY_HOST = "0.0.0.0"
LOOPBACK = "127.0.0.1"
_HOST = re.compile(r"([A-Za-z0-9_-]{1,63}\.)*[A-Za-z0-9_-]{1,63}")
SYNTAX = "udpin:HOST:PORT, udpout:HOST:PORT or udp:HOST:PORT, with HOST a name or an IPv4 number"


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
    """An IPv4 host, by number or name, and a UDP port; immutable."""

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
        """Return "host:port"."""
        return f"{self.host}:{self.port}"


@dataclass(frozen=True)
class Endpoint:
    """One end of a UDP link: `udpin` listens at the address, `udpout` sends to it."""

    kind: Literal["udpin", "udpout"]
    address: Address

    def __str__(self) -> str:
        """Return the connection string."""
        return f"{self.kind}:{self.address}"

    def opposite(self) -> Endpoint:
        """Return the endpoint that talks to this one from the same machine or, by address, from another."""
        if self.kind == "udpout":
            return Endpoint("udpin", self.address)
        host = LOOPBACK if self.address.host == ANY_HOST else self.address.host
        return Endpoint("udpout", Address(host, self.address.port))


def parse_endpoint(text: str) -> Endpoint:
    """Parse a connection string: `udpin:`, `udpout:` or `udp:` (the same as `udpin:`), host and port.

    Raises:
        EndpointError: the text isn't of that form; the message says what is allowed.
    """
    kind, _, rest = text.partition(":")
    host, _, port_text = rest.removeprefix("//").rpartition(":")
    if kind not in {"udp", "udpin", "udpout"}:
        raise EndpointError(f"connection string '{text}': found '{kind}'; allowed: {SYNTAX}")
    if not _HOST.fullmatch(host) or not (port_text.isascii() and port_text.isdigit()):
        why = ", IPv6 isn't supported" if ":" in host else ""
        raise EndpointError(f"connection string '{text}': host and port not found{why}; allowed: {SYNTAX}")
    port = int(port_text)
    if not 1 <= port <= MAX_PORT:
        raise EndpointError(f"connection string '{text}': found port {port}; allowed: 1 to {MAX_PORT}")
    return Endpoint("udpout" if kind == "udpout" else "udpin", Address(host, port))


class ComponentId(NamedTuple):
    """A sender on a MAVLink network: its system id and its component id there."""

    system: int
    component: int

    def __str__(self) -> str:
        """Return "system/component"."""
        return f"{self.system}/{self.component}"


class VehicleId(NamedTuple):
    """A vehicle's identity: the MAVLink network it is heard on, and its system id there."""

    network: int
    system: int

    def __str__(self) -> str:
        """Return the system id alone on the first network, "network:system" elsewhere."""
        return str(self.system) if self.network == 1 else f"{self.network}:{self.system}"
