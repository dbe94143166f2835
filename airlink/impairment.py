"""Impairments of a link: delay, jitter, loss, duplication, limited rate; `impaired_link` applies them.

Source: Gilbert (1960), "Capacity of a burst-noise channel", for losses in bursts. This module isn't compiled: mypyc's
`==` of dataclasses compares identities.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Final

from airlink.clock import Instant
from airlink.delay_distribution import DelayDistribution, Distribution

Process = Callable[[int, Instant], float | None]
"""Returns by how much longer a datagram of so many bytes takes that enters the link at an instant, s; None: lost."""


@dataclass(frozen=True)
class Impairment:
    """Impairment of the datagrams in one direction of one link; `delays` says how delay and jitter are meant."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    distribution: Distribution = "normal"
    loss: float = 0.0
    """Probability that a datagram is lost, 0 to 1."""
    mean_burst: float | None = None
    """Mean number of datagrams lost in a row, at least 1 and loss / (1 - loss); None: independent losses."""
    duplicate: float = 0.0
    """Probability that a datagram arrives twice, each copy with a delay of its own."""
    rate_bps: float = 0.0
    """Bits of UDP payload per second; 0: no limit."""
    queue_s: float = 1.0
    """Longest time that a datagram waits for the limited rate; one that would wait longer is dropped."""
    reorder: bool = False
    """Whether a datagram may overtake others; if not, it waits until those before it have arrived."""
    outage: bool = False
    """Whether everything is lost."""

    process: Process | None = None
    """Delay and loss by time, recorded or from outside, which add to the rest."""

    @cached_property
    def transparent(self) -> bool:
        """Whether datagrams pass unchanged and at once."""
        return self == Impairment()

    @cached_property
    def loss_after(self) -> tuple[float, float]:
        """Probability that a datagram is lost, after one that arrived and after one that was lost."""
        if self.mean_burst is None or self.loss in {0.0, 1.0}:
            return self.loss, self.loss
        odds = self.loss / (1.0 - self.loss)
        burst = max(self.mean_burst, odds, 1.0)
        return odds / burst, 1.0 - 1.0 / burst

    @cached_property
    def delays(self) -> DelayDistribution:
        """The delays of its datagrams."""
        return DelayDistribution(self.delay_s, self.jitter_s, self.distribution)


def together(one: Process, other: Process | None) -> Process:
    """Return a process with the delays of both, in which a datagram is lost if either loses it."""
    if other is None:
        return one

    def both(size_bytes: int, now: Instant) -> float | None:
        first_s, second_s = one(size_bytes, now), other(size_bytes, now)
        return None if first_s is None or second_s is None else first_s + second_s

    return both


UNIMPAIRED: Final = Impairment()


class Direction(IntEnum):
    """One direction of a vehicle's link."""

    UPLINK = 0
    """Ground station to vehicle."""
    DOWNLINK = 1
