"""The comparison as a figure: the largest error of any follower over time, a line for each law."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from gcs_formation.compare.comparison import Comparison, Line, Window
from gcs_formation.record.figures_of_merit import SETTLED_M
from gcs_formation.report.downsample import extremes
from gcs_formation.report.lines import BUCKETS
from gcs_formation.report.style import GREY, LINE, THIN, axes_grid, column_of, legend_below, new_figure, note
from gcs_formation.report.time_axes import draw_marks, span

LABELS = ("forward |error| $x$, m", "right |error| $y$, m", "height |error| $z$, m")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1, 1)))
LEAST_M = 1e-3
SETTLING_S = 60.0
"""What the left column shows, where the window begins later."""


def comparison_figure(comparison: Comparison) -> Figure:
    """Draw |error| by axis over the window; where that begins later, how the laws settle on the left of it."""
    figure = new_figure(13.5)
    if not comparison.lines:
        note(figure.add_subplot(), "no law flew any follower")
        return figure
    columns = spans(comparison.window)
    ratios = (0.6, 1.0)[-len(columns) :]
    grid = axes_grid(figure, 3, len(columns), sharex="col", sharey="row", width_ratios=ratios)
    for index, (begin, end) in enumerate(columns):
        for axis, axes in enumerate(column_of(grid, index)):
            _panel(axes, comparison.lines, axis, begin, end)
        grid[-1][index].set_xlabel("mission time, s")
    draw_marks([column_of(grid, index) for index in range(len(columns))], comparison.marks)
    for axis, (row, label) in enumerate(zip(grid, LABELS, strict=True)):
        row[0].set_ylabel(label)
        most = max(float(np.nanmax(line.error_m[:, axis], initial=SETTLED_M)) for line in comparison.lines)
        row[0].set_ylim(LEAST_M, 2.0 * most)
    figure.align_ylabels(column_of(grid, 0))
    legend_below(figure)
    return figure


def spans(window: Window) -> list[tuple[float, float]]:
    """Return the spans of time that are drawn beside each other: one, where it shows how laws settle as well."""
    if window.from_s > 0.0 and window.to_s > SETTLING_S:
        return [(0.0, SETTLING_S), (window.from_s, window.to_s)]
    return [(0.0, window.to_s)]


def _panel(axes: Axes, lines: tuple[Line, ...], axis: int, begin: float, end: float) -> None:
    axes.set_yscale("log")
    highest_m = LEAST_M
    axes.yaxis.set_major_formatter(FuncFormatter(_plain))
    for number, line in enumerate(lines):
        kept = (line.time_s >= begin) & (line.time_s <= end)
        time_s, error_m = line.time_s[kept], np.maximum(line.error_m[kept, axis], LEAST_M)
        shown = extremes(error_m, BUCKETS)
        colour, dash = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
        axes.plot(time_s[shown], error_m[shown], color=colour, ls=dash, lw=LINE, label=line.law)
        highest_m = max(highest_m, float(error_m.max(initial=LEAST_M)))
    if highest_m <= LEAST_M:
        note(axes, "all below 1 mm")
    axes.axhline(SETTLED_M, color=GREY, lw=THIN, ls=(0, (4, 2)), label="settled: within 0.5 m")
    span(axes, begin, end)


def _plain(value: float, _: int | None) -> str:
    return f"{value:g}"
