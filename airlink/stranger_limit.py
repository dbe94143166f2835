"""Limits how much of strangers' traffic is read, so that a flood of it costs an engine nothing that it would notice.

Anybody may send to a UDP socket. What an engine doesn't know yet may still be one of its vehicles, so strangers aren't
shut out: each has a share of its own, by a token bucket, and all of them together have another.
"""

from __future__ import annotations

from typing import Final

from airlink.endpoint import Address

NANOSECONDS: Final = 1e9
"""In a second."""
OVERHEAD_BYTES: Final = 64
"""Added to the size of each datagram: the cost of one without any bytes."""
EACH_BYTES_PER_S: Final = 10e3
"""What is read of one stranger: twice what a vehicle sends, and the same at once."""
ALL_BYTES_PER_S: Final = 100e3
ALL_AT_ONCE_BYTES: Final = 400e3
"""What is read of all strangers, a second and at once: a beginning of each of 250 vehicles received for the first
time."""
MAX_STRANGERS: Final = 1024
"""Largest number of strangers with a share of their own; then all of them begin again."""


class Share:
    """A token bucket: bytes that may still be read."""

    def __init__(self, bytes_per_s: float, at_once_bytes: float, now_ns: int) -> None:
        """Start full."""
        self._bytes_per_s, self._max, self._left = bytes_per_s, at_once_bytes, at_once_bytes
        self._refilled_ns = now_ns

    def has(self, now_ns: int) -> bool:
        """Return whether anything is left; a datagram larger than that is read whole, and the debt paid off first."""
        since_s = (now_ns - self._refilled_ns) / NANOSECONDS
        self._left = min(self._max, self._left + self._bytes_per_s * since_s)
        self._refilled_ns = now_ns
        return self._left > 0.0

    def spend(self, octets: int) -> None:
        """Count bytes that are read."""
        self._left -= octets


class StrangerLimit:
    """Decides which of strangers' datagrams are read."""

    def __init__(self, now_ns: int) -> None:
        """Start with full shares at a time of the monotonic clock, ns."""
        self._all = Share(ALL_BYTES_PER_S, ALL_AT_ONCE_BYTES, now_ns)
        self._each = dict[Address, Share]()

    def admits(self, peer: Address, size: int, now_ns: int) -> bool:
        """Return whether to read a stranger's datagram of `size` bytes, and count it if so."""
        share = self._each.get(peer)
        if share is None:
            if len(self._each) == MAX_STRANGERS:
                self._each.clear()
            share = self._each[peer] = Share(EACH_BYTES_PER_S, EACH_BYTES_PER_S, now_ns)
        if not (share.has(now_ns) and self._all.has(now_ns)):
            return False
        share.spend(size + OVERHEAD_BYTES)
        self._all.spend(size + OVERHEAD_BYTES)
        return True
