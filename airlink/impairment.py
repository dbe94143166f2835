"""Impairments of a link: delay, jitter, loss, duplication, limited rate; `impaired_link` applies them.

Sources: Gilbert (1960), "Capacity of a burst-noise channel", for losses in bursts; tc-netem(8) for the Pareto
distribution's shape. This module isn't compiled: mypyc's `==` of dataclasses compares identities.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from statistics import NormalDist
from typing import Final, Literal

from airlink.clock import Instant

Process = Callable[[int, Instant], float | None]
"""Returns by how much longer a datagram of so many bytes takes that enters the link at an instant, s; None: lost."""
Distribution = Literal["normal", "uniform", "pareto"]

_NORMAL = NormalDist()
_UNIFORM_HALF_WIDTH: Final = math.sqrt(3.0)
_PARETO_SHAPE: Final = 3.0
_PARETO_SCALE: Final = 2.0 / math.sqrt(3.0)
"""Smallest value of a Pareto variate of that shape with standard deviation 1."""
_PARETO_MEAN: Final = 1.5 * _PARETO_SCALE
_LARGEST_BELOW_1: Final = 1.0 - 2.0**-53
_SMALLEST: Final = 2.0**-60


CDF: Final[dict[str, Callable[[float], float]]] = {
    "normal": _NORMAL.cdf,
    "uniform": lambda x: min(max((x / _UNIFORM_HALF_WIDTH + 1.0) / 2.0, 0.0), 1.0),
    "pareto": lambda x: 1.0 - (_PARETO_SCALE / max(x + _PARETO_MEAN, _PARETO_SCALE)) ** _PARETO_SHAPE,
}
"""Cumulative distribution functions of mean 0 and standard deviation 1."""
QUANTILE: Final[dict[str, Callable[[float], float]]] = {
    "normal": _NORMAL.inv_cdf,
    "uniform": lambda share: (2.0 * share - 1.0) * _UNIFORM_HALF_WIDTH,
    "pareto": lambda share: _PARETO_SCALE * (1.0 - share) ** (-1.0 / _PARETO_SHAPE) - _PARETO_MEAN,
}
"""Their inverses."""


@dataclass(frozen=True)
class Impairment:
    """Impairment of the datagrams in one direction of one link.

    A delay is `delay_s` plus a variate of mean 0 and standard deviation `jitter_s`. Its distribution is truncated
    where the delay would be negative and renormalised, which raises the mean.
    """

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

    def delay_of(self, share: float) -> float:
        """Return the delay, s, at the quantile `share` (0 to 1)."""
        if self.jitter_s == 0.0:
            return self.delay_s
        share = self._share_below_zero + (1.0 - self._share_below_zero) * share
        variate = QUANTILE[self.distribution](min(max(share, _SMALLEST), _LARGEST_BELOW_1))
        return max(0.0, self.delay_s + self.jitter_s * variate)

    @cached_property
    def _share_below_zero(self) -> float:
        return CDF[self.distribution](-self.delay_s / self.jitter_s)


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
    """One way of a vehicle's link."""

    UPLINK = 0
    """Ground station to vehicle."""
    DOWNLINK = 1
