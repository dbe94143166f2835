"""Figures of a study: a metric's distribution, and how it depends on one and on two parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcs_formation.arrays import Array
from gcs_formation.report.downsample import Indices
from gcs_formation.report.style import BAND, GREY, INK, LIMIT, THIN, axes_grid, legend_below, new_figure
from gcs_formation.studies.keys import Study

LEVELS_UP_TO = 12
"""Different values of a parameter up to which each is a level of its own; more are put into bins."""
CONFIDENCE = 0.95
COLUMNS = 3
MARGIN = "margin_used"
CELL_CM = 4.6
WIDE = 30.0
"""Largest by median from which a scale is logarithmic."""


class Flights(NamedTuple):
    """A study's flights that came to an end, as columns."""

    study: Study
    parameters: Mapping[str, Array]
    """(N,) values of those that are numbers."""
    metrics: Mapping[str, Array]
    """(N,), NaN where a flight has none."""


def distributions(flights: Flights) -> Figure:
    """Draw each metric's cumulative distribution with its confidence band (Dvoretzky, Kiefer, Wolfowitz, Massart)."""
    names = list(flights.metrics)
    figure, panels = _panels(len(names))
    for axes, name in zip(panels, names, strict=False):
        values = np.sort(flights.metrics[name][np.isfinite(flights.metrics[name])])
        total = flights.metrics[name].size
        shares = np.arange(1, values.size + 1) / max(total, 1)
        half = np.sqrt(np.log(2.0 / (1.0 - CONFIDENCE)) / (2.0 * max(total, 1)))
        low, high = np.clip(shares - half, 0.0, 1.0), np.clip(shares + half, 0.0, 1.0)
        axes.fill_between(values, low, high, step="post", color=BAND, alpha=0.2, lw=0, label="95 % confidence")
        axes.step(values, shares, where="post", color=BAND, label="share of flights up to this value")
        _bounds(axes, flights.study, name, vertical=True)
        axes.set_ylim(0.0, 1.02)
        _scale(axes, values, "x")
        axes.set_xlabel(name)
    legend_below(figure)
    return figure


def marginals(flights: Flights, metric: str) -> Figure:
    """Draw a metric over each parameter: all flights, and their median and 5th to 95th percentile."""
    figure, panels = _panels(len(flights.parameters))
    values = flights.metrics[metric]
    known = np.isfinite(values)
    for axes, (name, parameter) in zip(panels, flights.parameters.items(), strict=False):
        axes.plot(parameter[known], values[known], ls="", marker=".", ms=4, color=GREY, label="flights")
        middles, low, middle, high = _by_level(parameter[known], values[known])
        axes.fill_between(middles, low, high, color=BAND, alpha=0.2, lw=0, label="5th to 95th percentile")
        axes.plot(middles, middle, color=INK, lw=1.2, marker="o", ms=2.5, label="median")
        _bounds(axes, flights.study, metric, vertical=False)
        _scale(axes, values[known], "y")
        axes.set_xlabel(name)
    panels[0].set_ylabel(metric)
    legend_below(figure)
    return figure


def heat_map(flights: Flights, metric: str, across: str, up: str) -> Figure:
    """Draw the median of a metric over two parameters, and where delays reach the computed margin, if that is known."""
    figure = new_figure(9.0)
    axes = figure.add_subplot()
    columns, rows = _edges(flights.parameters[across]), _edges(flights.parameters[up])
    cells = _cell(flights.parameters[up], rows), _cell(flights.parameters[across], columns)
    shape = len(rows) - 1, len(columns) - 1
    table = _medians(flights.metrics[metric], cells, shape)
    if MARGIN in flights.metrics:
        _margin(axes, columns, rows, _medians(flights.metrics[MARGIN], cells, shape))
    drawn = axes.pcolormesh(columns, rows, np.ma.masked_invalid(table), cmap="cividis")
    figure.colorbar(drawn, ax=axes, label=f"{metric}, median")
    for row, column in np.argwhere(np.isfinite(table)):
        middle = float(columns[column : column + 2].mean()), float(rows[row : row + 2].mean())
        _write(axes, middle, float(table[row, column]), table)
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    for axis, name in ((axes.xaxis, across), (axes.yaxis, up)):
        levels = np.unique(flights.parameters[name])
        if levels.size <= LEVELS_UP_TO:
            axis.set_ticks(levels, labels=[f"{level:g}" for level in levels])
    axes.grid(visible=False)
    legend_below(figure)
    return figure


