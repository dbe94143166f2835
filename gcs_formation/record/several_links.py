"""Vehicles with several links, for the record: columns of the time series, and figures of each link."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant, seconds_between
from flight_model.arrays import Array
from gcs_formation.record.figures_of_merit import if_finite, percentiles
from gcs_formation.record.link_verdicts import LinkFigures

OLD_S: Final = 2.0
"""A delay that was measured longer ago isn't that of now."""
IN_USE: Final = "link"
"""Column: the number of the link in use, from 1."""


@dataclass(frozen=True)
class OneLink:
    """One of several links of a vehicle."""

    number: int
    endpoint: str
    used_s: float
    """For how long it was in use, s."""
    jitter_s: float
    """Its jitter at the end, s; NaN if none was measured."""
    figures: LinkFigures

    def to_dict(self) -> dict[str, Any]:
        """Return its entry in `links.N.each` of `summary.json`."""
        one = self.figures
        up_s, down_s, loss_up, loss = one.injected or (None,) * 4
        mean_s = None if up_s is None or down_s is None else (up_s + down_s) / 2
        injected = {"delay": mean_s, "up": up_s, "down": down_s}
        _, up_ms, down_ms = one.delays_s.T * 1e3
        return {
            "link": self.number,
            "endpoint": self.endpoint,
            "used_s": self.used_s,
            **{f"injected_{name}_ms": None if each_s is None else 1e3 * each_s for name, each_s in injected.items()},
            "measured_delay_ms": percentiles(one.one_way_s * 1e3, 50, 99),
            "measured_up_ms": percentiles(up_ms, 50)["p50"],
            "measured_down_ms": percentiles(down_ms, 50)["p50"],
            "jitter_ms": if_finite(1e3 * self.jitter_s),
            "injected_loss": loss,
            "injected_loss_up": loss_up,
            "measured_loss": one.measured_loss,
            "frames_in": one.frames_in,
            "frames_out": one.frames_out,
            "frames_bad": one.frames_bad,
        }


Uses = Sequence[tuple[Instant, int]]
"""From when on which link of a vehicle was in use."""


def used_s(uses: Uses, end: Instant) -> dict[int, float]:
    """Return for how long each link was in use until an instant, s."""
    found = dict[int, float]()
    for (since, number), (until, _) in zip(uses, [*uses[1:], (end, 0)], strict=True):
        found[number] = found.get(number, 0.0) + max(0.0, seconds_between(since, until))
    return found


def number_at(uses: Uses, at_ns: Array) -> Array:
    """Return the number of the link in use at instants, ns."""
    since, numbers = np.array([each for each, _ in uses], float), np.array([number for _, number in uses])
    found: Array = numbers[np.maximum(np.searchsorted(since, at_ns, side="right") - 1, 0)]
    return found


def together(each: Sequence[OneLink], uses: Uses) -> dict[str, Any]:
    """Return what `LinkFigures` of the whole vehicle have of the link that was in use: delays, losses, injection."""
    weights = np.array([one.used_s for one in each])
    weights = weights / weights.sum() if weights.sum() > 0.0 else np.eye(len(each))[0]
    injected_each = [one.figures.injected for one in each]
    injected = None
    if all(one is not None for one in injected_each):
        injected = tuple(float(each) for each in weights @ np.array(injected_each, float))
    used = [number_at(uses, one.figures.probed_ns) == one.number for one in each]
    order = np.argsort(np.concatenate([one.figures.probed_ns[own] for one, own in zip(each, used, strict=True)]))
    delays_s = np.concatenate([one.figures.delays_s[own] for one, own in zip(each, used, strict=True)])
    times_s = np.concatenate([one.figures.delay_times_s[own] for one, own in zip(each, used, strict=True)])
    return {
        "delays_s": delays_s[order],
        "delay_times_s": times_s[order],
        "measured_loss": float(weights @ np.array([one.figures.measured_loss for one in each])),
        "injected": injected,
        "each": tuple(each),
    }


def with_several_links(
    blocks: Iterator[dict[str, Array]], links: Sequence[tuple[Uses, Sequence[Array]] | None]
) -> Iterator[dict[str, Array]]:
    """Yield a time series' blocks, each column (T, V), with the link in use and the newest delay of each link.

    `links`: of each of the V vehicles when which link was in use, and of each link the answered requests, (P, 4) as
    `RoundTrips.delays`; None for a vehicle with one link. Where all have one the blocks stay as they are.
    """
    count = max((len(each[1]) for each in links if each is not None), default=0)
    for block in blocks:
        yield block | _columns(block["t_s"][:, 0], links, count) if count else block


def _columns(time_s: Array, links: Sequence[tuple[Uses, Sequence[Array]] | None], count: int) -> dict[str, Array]:
    shape = (time_s.size, len(links))
    found = {IN_USE: np.full(shape, 1.0)} | {f"link_{1 + n}_delay_s": np.full(shape, math.nan) for n in range(count)}
    for column, each in enumerate(links):
        if each is None:
            continue
        uses, probes = each
        found[IN_USE][:, column] = number_at(uses, time_s * NANOSECONDS)
        for index, known in enumerate(probes):
            rows = np.vstack(([[-np.inf, *[np.nan] * 3]], known))
            newest = np.searchsorted(rows[:, 0], time_s * NANOSECONDS, side="right") - 1
            recent = time_s - rows[newest, 0] / NANOSECONDS <= OLD_S
            found[f"link_{1 + index}_delay_s"][recent, column] = np.maximum(rows[newest[recent], 1], 0.0)
    return found
