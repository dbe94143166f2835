"""What radios reported, for the record: columns of the time series, and figures of each link."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array
from gcs_formation.link.radio_reports import COUNTS, STALE_S, UNKNOWN, RadioReport

LEVELS: Final = ("rssi", "remrssi", "noise", "remnoise", "txbuf_percent")
"""Fields that are a state, not a count."""
COLUMNS: Final = (*LEVELS, "rxerrors", "fixed")


def with_radio(
    blocks: Iterator[dict[str, Array]], reports: Sequence[Sequence[RadioReport]]
) -> Iterator[dict[str, Array]]:
    """Yield a time series' blocks, each column (T, V), with the newest report at each tick, NaN without a recent one.

    `reports`: of each of the V vehicles' radios, in the order of time; without any the blocks stay as they are.
    """
    known = [_values(each) for each in reports]
    for block in blocks:
        yield block | _columns(block["t_s"][:, 0], known) if any(map(len, reports)) else block


def _values(reports: Sequence[RadioReport]) -> Array:
    """Return (1 + R, 1 + C): when each report came, s, and its fields; the first row is of none."""
    rows = [[each.at / NANOSECONDS, *(float(getattr(each, name)) for name in COLUMNS)] for each in reports]
    values = np.array([[-np.inf, *[np.nan] * len(COLUMNS)], *rows])
    values[:, 1:5][values[:, 1:5] == UNKNOWN] = np.nan
    return values


def _columns(time_s: Array, known: Sequence[Array]) -> dict[str, Array]:
    found = np.full((len(COLUMNS), time_s.size, len(known)), np.nan)
    for column, values in enumerate(known):
        newest = np.searchsorted(values[:, 0], time_s, side="right") - 1
        recent = time_s - values[newest, 0] <= STALE_S
        found[:, recent, column] = values[newest[recent], 1:].T
    return {f"radio_{name}": each for name, each in zip(COLUMNS, found, strict=True)}


def figures(reports: Sequence[RadioReport]) -> Mapping[str, Any] | None:
    """Return a radio's levels (median, least, greatest), and its counts over all reports; None without any."""
    if not reports:
        return None
    values = _values(reports)[1:]
    levels = {name: _level(values[:, 1 + index]) for index, name in enumerate(LEVELS)}
    counts = {name: _counted([getattr(each, name) for each in reports]) for name in ("rxerrors", "fixed")}
    return {"reports": len(reports), **levels, **counts}


def _level(values: Array) -> dict[str, float | None]:
    levels = values[~np.isnan(values)]
    if not levels.size:
        return dict.fromkeys(("p50", "min", "max"))
    return {"p50": float(np.median(levels)), "min": float(levels.min()), "max": float(levels.max())}


def _counted(counts: Sequence[int]) -> int:
    """Return how far a 16-bit count went on after the first report, with what it had counted before."""
    steps = ((after - before) % COUNTS for before, after in pairwise(counts))
    return counts[0] + sum(steps)
