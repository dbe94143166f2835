"""A study's figures over its parameters: one at a time, two at a time, and the crossings that searches found."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from flight_model.arrays import Array
from gcs_formation.report.style import BAND, GREY, INK, LIMIT, THIN, axes_grid, legend_below, new_figure, panels
from gcs_formation.studies import LISTED, Bisection, LogUniform
from gcs_formation.studies.curves import CELL_CM, EXPECTED, LEVELS_UP_TO, bounds, bounds_of, is_wide, panels_of, scale
from gcs_formation.studies.ended_flights import Flights
from gcs_formation.studies.plan import Row

LISTED_UP_TO = 40
"""Up to this many different values of a list, each is a level of its own."""
IN_A_BIN = 5
"""Average number of flights that a bin should have at least."""
ROUND = (1.0, 2.0, 5.0)
"""Ticks labelled in each decade of a logarithmic axis."""
LABEL = 24
"""Longest name of a value, in characters."""
IN_A_ROW = 24
"""Characters that fit below an axis, all names together."""
MARGIN, LOOP_DELAY, MARGIN_S = "margin_used", "worst_loop_delay_s", "delay_margin_s"
CELLS = mpl.colormaps["cividis"]
PANELS, MAPPED = 9, 4
"""Number of parameters that a figure is drawn over, and that have maps; of more, those with the largest effect."""
UPRIGHT_CM = 0.17
"""Length of a character of a vertical name."""
PURPLE = "#CC79A7"
"""Visible on a map's dark cells and on its light ones."""
ROOM = ((9.0, 3), (12.0, 2))
"""Up to the first number of cells side by side, each has its value written in, with the second number of digits."""
KEPT = ("kept", "broken")
MAPS, MAP_CM = 2, 6.5
"""Maps in a row, and the height of one."""


def marginals(flights: Flights, metric: str) -> Figure:
    """Draw a metric over each parameter: all flights, their median, and their 5th to 95th percentile."""
    names = most_influential(flights, metric, PANELS)
    words = [words_of(flights, name) for name in names if name in flights.levels]
    upright = max((len(word) for each in words if is_crowded(each) for word in each), default=0)
    figure, panels = panels_of(len(names), CELL_CM + UPRIGHT_CM * upright)
    values = flights.metrics[metric]
    known = np.isfinite(values)
    for axes, name in zip(panels, names, strict=False):
        parameter = flights.parameters[name]
        axes.plot(parameter[known], values[known], ls="", marker=".", ms=4, color=GREY, label="flights")
        cell = _binned(flights, name)
        inside = [known & (cell == i) for i in np.unique(cell[known])]
        low, middle, high = np.array([np.percentile(values[each], (5, 50, 95)) for each in inside]).T
        _along(axes, np.array([parameter[each].mean() for each in inside]), (low, middle, high), name in flights.levels)
        bounds(axes, flights, metric, vertical=False)
        _bounds_at(axes, flights, metric, name)
        scale(axes, np.append(values[known], bounds_of(flights, metric)), "y")
        tick(flights, axes.xaxis, name, below=True)
    for axes in panels[::3]:
        axes.set_ylabel(metric)
    legend_below(figure)
    return figure


