"""One quantity of many vehicles over time: coloured lines, grey lines with the worst in colour, or percentile bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from airlink.identity import VehicleId
from gcs_formation.arrays import Array
from gcs_formation.report.downsample import extremes
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import BAND, FOLLOWERS, GREY, INK, LIGHT, LINE, THIN, WORST

COLOURS_UP_TO = len(FOLLOWERS)
LINES_UP_TO = 20
WIDTHS = (1.9, 1.5, 1.1, 0.8, 0.5)
"""Of the lines of the leader and of followers in the colours of `FOLLOWERS`."""
DASHED = (0, (3, 2))
BUCKETS = 1500
"""Pieces of a line, more than a figure has pixels across."""


@dataclass(frozen=True)
class Group:
    """Vehicles that are drawn together."""

    vehicles: tuple[VehicleId, ...]
    leader: VehicleId | None
    """The one of them that leads first, if any."""
    worst: VehicleId | None
    """The follower with the largest errors."""

    @property
    def banded(self) -> bool:
        """Whether there are too many for a line each."""
        return len(self.vehicles) > LINES_UP_TO

    @property
    def coloured(self) -> bool:
        """Whether each has a colour of its own."""
        return len(self.vehicles) - (self.leader is not None) <= COLOURS_UP_TO

    def colour(self, vehicle: VehicleId) -> str:
        """Return a vehicle's colour."""
        if vehicle == self.leader:
            return INK
        if self.coloured:
            return FOLLOWERS[[v for v in self.vehicles if v != self.leader].index(vehicle)]
        return WORST if vehicle == self.worst else LIGHT

    def width(self, vehicle: VehicleId) -> float:
        """Return the width of a vehicle's line: the first is the widest, so that none hides another."""
        if not self.coloured:
            return THIN if self.colour(vehicle) == LIGHT else LINE
        return WIDTHS[(INK, *FOLLOWERS).index(self.colour(vehicle))]

    def stands_out(self, vehicle: VehicleId) -> bool:
        """Whether a vehicle's line stands out from the others; such lines are drawn last."""
        return self.colour(vehicle) != LIGHT

    def label(self, vehicle: VehicleId) -> str:
        """Return a vehicle's name in the legend; all that look alike have one."""
        if vehicle == self.leader:
            return f"leader ({vehicle})"
        if self.coloured:
            return f"vehicle {vehicle}"
        return f"vehicle {vehicle} (largest error)" if vehicle == self.worst else "other followers"

    def draw(self, axes: Axes, time_s: Array, values: Sequence[Array]) -> None:
        """Draw one (T,) series of each vehicle, those in colour last."""
        if self.banded:
            _bands(axes, time_s, np.stack(values, axis=1))
            return
        pairs = list(zip(self.vehicles, values, strict=True))
        for vehicle, series in sorted(pairs, key=lambda pair: self.stands_out(pair[0])):
            shown = extremes(series, BUCKETS)
            axes.plot(
                time_s[shown],
                series[shown],
                color=self.colour(vehicle),
                lw=self.width(vehicle),
                label=self.label(vehicle),
            )

    def draw_spread(self, axes: Axes, time_s: Array, values: Sequence[Array], windows: int) -> None:
        """Draw how (T,) series that jump up and down spread over stretches of time, not every jump."""
        middle_s, pieces = _stretches(time_s, values, windows)
        if not self.coloured:
            _bands(axes, middle_s, np.concatenate(pieces, axis=1))
            return
        for vehicle, piece in zip(self.vehicles, pieces, strict=True):
            low, middle, high = _percentiles(piece, (0, 50, 100))
            axes.plot(middle_s, middle, color=self.colour(vehicle), lw=self.width(vehicle), label=self.label(vehicle))
            axes.fill_between(middle_s, low, high, color=self.colour(vehicle), alpha=0.12, lw=0)

    def draw_medians(self, axes: Axes, time_s: Array, values: Sequence[Array], windows: int, label: str) -> None:
        """Draw (T,) series beside those of `draw_spread`, dashed: their medians over the same stretches."""
        middle_s, pieces = _stretches(time_s, values, windows)
        if not self.coloured:
            (middle,) = _percentiles(np.concatenate(pieces, axis=1), (50,))
            axes.plot(middle_s, middle, color=INK, lw=LINE, ls=DASHED, label=label)
            return
        for number, (vehicle, piece) in enumerate(zip(self.vehicles, pieces, strict=True)):
            (middle,) = _percentiles(piece, (50,))
            once = label if number == 0 else None
            axes.plot(middle_s, middle, color=self.colour(vehicle), lw=LINE, ls=DASHED, label=once)


def followers_of(run: RunData) -> Group:
    """Return the followers of a run; a leader that has followed another comes first, so that its line is lowest."""
    worst = run.worst_first()
    followers = tuple(sorted(run.followers, key=lambda vehicle: vehicle != run.leader))
    return Group(followers, run.leader if run.leader in followers else None, worst[0] if worst else None)


def everyone(run: RunData) -> Group:
    """Return all vehicles of a run, the leader first."""
    followers = followers_of(run)
    first = (run.leader,) if run.leader else ()
    return Group(first + tuple(v for v in followers.vehicles if v not in first), run.leader, followers.worst)


def _stretches(time_s: Array, values: Sequence[Array], windows: int) -> tuple[Array, list[Array]]:
    """Return the middles of up to about `windows` stretches of time (W,), and each series' values in them (W, K)."""
    width = max(1, time_s.size // windows)
    whole = time_s.size // width * width
    return time_s[:whole].reshape(-1, width).mean(axis=1), [series[:whole].reshape(-1, width) for series in values]


def _bands(axes: Axes, time_s: Array, values: Array) -> None:
    """Draw the median, the 5th to 95th percentile and the extremes of (T, N) values."""
    least, low, middle, high, most = _percentiles(values, (0, 5, 50, 95, 100))
    axes.fill_between(time_s, low, high, color=BAND, alpha=0.25, lw=0, label="5th to 95th percentile")
    axes.plot(time_s, middle, color=BAND, label="median")
    for extreme in (least, most):
        shown = extremes(extreme, BUCKETS)
        axes.plot(time_s[shown], extreme[shown], color=GREY, lw=THIN, label="smallest and largest")


def _percentiles(values: Array, wanted: Sequence[float]) -> Array:
    """Return (P, T) percentiles of the known ones of (T, N) values, NaN where none is."""
    known = np.isfinite(values).any(axis=1)
    found = np.full((len(wanted), values.shape[0]), np.nan)
    if known.any():
        found[:, known] = np.nanpercentile(values[known], wanted, axis=1)
    return found
