"""Axes over mission time, and one quantity of many vehicles on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from gcs_formation.report import RunData, style

LEVEL_PT = 10.0
MAX_LEVELS = 5
BETWEEN_PT = 25.0
"""How far a mark's name may reach into the gap to the axes on the right."""
GAP_PT = 1.0
"""Gap between a mark's line and its name."""
DARK = "#404040"
UP = {"arrowstyle": "-", "shrinkA": 0, "shrinkB": 0, "color": style.GREY, "lw": style.THIN}
BEHIND = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
LINES_UP_TO = 2 * len(style.FOLLOWERS)
"""Largest number of followers with a line each: every colour once solid, once dashed."""
WIDTHS = (1.9, 1.5, 1.1, 0.8)
"""Line widths of the leader and the first followers, so that none hides another; later ones have the last."""
SOLID, DASHED, DOTTED = (0, ()), (0, (7, 1.5)), (0, (1, 1.2))
BUCKETS = 1500
"""Pieces of a line; more than a figure has pixels across."""
STRETCHES = 200
"""Number of intervals over which values that jump at every tick are summed up: steps, delay and age."""


def time_label(run: RunData) -> str:
    """Return what the time axis counts."""
    return "mission time, s" if run.begun else "time, s"


def span(axes: Axes, times_s: Sequence[float] | Array) -> None:
    """Set the limits of the time axis, also for a single tick; it begins at 0 if the first time is close to it."""
    begin_s, end_s = float(times_s[0]), float(times_s[-1])
    begin_s = 0.0 if 0.0 < begin_s < 0.01 * end_s else begin_s
    axes.set_xlim(begin_s, end_s if end_s > begin_s else begin_s + 1.0)


def draw_line(axes: Axes, time_s: Array, values: Array, **look: Any) -> None:
    """Draw a (T,) series, reduced to what a figure can show."""
    shown = style.extremes(values, BUCKETS)
    axes.plot(time_s[shown], values[shown], **look)


def at_least(axes: Axes, low: float, high: float) -> None:
    """Extend the axis at least to `low` and `high`; call it when everything is drawn."""
    shown = axes.get_ylim()
    axes.set_ylim(min(shown[0], low), max(shown[1], high))


def draw_marks(columns: Sequence[Sequence[Axes]], shown: Sequence[style.Mark], *, labels: bool = True) -> None:
    """Draw a line at each mark through stacked axes, named above the topmost; call it after setting limits.

    The figure grows by the height of names above each other.
    """
    levels = 0
    for number, rows in enumerate(columns, 1):
        begin, end = rows[0].get_xlim()
        inside = [mark for mark in shown if begin <= mark.time_s <= end]
        for axes in rows:
            for mark in inside:
                axes.axvline(mark.time_s, color=style.GREY, lw=style.THIN, ls=(0, (4, 2)), zorder=1.5)
        if labels:
            levels = max(levels, _label(rows[0], inside, BETWEEN_PT if number < len(columns) else 0.0))
    figure = columns[0][0].get_figure(root=True)
    if figure is not None and levels > 1:
        figure.set_figheight(figure.get_figheight() + (levels - 1) * LEVEL_PT / 72)


def finished(
    figure: Figure, run: RunData, grid: Sequence[Sequence[Axes]], names: Iterable[str], *, labels: bool = True
) -> Figure:
    """Mark what happened, name the rows of axes over time, add the legend, and return the figure.

    Call it after setting limits; `labels`: whether marks are named.
    """
    columns = list(zip(*grid, strict=True))
    draw_marks(columns, style.marks(run), labels=labels)
    for axes in grid[-1]:
        axes.set_xlabel(time_label(run))
    for axes, name in zip(columns[0], names, strict=True):
        axes.set_ylabel(name)
    figure.align_ylabels(columns[0])
    style.legend_below(figure)
    return figure