def _bounds_at(axes: Axes, flights: Flights, metric: str, name: str) -> None:
    """Draw the bounds on flights with one value of a parameter, over that value only."""
    edges, cell = edges_of(flights, name, flights.parameters[name].size // IN_A_BIN), _binned(flights, name)
    for i in np.unique(cell).tolist():
        for bound in bounds_of(flights, metric, cell == i):
            axes.plot(edges[i : i + 2], [bound] * 2, color=LIMIT, lw=THIN, ls=EXPECTED, label="expected")


def _along(axes: Axes, middles: Array, spread: tuple[Array, Array, Array], named: bool) -> None:
    """Draw median and spread; `named`: for a parameter that isn't a number, without lines between its values."""
    low, middle, high = spread
    words = "5th to 95th percentile"
    if named:
        axes.margins(x=0.25)
        axes.vlines(middles, low, high, color=BAND, alpha=0.4, lw=5.0, label=words)
    else:
        axes.fill_between(middles, low, high, color=BAND, alpha=0.2, lw=0, label=words)
    axes.plot(middles, middle, color=INK, lw=1.2, ls="" if named else "-", marker="o", ms=2.5, label="median")


def most_influential(flights: Flights, metric: str, maximum: int) -> list[str]:
    """Return the parameters in their order; of more than `maximum`, those with the largest effect on a metric.

    The effect is the share of the variance of the metric's ranks that lies between a parameter's levels or bins.
    """
    values = flights.metrics[metric]
    ranks = np.argsort(np.argsort(np.where(np.isnan(values), np.inf, values))).astype(np.float64)

    def between(name: str) -> float:
        cell = _binned(flights, name)
        means = {i: ranks[cell == i].mean() for i in np.unique(cell).tolist()}
        return float(np.var([means[i] for i in cell.tolist()]))

    best = sorted(flights.parameters, key=between, reverse=True)[:maximum]
    return [name for name in flights.parameters if name in best]


def pairs(flights: Flights, metric: str) -> list[tuple[str, str]]:
    """Return pairs of parameters for maps, the one with more names on the y axis; none if one is varied at a time."""
    if flights.study.design == "one_at_a_time":
        return []
    names = most_influential(flights, metric, MAPPED)
    return list(combinations(sorted(names, key=lambda name: len(flights.levels.get(name, ()))), 2))


def heat_maps(flights: Flights, metric: str) -> Figure:
    """Draw the median of a metric over pairs of parameters, and the lines where it or the delays reach their bounds."""
    found = pairs(flights, metric)
    columns = min(len(found), MAPS)
    figure = new_figure(1.6 + MAP_CM * -(-len(found) // columns))
    maps = panels(figure, -(-len(found) // columns), columns, len(found))
    tables = [_table(flights, flights.metrics[metric], pair) for pair in found]
    known = np.concatenate([table.cells[np.isfinite(table.cells)] for table in tables])
    norm = (LogNorm if is_wide(known) else Normalize)(float(known.min()), float(known.max()))
    for axes, pair, table in zip(maps, found, tables, strict=True):
        axes.pcolormesh(table.columns, table.rows, np.ma.masked_invalid(table.cells), cmap=CELLS, norm=norm)
        if (digits := _room(table, columns)) > 0:
            _write(axes, table, norm, digits)
        if pair[0] not in flights.levels:
            _boundaries(axes, flights, metric, pair, table, logarithmic=isinstance(norm, LogNorm))
        tick(flights, axes.xaxis, pair[0], below=True)
        tick(flights, axes.yaxis, pair[1], below=False)
        axes.grid(visible=False)
    shrink = 0.6 if len(found) > columns else 1.0
    figure.colorbar(ScalarMappable(norm, CELLS), ax=figure.axes, label=f"{metric}, median", shrink=shrink)
    legend_below(figure)
    return figure


class _Table(NamedTuple):
    """Medians of the flights in the cells between edges; NaN for an empty cell."""

    columns: Array
    rows: Array
    cells: Array


def _table(flights: Flights, values: Array, pair: tuple[str, str]) -> _Table:
    maximum = int(np.sqrt(values.size / IN_A_BIN))
    columns, rows = (edges_of(flights, name, maximum) for name in pair)
    column, row = (cells_of(flights.parameters[name], edges) for name, edges in zip(pair, (columns, rows), strict=True))
    cells: Array = np.full((len(rows) - 1, len(columns) - 1), np.nan)
    for cell in np.ndindex(*cells.shape):
        inside = values[(row == cell[0]) & (column == cell[1])]
        known = inside[np.isfinite(inside)]
        cells[cell] = np.median(known) if known.size else np.nan
    return _Table(columns, rows, cells)


def _boundaries(
    axes: Axes, flights: Flights, metric: str, pair: tuple[str, str], table: _Table, *, logarithmic: bool
) -> None:
    used = margin_used(flights)
    if used is not None:
        _boundary(axes, _table(flights, used, pair), 1.0, LIMIT, "computed delay margin")
    for bound in bounds_of(flights, metric):
        label, cells, level = f"{metric} = {bound:g}, as expected", table.cells, bound
        if logarithmic and bound > 0.0:
            cells, level = np.log(cells), math.log(bound)
        _boundary(axes, table._replace(cells=cells), level, PURPLE, label)


def margin_used(flights: Flights) -> Array | None:
    """Return the share of the computed delay margin that each flight's loops used; None if it wasn't measured."""
    if {LOOP_DELAY, MARGIN_S} <= flights.metrics.keys():
        return flights.metrics[LOOP_DELAY] / flights.metrics[MARGIN_S]
    return flights.metrics.get(MARGIN)


def _boundary(axes: Axes, table: _Table, level: float, colour: str, label: str) -> None:
    """Draw where a table crosses a level, row by row, between the middles of its columns."""
    middles = (table.columns[1:] + table.columns[:-1]) / 2.0
    for row, values in enumerate(table.cells):
        for at in crossings_of(middles, values, level):
            axes.plot([at, at], table.rows[row : row + 2], color=colour, lw=1.8, label=label)


def crossings_of(positions: Array, values: Array, level: float) -> list[float]:
    """Return the positions at which values cross a level, between known neighbours."""
    off = values - level
    known = np.isfinite(off[:-1]) & np.isfinite(off[1:])
    found = np.flatnonzero(known & ((off[:-1] < 0.0) != (off[1:] < 0.0)))
    return [float(positions[i] + (positions[i + 1] - positions[i]) * off[i] / (off[i] - off[i + 1])) for i in found]


def _room(table: _Table, maps: int) -> int:
    """Return the digits with which the narrowest cell's value fits, with `maps` in a row; 0 if it doesn't."""
    widths = np.diff(table.columns)
    columns_across = maps * float(widths.sum() / widths.min())
    return next((digits for maximum, digits in ROOM if columns_across <= maximum + 1e-9), 0)


def _write(axes: Axes, table: _Table, norm: Normalize, digits: int) -> None:
    for row, column in np.argwhere(np.isfinite(table.cells)):
        centre = float(table.columns[column : column + 2].mean()), float(table.rows[row : row + 2].mean())
        value = float(table.cells[row, column])
        ink = "white" if norm(value) < 0.5 else "black"
        behind = {"facecolor": CELLS(norm(value)), "edgecolor": "none", "pad": 1.0}  # a boundary may cross the text
        axes.text(*centre, f"{value:.{digits}g}", ha="center", va="center", color=ink, bbox=behind)


def searched(flights: Flights, search: Bisection, found: Sequence[Mapping[str, Any]], rows: Sequence[Row]) -> Figure:
    """Draw where each search found its bound crossed, and the loops' delays there if they were measured.

    These are the loop delays of the two flights around the crossing, beside the margin computed for the loops.
    """
    names = [name for name in flights.study.parameters if name != search.parameter]
    words = [_sample(entry, names, flights.study.seeds.count) for entry in found]
    measured = {LOOP_DELAY, MARGIN_S} <= flights.metrics.keys()
    figure = new_figure(2.6 + 0.75 * len(found))
    (panels,) = axes_grid(figure, 1, 1 + measured, sharey=True)
    _ends(panels[0], [tuple(entry[key] for key in KEPT) for entry in found])
    panels[0].set_xlabel(search.parameter)
    panels[0].set_yticks(range(len(found)), labels=words)
    panels[0].set_ylim(len(found) - 0.5, -0.5)
    if measured:
        ends = [[_row_at(rows, entry, names, search.parameter, entry[key]) for key in KEPT] for entry in found]
        _ends(panels[1], [tuple(row.get(LOOP_DELAY) for row in each) for each in ends])
        for index, (kept, broken) in enumerate(ends):
            margin_s = kept.get(MARGIN_S, broken.get(MARGIN_S))
            if margin_s is not None:
                panels[1].plot(margin_s, index, ls="", marker="D", ms=4, color=LIMIT, label="computed delay margin")
        panels[1].set_xlabel("loop's delay there, s")
    legend_below(figure)
    return figure


def _ends(axes: Axes, ends: Sequence[tuple[Any, ...]]) -> None:
    for index, (kept, broken) in enumerate(ends):
        if kept is not None and broken is not None:
            axes.plot([kept, broken], [index, index], color=BAND, lw=2.5, label="kept to broken")
        elif kept is not None:
            axes.plot(kept, index, ls="", marker=">", color=BAND, label="kept up to the high end")
        elif broken is not None:
            axes.plot(broken, index, ls="", marker="<", color=BAND, label="broken at the low end")


def _sample(entry: Mapping[str, Any], names: Sequence[str], seeds: int) -> str:
    words = [str(entry.get(name)) for name in names]
    return ", ".join([*words, *([f"seed {entry['seed']}"] if seeds > 1 or not words else [])])


def _row_at(
    rows: Sequence[Row], entry: Mapping[str, Any], names: Sequence[str], searched: str, value: float | None
) -> Row:
    """Return the flight of a search at a value; empty if there is none."""
    same = (row for row in rows if row["seed"] == entry["seed"] and row.get(searched) == value)
    none: Row = {}
    return next((row for row in same if all(row.get(name) == entry.get(name) for name in names)), none)


def edges_of(flights: Flights, name: str, maximum: int) -> Array:
    """Return the borders of a parameter's levels, halfway between them; of drawn values, those of equally full bins."""
    levels: Array = np.unique(flights.parameters[name])
    listed = isinstance(flights.study.parameters.get(name), LISTED)
    if flights.draws(name) or levels.size > (LISTED_UP_TO if listed else LEVELS_UP_TO):
        bins = int(np.clip(maximum, 2, LEVELS_UP_TO))
        return np.quantile(levels, np.linspace(0.0, 1.0, bins + 1))
    if levels.size == 1:
        return np.array([levels[0] - 0.5, levels[0] + 0.5])
    between = (levels[1:] + levels[:-1]) / 2.0
    return np.concatenate(([levels[0] - (between[0] - levels[0])], between, [levels[-1] + levels[-1] - between[-1]]))


def _binned(flights: Flights, name: str) -> npt.NDArray[np.intp]:
    values = flights.parameters[name]
    return cells_of(values, edges_of(flights, name, values.size // IN_A_BIN))


def cells_of(values: Array, edges: Array) -> npt.NDArray[np.intp]:
    """Return the index of the cell between edges in which each value lies."""
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def tick(flights: Flights, axis: Axis, name: str, *, below: bool) -> None:
    """Label a parameter's axis, and its levels if there are few; names that don't fit below an axis are vertical."""
    axis.set_label_text(name if len(name) <= LABEL or "." not in name else ".\n".join(name.rsplit(".", 1)))
    if isinstance(flights.study.parameters.get(name), LogUniform):
        (axis.axes.set_xscale if below else axis.axes.set_yscale)("log")
        axis.set_major_locator(LogLocator(subs=ROUND))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    levels = np.unique(flights.parameters[name])
    if levels.size <= LEVELS_UP_TO and not flights.draws(name):
        words = words_of(flights, name)
        axis.set_ticks(levels, labels=words, rotation=90 if below and is_crowded(words) else 0)


def words_of(flights: Flights, name: str) -> list[str]:
    """Return a parameter's values in words, shortened."""
    levels: list[float] = np.unique(flights.parameters[name]).tolist()
    return [textwrap.shorten(flights.word(name, level), LABEL, placeholder=" …") for level in levels]


def is_crowded(words: Sequence[str]) -> bool:
    """Whether names don't fit below an axis side by side."""
    return max(map(len, words)) * len(words) > IN_A_ROW
