"""Formation errors over time: the transient and the rest, each at its own scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from formation_scenario.expectation import Expectation
from gcs_formation.arrays import Array, Mask
from gcs_formation.record.figures_of_merit import SETTLED_M
from gcs_formation.report.gusts import Gust, gusts
from gcs_formation.report.lines import Group, followers_of
from gcs_formation.report.marks import marks
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import INK, LIMIT, THIN, axes_grid, column_of, legend_below, new_figure
from gcs_formation.report.time_axes import at_least, draw_marks, span, time_label

AXES = {"x": "forward error $x$, m", "y": "right error $y$, m", "z": "height error $z$, m"}
WIDTHS = (0.42, 1.0)
"""Of the axes of the transient and of the rest."""
HIDES = 3.0
"""The transient gets axes of its own where it's this many times what follows, and doesn't count as settled."""
LONGEST_TRANSIENT = 0.4
"""Share of the flown time; what comes later shows what the errors are in steady flight."""
STEADY = 1.3
"""The transient is over once no error exceeds this many times the largest one in steady flight."""
STEADY_AT_LEAST_M = 0.02
GONE_M = 10.0
STANDS_OUT = 50.0
"""An error above `GONE_M` and this many times the median is of a vehicle that left; the scale becomes logarithmic."""
LEAST_M = 0.012
"""What the axes reach to at least, upwards and downwards: less than a centimetre isn't magnified."""
LEAST = r"least possible: $|D|\,T + D^2/2a$"
ALLOWED = r"held to: $1.5\,(|D|\,T + D^2/2a)$ + 0.05 m"


def has_followers(run: RunData) -> bool:
    """Whether anybody followed."""
    return bool(run.followers)


def errors(run: RunData) -> Figure:
    """Draw the errors x, y and z of every follower."""
    group = followers_of(run)
    figure = new_figure(12.5)
    time_s = run.time_s
    values = np.stack([run.flown.error(vehicle) for vehicle in group.vehicles])
    windows = error_windows(run)
    grid = axes_grid(figure, 3, len(windows), sharex="col", width_ratios=WIDTHS[-len(windows) :])
    gusted = gusts(run)
    for column, window in enumerate(windows):
        for row, (axis, label) in enumerate(AXES.items()):
            _panel(grid[row][column], group, time_s[window], values[:, window, row])
            _expected(grid[row][column], run.scenario.expect, axis)
            _after_gusts(grid[row][column], gusted, axis)
            at_least(grid[row][column], -LEAST_M, LEAST_M)
            if column == 0:
                grid[row][column].set_ylabel(label)
    draw_marks([column_of(grid, column) for column in range(len(windows))], marks(run))
    figure.align_ylabels(column_of(grid, 0))
    for axes in grid[-1]:
        axes.set_xlabel(time_label(run))
    legend_below(figure)
    return figure


def transient_end_s(run: RunData) -> float | None:
    """Return when the transient of the errors is over, None where it doesn't hide what follows it."""
    if not run.followers:
        return None
    time_s = run.time_s
    values = np.stack([run.flown.error(vehicle) for vehicle in run.followers])
    size = np.abs(np.where(np.isfinite(values), values, 0.0)).max(axis=0)
    later = time_s >= time_s[0] + LONGEST_TRANSIENT * (time_s[-1] - time_s[0])
    steady = size[later].max(axis=0)
    if not (size.max(axis=0) > np.maximum(HIDES * steady, SETTLED_M)).any():
        return None
    loud = np.flatnonzero((size > STEADY * np.maximum(steady, STEADY_AT_LEAST_M)).any(axis=1))
    over_s = float(time_s[loud[-1]]) if loud.size else float(time_s[0])
    split_s = 10.0 * np.ceil((over_s + 1.0) / 10.0)
    return float(split_s) if time_s[0] < split_s < time_s[-1] else None


def error_windows(run: RunData) -> list[Mask]:
    """Return (T,) masks of the flown ticks in the transient and of the rest; one mask of all where it hides nothing."""
    time_s = run.time_s
    split_s = transient_end_s(run)
    if split_s is None:
        return [np.ones(time_s.shape, dtype=bool)]
    return [time_s <= split_s, time_s >= split_s]


def _panel(axes: Axes, group: Group, time_s: Array, values: Array) -> None:
    """Draw (F, T) errors of one axis."""
    size = np.abs(values[np.isfinite(values)])
    usual = max(float(np.median(size)), 1e-3) if size.size else np.inf
    if size.size and size.max() > max(GONE_M, STANDS_OUT * usual):
        axes.set_yscale("symlog", linthresh=10 ** np.ceil(np.log10(usual)))
    group.draw(axes, time_s, list(values))
    axes.axhline(0.0, color="#606060", lw=0.4, zorder=1.2)
    span(axes, float(time_s[0]), float(time_s[-1]))


def _expected(axes: Axes, wanted: tuple[Expectation, ...], axis: str) -> None:
    """Draw the bounds that the scenario sets, where the axes reach to about them."""
    low, high = axes.get_ylim()
    begin, end = axes.get_xlim()
    for bound in wanted:
        if bound.metric == f"error_{axis}_m.max" and bound.below and bound.below < 2.0 * max(high, -low):
            reach = max(begin, bound.from_s), min(end, bound.to_s)
            if reach[0] < reach[1]:
                _both_ways(axes, reach, bound.below, "expected bound", color=LIMIT, ls=(0, (1, 1.5)))


def _after_gusts(axes: Axes, gusted: list[Gust], axis: str) -> None:
    """Draw the least error that any law can achieve after each gust on followers only, and the bound on ours."""
    begin, end = axes.get_xlim()
    for gust in gusted:
        reach = max(begin, gust.at_s), min(end, gust.to_s)
        for error in gust.errors:
            if error.axis == axis and reach[0] < reach[1]:
                _both_ways(axes, reach, error.allowed_m, ALLOWED, color=INK, ls=(0, (6, 2)))
                _both_ways(axes, reach, error.least_m, LEAST, color=INK, ls=(0, (1, 1.5)))


def _both_ways(axes: Axes, reach: tuple[float, float], size: float, label: str, **look: Any) -> None:
    for sign in (-1, 1):
        axes.plot(reach, [sign * size] * 2, lw=THIN, label=label, zorder=1.8, **look)