def _label(axes: Axes, marks: Sequence[style.Mark], beyond_pt: float) -> int:
    """Name marks above axes; names may reach `beyond_pt` past the right end. Return the number of levels used.

    The last mark comes first, so that lines up to later names don't cross earlier ones.
    """
    taken: list[list[tuple[float, float]]] = [[] for _ in range(MAX_LEVELS)]
    across = axes.get_xaxis_transform()
    for mark in reversed(marks):
        begin_pt, end_pt, shift_pt, aligned = _label_position(axes, mark, beyond_pt)
        free = (i for i, row in enumerate(taken) if all(end_pt <= b or e <= begin_pt for b, e in row))
        level = next(free, None)
        if level is None:
            continue
        taken[level].append((begin_pt, end_pt))
        at, up_pt = (mark.time_s, 1.0), 3.0 + level * LEVEL_PT
        axes.annotate("", at, (0.0, up_pt), across, "offset points", UP)
        axes.annotate(mark.label, at, (shift_pt, up_pt), across, "offset points", ha=aligned, color=DARK, bbox=BEHIND)
    return sum(bool(row) for row in taken)


def _label_position(
    axes: Axes, mark: style.Mark, beyond_pt: float
) -> tuple[float, float, float, Literal["left", "right"]]:
    """Choose whether a mark's name begins at its line, ends there, or, in narrow axes, runs across it.

    Return its begin and end from the left end of the axes and its offset from the line, in points, and its alignment.
    """
    begin, end = axes.get_xlim()
    width_pt = axes.bbox.width * 72 / style.DPI
    at_pt = (mark.time_s - begin) / (end - begin) * width_pt
    wide_pt = style.CHARACTER_PT * (len(mark.label) + 1)
    last_pt = width_pt + beyond_pt - wide_pt
    if last_pt < at_pt and wide_pt <= at_pt:
        return at_pt - wide_pt, at_pt, -GAP_PT, "right"
    left_pt = min(at_pt, max(0.0, last_pt))
    return left_pt, left_pt + wide_pt, left_pt - at_pt + GAP_PT, "left"


@dataclass(frozen=True)
class Group:
    """Vehicles that are drawn together."""

    vehicles: tuple[VehicleId, ...]
    leader: VehicleId | None
    """The vehicle among them that leads first, if any."""
    singled_out: VehicleId | None
    """The only vehicle with a line of its own if there are too many."""
    why: str = "largest error"
    """Why it is singled out."""

    @property
    def banded(self) -> bool:
        """Whether there are too many vehicles for a line each."""
        return len(self.vehicles) - (self.leader is not None) > LINES_UP_TO

    def colour(self, vehicle: VehicleId) -> str:
        """Return a vehicle's colour."""
        if vehicle == self.leader:
            return style.INK
        if not self.banded:
            return style.FOLLOWERS[self._number(vehicle) % len(style.FOLLOWERS)]
        return style.WORST if vehicle == self.singled_out else style.LIGHT

    def look(self, vehicle: VehicleId) -> dict[str, Any]:
        """Return Matplotlib's colour and line style for a vehicle; dashed if its colour is used for the second time."""
        second = vehicle != self.leader and not self.banded and self._number(vehicle) >= len(style.FOLLOWERS)
        return {"color": self.colour(vehicle), "ls": DASHED if second else SOLID}

    def width(self, vehicle: VehicleId) -> float:
        """Return the width of a vehicle's line."""
        if self.banded:
            return style.LINE if self.stands_out(vehicle) else style.THIN
        return WIDTHS[0] if vehicle == self.leader else WIDTHS[1:][min(self._number(vehicle), len(WIDTHS) - 2)]

    def _number(self, vehicle: VehicleId) -> int:
        """Return the vehicle's index among the followers."""
        return [v for v in self.vehicles if v != self.leader].index(vehicle)

    def stands_out(self, vehicle: VehicleId) -> bool:
        """Whether a vehicle's line stands out from the others; such lines are drawn last."""
        return self.colour(vehicle) != style.LIGHT

    def label(self, vehicle: VehicleId) -> str:
        """Return a vehicle's name in the legend; all that look alike share one."""
        if vehicle == self.leader:
            return f"leader ({vehicle})"
        if not self.banded:
            return f"vehicle {vehicle}"
        return f"vehicle {vehicle} ({self.why})" if vehicle == self.singled_out else "other followers"

    def _lines(self, values: Sequence[Array]) -> Iterator[tuple[VehicleId, Array]]:
        """Yield the series that have a line of their own."""
        for vehicle, series in zip(self.vehicles, values, strict=True):
            if not self.banded or vehicle == self.singled_out:
                yield vehicle, series

    def draw(self, axes: Axes, time_s: Array, values: Sequence[Array]) -> None:
        """Draw one (T,) series for each vehicle, or their spread and the vehicle singled out."""
        if self.banded:
            _bands(axes, time_s, np.stack(values, axis=1))
        for vehicle, series in self._lines(values):
            draw_line(axes, time_s, series, **self._named(vehicle))

    def _named(self, vehicle: VehicleId) -> dict[str, Any]:
        return {"lw": self.width(vehicle), "label": self.label(vehicle), **self.look(vehicle)}

    def draw_spread(self, axes: Axes, time_s: Array, values: Sequence[Array]) -> None:
        """Draw (T,) series that jump at every tick by their spread over intervals of time."""
        middle_s, pieces = _stretches(time_s, values)
        if self.banded:
            _bands(axes, middle_s, np.concatenate(pieces, axis=1))
        for vehicle, piece in self._lines(pieces):
            low, middle, high = _percentiles(piece, (0, 50, 100))
            axes.plot(middle_s, middle, **self._named(vehicle))
            axes.fill_between(middle_s, low, high, color=self.colour(vehicle), alpha=0.12, lw=0)

    def draw_medians(self, axes: Axes, time_s: Array, values: Sequence[Array], label: str) -> None:
        """Draw dotted medians of (T,) series over the intervals of `draw_spread`."""
        middle_s, pieces = _stretches(time_s, values)
        for _, piece in self._lines(pieces):
            axes.plot(middle_s, _percentiles(piece, (50,))[0], color=style.INK, lw=style.LINE, ls=DOTTED, label=label)


