"""The page of a study: verdicts, figures, worst flights and how to fly them again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flight_model.arrays import Array
from gcs_formation.errors import RecordError
from gcs_formation.report import html
from gcs_formation.report.geometry import Indices
from gcs_formation.report.html import badge, number, table
from gcs_formation.report.style import (
    BAND,
    GREY,
    INK,
    LIMIT,
    THIN,
    axes_grid,
    legend_below,
    new_figure,
    print_style,
    save,
)
from gcs_formation.studies.dataset import RESULT, STUDY, read_journal, read_plan
from gcs_formation.studies.flight import LEAST_IS_WORST
from gcs_formation.studies.keys import Study
from gcs_formation.studies.plan import columns_of

LEVELS_UP_TO = 12
"""Different values of a parameter up to which each is a level of its own; more are put into bins."""
CONFIDENCE = 0.95
COLUMNS = 3
MARGIN = "margin_used"
CELL_CM = 4.6
WIDE = 30.0
"""Largest by median from which a scale is logarithmic."""
REPORT, FIGURES = "report.html", "figures"
WORST = 3
MOST_FAILED = 50
CAPTIONS = {
    "distributions": "Cumulative distributions; flights without the figure count as beyond its end. Counts as bars.",
    "marginals": "Over each parameter, whatever the others are.",
    "map": "Median of the flights in each cell. Beyond the line, drawn where `margin_used` is a metric and both "
    "sides of it were flown, delays are longer than the margin computed for the loops.",
}
Rows = list[dict[str, Any]]


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
        axes.set_xlabel(name)
        if np.unique(values).size <= LEVELS_UP_TO and not np.mod(values, 1.0).any():
            _counts(axes, values)
            continue
        total = flights.metrics[name].size
        shares = np.arange(1, values.size + 1) / max(total, 1)
        half = np.sqrt(np.log(2.0 / (1.0 - CONFIDENCE)) / (2.0 * max(total, 1)))
        low, high = np.clip(shares - half, 0.0, 1.0), np.clip(shares + half, 0.0, 1.0)
        axes.fill_between(values, low, high, step="post", color=BAND, alpha=0.2, lw=0, label="95 % confidence")
        axes.step(values, shares, where="post", color=BAND, label="share of flights up to this value")
        _bounds(axes, flights.study, name, vertical=True)
        axes.set_ylim(0.0, 1.02)
        _scale(axes, values, "x")
    legend_below(figure)
    return figure


def _counts(axes: Axes, values: Array) -> None:
    """Draw how many flights have each of a few whole values: a share of few among many wouldn't be seen."""
    levels, counts = np.unique(values, return_counts=True)
    bars = axes.bar(levels, counts, width=0.5, color=BAND, label="flights with this value")
    axes.bar_label(bars, [str(count) for count in counts])
    axes.set_xticks(levels, labels=[f"{level:g}" for level in levels])
    axes.set(yscale="log", ylim=(0.5, 3.0 * counts.max()))


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


def is_study(directory: Path) -> bool:
    """Whether a directory is that of a study."""
    return (directory / STUDY).is_file()


