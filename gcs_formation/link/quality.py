"""Loss and jitter of what a vehicle sends."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

from airlink.clock import NANOSECONDS, Instant

MODULUS: Final = 256
LATE: Final = MODULUS // 2
"""A number at most this far behind the newest belongs to a late or repeated frame; any other is ahead of it."""
SHARE: Final = 1 / 16
"""Weight of each new difference."""


@dataclass
class SequenceTracker:
    """Counts frames received and lost (MAVLink guide, "Packet loss").

    A late frame cancels the loss that its gap was counted as; a repeated one counts as neither received nor lost.
    Exact as long as fewer than 127 frames are lost in a row.
    """

    received: int = 0
    lost: int = 0
    repeated: int = 0
    _newest: int | None = None
    _missing: set[int] = field(default_factory=set[int])
    """Numbers counted as lost that may still come."""

    def observe(self, sequence: int) -> None:
        """Take the sequence number of a frame that arrived."""
        if self._newest is not None and sequence == (self._newest + 1) % MODULUS and not self._missing:
            self.received += 1
            self._newest = sequence
            return
        newest = (sequence - 1) % MODULUS if self._newest is None else self._newest
        if (newest - sequence) % MODULUS <= LATE:
            self._observe_late(sequence)
            return
        gap = (sequence - newest - 1) % MODULUS
        self.received += 1
        self.lost += gap
        self._newest = sequence
        if gap or self._missing:
            self._missing.update((newest + ahead) % MODULUS for ahead in range(1, gap + 1))
            self._missing = {number for number in self._missing if (sequence - number) % MODULUS <= LATE}

    def restart(self) -> None:
        """Forget the last number, because the sender has restarted."""
        self._newest = None
        self._missing.clear()

    @property
    def loss(self) -> float:
        """Share of the sent frames that didn't arrive, 0 to 1."""
        sent = self.received + self.lost
        return self.lost / sent if sent else 0.0

    def _observe_late(self, sequence: int) -> None:
        if sequence in self._missing:
            self._missing.remove(sequence)
            self.received += 1
            self.lost -= 1
        else:
            self.repeated += 1


class JitterMeter:
    """Running mean of the absolute change in transit time from sample to sample.

    For independent, normally distributed delays it is 2/sqrt(pi) standard deviations. It needs no common clock; the
    vehicle's clock drift is removed.
    """

    def __init__(self) -> None:
        """Start without a sample."""
        self.jitter_s = math.nan
        """NaN before the second sample."""
        self._last: tuple[float, Instant] | None = None

    def observe(self, stamp_s: float, arrived: Instant, drift: float) -> None:
        """Take a sample: its stamp on the vehicle's clock, which gains `drift` s a second on ours, and its arrival."""
        if self._last is not None:
            sent_s, before = self._last
            change_s = abs((arrived - before) / NANOSECONDS - (stamp_s - sent_s) / (1.0 + drift))
            known_s = 0.0 if math.isnan(self.jitter_s) else self.jitter_s
            self.jitter_s = known_s + SHARE * (change_s - known_s)
        self._last = stamp_s, arrived