def _medians(values: Array, cells: tuple[Indices, Indices], shape: tuple[int, int]) -> Array:
    """Return the median of the values in each cell of a table, NaN where there are none."""
    table: Array = np.full(shape, np.nan)
    for row, column in np.ndindex(shape):
        inside = values[(cells[0] == row) & (cells[1] == column)]
        known = inside[np.isfinite(inside)]
        table[row, column] = np.median(known) if known.size else np.nan
    return table


def _margin(axes: Axes, columns: Array, rows: Array, used: Array) -> None:
    """Draw where delays use the whole of the margin that theory gives the loops, between the cells' middles."""
    if min(used.shape) < 2 or not np.nanmin(used) < 1.0 < np.nanmax(used):
        return
    middles = [(edges[1:] + edges[:-1]) / 2.0 for edges in (columns, rows)]
    axes.contour(*middles, np.ma.masked_invalid(used), levels=[1.0], colors=[LIMIT], linewidths=1.6)
    axes.plot([], [], color=LIMIT, lw=1.6, label="computed delay margin")


def _write(axes: Axes, place: tuple[float, float], value: float, table: Array) -> None:
    if table.size <= LEVELS_UP_TO**2 / 2:
        dark = value < (np.nanmin(table) + np.nanmax(table)) / 2.0
        axes.text(*place, f"{value:.3g}", ha="center", va="center", color="white" if dark else "black")


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(max(count, 1), COLUMNS)
    rows = -(-max(count, 1) // columns)
    figure = new_figure(CELL_CM * rows + 1.6)
    panels = [axes for row in axes_grid(figure, rows, columns) for axes in row]
    for spare in panels[count:]:
        spare.set_axis_off()
    return figure, panels


def _bounds(axes: Axes, study: Study, metric: str, *, vertical: bool) -> None:
    for wanted in (each for each in study.expect if each.metric == metric):
        for bound in (each for each in (wanted.below, wanted.above) if each is not None):
            (axes.axvline if vertical else axes.axhline)(bound, color=LIMIT, lw=THIN, ls=(0, (5, 2)), label="expected")


def _scale(axes: Axes, values: Array, which: str) -> None:
    if values.size and values.min() > 0.0 and values.max() > WIDE * np.median(values):
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")


def _edges(values: Array) -> Array:
    """Return the borders of a parameter's levels, halfway between them, or of equal bins where there are many."""
    levels: Array = np.unique(values)
    if levels.size > LEVELS_UP_TO:
        return np.linspace(float(levels[0]), float(levels[-1]), LEVELS_UP_TO + 1)
    if levels.size == 1:
        return np.array([levels[0] - 0.5, levels[0] + 0.5])
    between = (levels[1:] + levels[:-1]) / 2.0
    return np.concatenate(([levels[0] - (between[0] - levels[0])], between, [levels[-1] + levels[-1] - between[-1]]))


def _cell(values: Array, edges: Array) -> Indices:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def _by_level(parameter: Array, values: Array) -> tuple[Array, Array, Array, Array]:
    """Return each level's mean of the parameter, and the values' 5th, 50th and 95th percentile there."""
    if not parameter.size:
        none: Array = np.zeros(0)
        return none, none, none, none
    cell = _cell(parameter, _edges(parameter))
    inside = [cell == i for i in np.unique(cell)]
    low, middle, high = np.array([np.percentile(values[each], (5, 50, 95)) for each in inside]).T
    return np.array([parameter[each].mean() for each in inside]), low, middle, high


def pairs(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the pairs of parameters that have a heat map: each with the first."""
    return [(names[0], other) for other in names[1:]]