def write_study_report(directory: Path) -> Path:
    """Write figures/*.png and report.html of a study, finished or not, into its directory; return the page's path.

    Raises:
        RecordError: nothing was flown yet, or it can't be read or written.
    """
    study = Study.model_validate(read_plan(directory)["study"])
    rows = sorted(read_journal(directory), key=lambda row: row["flight"])
    if not rows:
        raise RecordError(f"found no flight in {directory}; expected: a study of which something was flown")
    flights, result = _flights(study, rows), _result(directory)
    target = directory / REPORT
    try:
        (directory / FIGURES).mkdir(exist_ok=True)
        gallery = "".join(_gallery(flights, directory / FIGURES))
        target.write_text(_page(study, rows, result, gallery, directory), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {directory}: {error.strerror or error}") from error
    return target


def _flights(study: Study, rows: Rows) -> Flights:
    ended = [row for row in rows if row["exit"] <= 1]
    names = [name for name in columns_of(study) if all(_is_number(row.get(name)) for row in ended)]
    columns = {name: np.array([float(row[name]) for row in ended]) for name in names}
    varied = {name: values for name, values in columns.items() if np.unique(values).size > 1}
    metrics = {name: np.array([row[name] for row in ended], dtype=np.float64) for name in study.measured}
    return Flights(study, varied, {name: v for name, v in metrics.items() if np.isfinite(v).any()})


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _gallery(flights: Flights, directory: Path) -> Iterator[str]:
    for name, title, draw in _plates(flights):
        path = directory / f"{name}.png"
        with print_style():
            save(draw(), path)
        yield html.figure(name, title, CAPTIONS[name.partition("-")[0]], path)


def _plates(flights: Flights) -> Iterator[tuple[str, str, Callable[[], Figure]]]:
    if flights.metrics:
        yield "distributions", "Distributions", partial(distributions, flights)
    varied = [name for name, values in flights.metrics.items() if np.unique(values[np.isfinite(values)]).size > 1]
    for metric in varied if flights.parameters else ():
        yield f"marginals-{metric}", metric, partial(marginals, flights, metric)
        for across, up in pairs(list(flights.parameters)):
            title = f"{metric} over {across} and {up}"
            yield f"map-{metric}-{up}", title, partial(heat_map, flights, metric, across, up)


def _page(study: Study, rows: Rows, result: Mapping[str, Any], gallery: str, directory: Path) -> str:
    body = (files("gcs_formation.studies") / "study.html").read_text(encoding="utf-8")
    failed = [row for row in rows if row["exit"] > 1]
    heads = ["Flight", "Exit", "In words"]
    failures = table(heads, [[str(r["flight"]), str(r["exit"]), r["words"]] for r in failed[:MOST_FAILED]], (2,))
    return html.document(
        study.name,
        body,
        subtitle=escape(
            f"{len(rows)} flights; design: {study.design}; seeds {study.seeds.first} and on; {rows[0]['version']}"
        ),
        expectations=_expectations(result),
        crossings=_crossings(study, result),
        figures=gallery,
        worst=_worst(study, rows, directory),
        failed=f"<section>\n<h2>Couldn't be flown</h2>\n{failures}\n</section>" if failed else "",
    )


def _result(directory: Path) -> Mapping[str, Any]:
    """Return study.json; empty for a study that hasn't ended."""
    try:
        return json.loads((directory / RESULT).read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError):
        return {}


def _expectations(result: Mapping[str, Any]) -> str:
    rows = [
        [
            entry["metric"],
            " and ".join(f"{name} {entry[name]:g}" for name in ("below", "above") if name in entry),
            ", ".join(f"{name} = {value}" for name, value in entry["where"].items()),
            f"{entry['kept']} of {entry['flights']}",
            " to ".join(f"{100 * end:.2f} %" for end in entry["interval"]),
            f"{100 * entry['share']:g} %",
            badge(entry["held"], "held" if entry["held"] else "broken"),
        ]
        for entry in result.get("expect", [])
    ]
    heads = ["Figure", "Bound", "Of flights with", "Kept", "Confidence interval", "Expected", ""]
    return table(heads, rows, (0, 1, 2, 6)) if rows else '<p class="note">None, or the study has not ended.</p>'


def _crossings(study: Study, result: Mapping[str, Any]) -> str:
    search = study.bisect
    if search is None or "bisect" not in result:
        return ""
    names = [name for name in study.parameters if name != search.parameter]
    rows = [
        [str(entry["seed"]), *(str(entry.get(name)) for name in names), number(entry["kept"]), number(entry["broken"])]
        for entry in result["bisect"]
    ]
    heads = ["Seed", *names, "kept up to", "broken from"]
    bound = " and ".join(f"{n} {v:g}" for n, v in (("below", search.below), ("above", search.above)) if v is not None)
    title = escape(f"{search.parameter} at which {search.metric} is no longer {bound}")
    return f"<section>\n<h2>{title}</h2>\n{table(heads, rows, ())}\n</section>"


def _worst(study: Study, rows: Rows, directory: Path) -> str:
    names = columns_of(study)
    found: list[list[str]] = []
    for metric in study.measured:
        known = [row for row in rows if row[metric] is not None]
        ordered = sorted(known, key=lambda row: row[metric], reverse=metric not in LEAST_IS_WORST)
        found += [
            [metric, number(row[metric]), str(row["flight"]), str(row["seed"]), *(f"{row.get(name)}" for name in names),
             f"gcs-formation study fly {directory} {row['flight']}"]
            for row in ordered[:WORST]
        ]  # fmt: skip
    return table(["Figure", "Value", "Flight", "Seed", *names, "Again"], found, (0, 4 + len(names)))