def followers_of(run: RunData) -> Group:
    """Return the followers of a run; a leader that has followed another comes first, so that its line is lowest."""
    worst = run.worst_first()
    followers = tuple(sorted(run.followers, key=lambda vehicle: vehicle != run.leader))
    return Group(followers, run.leader if run.leader in followers else None, worst[0] if worst else None)


def everyone(run: RunData) -> Group:
    """Return all vehicles of a run, the leader first."""
    followers = followers_of(run)
    first = (run.leader,) if run.leader else ()
    return Group(first + tuple(v for v in followers.vehicles if v not in first), run.leader, followers.singled_out)


def _stretches(time_s: Array, values: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Return the middles of about `STRETCHES` intervals (W,), and each series' values in them (W, K)."""
    width = max(1, time_s.size // STRETCHES)
    whole = time_s.size // width * width
    return time_s[:whole].reshape(-1, width).mean(axis=1), [series[:whole].reshape(-1, width) for series in values]


def _bands(axes: Axes, time_s: Array, values: Array) -> None:
    """Draw the median, the 5th to 95th percentile and the extremes of (T, N) values."""
    minimum, low, middle, high, maximum = _percentiles(values, (0, 5, 50, 95, 100))
    axes.fill_between(time_s, low, high, color=style.BAND, alpha=0.25, lw=0, label="5th to 95th percentile")
    axes.plot(time_s, middle, color=style.BAND, label="median")
    for extreme in (minimum, maximum):
        draw_line(axes, time_s, extreme, color=style.GREY, lw=style.THIN, label="smallest and largest")


def _percentiles(values: Array, wanted: Sequence[float]) -> Array:
    """Return (P, T) percentiles of the known ones of (T, N) values; NaN if none is known."""
    known = np.isfinite(values).any(axis=1)
    found = np.full((len(wanted), values.shape[0]), np.nan)
    if known.any():
        found[:, known] = np.nanpercentile(values[known], wanted, axis=1)
    return found
