"""The interface of a link: one end of it, opened, which a driver reads, writes and looks after."""

from __future__ import annotations

import selectors
from abc import ABC, abstractmethod

from mypy_extensions import mypyc_attr

from airlink.endpoint import Address
from airlink.engine import Datagram


@mypyc_attr(allow_interpreted_subclasses=True)
class Transport(ABC):
    """One end of a link. It never blocks, and loses what the link can't take, as a radio does.

    A stream (TCP, a serial line) may cut a frame anywhere: receivers put the pieces of each peer together.
    """

    maintained: bool = True
    """Whether `maintain` has anything to do."""

    @property
    def local_port(self) -> int | None:
        """The port that peers answer to, if it matters that it stays the same; None otherwise."""
        return None

    @abstractmethod
    def register(self, selector: selectors.BaseSelector, index: int) -> None:
        """Let a selector wait for what arrives, now and after each reconnection, with `index` as the key's data."""

    @abstractmethod
    def drain(self, index: int, max_datagrams: int) -> list[Datagram]:
        """Return what has arrived, for an engine's socket `index`, about `max_datagrams` datagrams."""

    @abstractmethod
    def send(self, data: bytes, peer: Address) -> None:
        """Send to a peer."""

    def maintain(self, now_ns: int) -> None:  # noqa: B027 - only what can be lost is looked after
        """Connect again, and send what had to wait; called ten times a second at least.

        Args:
            now_ns: the machine's monotonic clock.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it."""
