"""Distributions of a study's figures: shares of flights up to a value, or worse than it, with confidence bands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from flight_model.arrays import Array, Mask
from gcs_formation.report.style import BAND, FOLLOWERS, LIMIT, THIN, axes_grid, legend_below, new_figure, panels
from gcs_formation.studies.ended_flights import NO_CLUSTERS, Flights
from gcs_formation.studies.flight import LOWER_IS_WORSE
from gcs_formation.studies.intervals import by_cluster, share_interval

LEVELS_UP_TO = 12
"""Up to this many different values, each is a level; more are put into bins, at most this many."""
WIDE = 30.0
"""Ratio of the largest to the median value from which a scale is logarithmic."""
CONFIDENCE = 0.95
BAND_POINTS = 64
"""Largest number of values at which a band is computed."""
PANELS = 3
"""Plots in a row."""
CELL_CM = 4.6
SERIES = 6
"""Largest number of a parameter's values with a curve each."""
MINIMUM = 4
"""Least number of flights with a value for it to have a curve; the band of fewer says nothing."""
FEW = 2
"""Up to this many different values, flights are counted by value."""
TICKS = 4
"""Intervals between ticks on an axis: a panel is a third of a page wide, and values have up to six digits."""
FAINT, CLEAR, NONE = 0.1, 0.2, 0.0
"""Opacity of a band."""
EXPECTED = (0, (5, 2))
"""Dashes of a bound's line."""


class Curve(NamedTuple):
    """A share of flights over a figure's values, and its confidence band."""

    values: Array
    share: Array
    low: Array
    high: Array


def up_to(values: Array, clusters: Array = NO_CLUSTERS) -> Curve:
    """Return the share of flights up to each value; flights without a value (NaN) count as beyond all.

    Args:
        values: (N,) a figure of the flights.
        clusters: (N,) which cluster each flight is in; empty: they are independent.

    The band is that of `share_interval`, for each value by itself.
    """
    return _curve(np.where(np.isfinite(values), values, np.inf), clusters)


def worse_than(values: Array, clusters: Array = NO_CLUSTERS, *, lower_is_worse: bool) -> Curve:
    """Return the share of flights that are worse than each value, the worst value last; NaN is worse than all.

    Arguments and band are those of `up_to`.
    """
    sign = -1.0 if lower_is_worse else 1.0
    up = _curve(np.where(np.isfinite(values), sign * values, np.inf), clusters)
    return Curve(sign * up.values, 1.0 - up.share, 1.0 - up.high, 1.0 - up.low)


def _curve(badness: Array, clusters: Array) -> Curve:
    """Return the share of flights up to each finite badness.

    The band is computed at up to `BAND_POINTS` values, more of them near the ends; in between it is as wide as at the
    neighbour where it is wider.
    """
    order = np.argsort(badness, kind="stable")
    known = int(np.isfinite(badness).sum())
    spaced = np.sin(np.linspace(0.0, np.pi / 2.0, min(BAND_POINTS, known))) ** 2
    at = np.unique(np.round(spaced * (known - 1)).astype(np.intp))
    clusters = clusters if clusters.size else np.arange(badness.size, dtype=np.float64)
    rank = np.empty(badness.size, dtype=np.intp)
    rank[order] = np.arange(badness.size)
    ends = [share_interval(by_cluster(rank <= each, clusters), CONFIDENCE) for each in at.tolist()]
    low, high = np.array(ends).reshape(-1, 2).T
    ranks = np.arange(known)
    before, after = np.searchsorted(at, ranks, side="right") - 1, np.searchsorted(at, ranks)
    return Curve(badness[order][:known], (1.0 + ranks) / max(badness.size, 1), low[before], high[after])


def distributions(flights: Flights) -> Figure:
    """Draw the share of flights up to each value of each figure."""
    figure, panels = panels_of(len(flights.metrics))
    for axes, (name, values) in zip(panels, flights.metrics.items(), strict=False):
        axes.set_xlabel(name)
        if not has_tail(values):
            _counts(axes, values)
            continue
        curve, alpha = up_to(values, flights.clusters), NONE if flights.chance.exact else CLEAR
        _draw(axes, curve, BAND, "share of flights up to this value", alpha, flights.chance.unit)
        axes.set_ylim(0.0, 1.02)
        _finish(axes, flights, name)
    legend_below(figure)
    return figure


def exceedances(flights: Flights) -> Figure:
    """Draw the share of flights that are worse than each value of each figure that has a tail."""
    named = {name: values for name, values in flights.metrics.items() if has_tail(values)}
    figure, panels = panels_of(len(named))
    label, alpha = "share of flights that are worse than this value", NONE if flights.chance.exact else CLEAR
    for axes, (name, values) in zip(panels, named.items(), strict=False):
        _tail(axes, flights, name, np.ones(values.size, dtype=np.bool_), BAND, label, alpha)
        _finish_tail(axes, flights, name, values.size)
    legend_below(figure)
    return figure


def by_level(flights: Flights, metric: str) -> Figure:
    """Draw both curves for each value of parameters that have few values: a row of two panels for each parameter."""
    names = split_by(flights)
    figure = new_figure(5.4 * len(names) + 0.4)
    values = flights.metrics[metric]
    for (left, right), name in zip(axes_grid(figure, len(names), 2), names, strict=True):
        groups = flights.groups(name)
        for colour, (level, inside) in zip(FOLLOWERS, groups.items(), strict=False):
            curve = up_to(values[inside], flights.clusters_within(inside))
            _draw(left, curve, colour, level, FAINT, flights.chance.unit)
            _tail(right, flights, metric, inside, colour, level, FAINT)
            bounds(left, flights, metric, inside, colour, vertical=True)
            bounds(right, flights, metric, inside, colour, vertical=True)
        left.set(xlabel=metric, ylabel="share up to", ylim=(0.0, 1.02))
        _finish(left, flights, metric)
        _finish_tail(right, flights, metric, min(int(inside.sum()) for inside in groups.values()))
        for colour, inside in zip(FOLLOWERS, groups.values(), strict=False):
            _shares(right, flights, metric, inside, colour)
        right.set_ylabel("share worse than")
        handles, labels = left.get_legend_handles_labels()
        kept = [(handle, label) for handle, label in zip(handles, labels, strict=True) if label in groups]
        right.legend(*zip(*kept, strict=True), title=name, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def split_by(flights: Flights) -> list[str]:
    """Return the parameters with few values, each of which enough flights have, in a random sample."""
    if flights.chance.exact:
        return []
    sizes = {name: [inside.sum() for inside in flights.groups(name).values()] for name in flights.parameters}
    return [name for name, each in sizes.items() if 2 <= len(each) <= SERIES and min(each) >= MINIMUM]


def has_tail(values: Array) -> bool:
    """Whether a figure has enough different values to draw its tail; otherwise flights are counted by value.

    It hasn't if its values are a few whole numbers, or almost all the same.
    """
    levels = np.unique(values[np.isfinite(values)])
    return not (levels.size <= FEW or (levels.size <= LEVELS_UP_TO and not np.mod(levels, 1.0).any()))


def panels_of(count: int, cell_cm: float = CELL_CM) -> tuple[Figure, list[Axes]]:
    """Return a figure with `count` panels, `PANELS` in a row."""
    count = max(count, 1)
    columns = min(count, PANELS)
    rows = -(-count // columns)
    figure = new_figure(cell_cm * rows + 1.6)
    return figure, panels(figure, rows, columns, count)


def bounds(
    axes: Axes, flights: Flights, metric: str, inside: Mask | None = None, colour: str = LIMIT, *, vertical: bool
) -> None:
    """Draw the study's bounds on a figure of exactly these flights, by default of all."""
    for bound in bounds_of(flights, metric, inside):
        (axes.axvline if vertical else axes.axhline)(bound, color=colour, lw=THIN, ls=EXPECTED, label="expected")


def bounds_of(flights: Flights, metric: str, inside: Mask | None = None) -> list[float]:
    """Return the study's bounds on a figure of exactly these flights, by default of all."""
    wanted = flights.wanted(metric, inside)
    return [bound for each in wanted for bound in (each.below, each.above) if bound is not None]


def scale(axes: Axes, values: Array, which: str) -> None:
    """Make a scale logarithmic if a few values are far beyond the others."""
    if is_wide(values):
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")


def is_wide(values: Array) -> bool:
    """Whether the largest of some values is far beyond the others."""
    return bool(values.size and values.min() > 0.0 and values.max() > WIDE * np.median(values))


def _counts(axes: Axes, values: Array) -> None:
    """Draw on a logarithmic scale how many flights have each value or none, so that rare values are seen."""
    levels, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    named = {f"{level:g}": count for level, count in zip(levels.tolist(), counts.tolist(), strict=True)}
    if (without := int(np.isnan(values).sum())) > 0:
        named["none"] = without
    bars = axes.bar(list(named), list(named.values()), width=0.5, color=BAND, label="flights with this value")
    axes.bar_label(bars, [str(count) for count in named.values()])
    axes.set(yscale="log", ylim=(0.5, 3.0 * max(named.values())))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.margins(x=0.2)


def _draw(axes: Axes, curve: Curve, colour: str, label: str, alpha: float, unit: str) -> None:
    band = f"{100.0 * CONFIDENCE:g} % confidence, by {unit}" if alpha == CLEAR else None
    if alpha != NONE:
        axes.fill_between(curve.values, curve.low, curve.high, step="post", color=colour, alpha=alpha, lw=0, label=band)
    axes.step(curve.values, curve.share, where="post", color=colour, label=label)


def _tail(axes: Axes, flights: Flights, metric: str, inside: Mask, colour: str, label: str, alpha: float) -> None:
    """Draw the share of some flights that is worse; beyond the worst value the band goes on to the panel's edge."""
    values, clusters = flights.metrics[metric][inside], flights.clusters_within(inside)
    curve = worse_than(values, clusters, lower_is_worse=metric in LOWER_IS_WORSE)
    if curve.values.size:
        end = _end(_known(flights, metric, inside), metric in LOWER_IS_WORSE)
        curve = Curve(np.append(curve.values, end), *(np.append(each, each[-1]) for each in curve[1:]))
    floor = _floor(inside.sum()) / 2.0
    above = curve._replace(share=np.maximum(curve.share, floor), low=np.maximum(curve.low, floor))
    _draw(axes, above, colour, label, alpha, flights.chance.unit)


def _end(values: Array, lower_is_worse: bool) -> float:
    """Return a value slightly worse than all values."""
    low, high = float(values.min()), float(values.max())
    worst, sign = (low, -1.0) if lower_is_worse else (high, 1.0)
    return worst + sign * (0.2 * worst if is_wide(values) else 0.05 * (high - low))


def _finish(axes: Axes, flights: Flights, metric: str) -> None:
    """Scale a panel's axis of values, and draw the bounds."""
    scale(axes, _known(flights, metric), "x")
    if axes.get_xscale() == "linear":
        axes.xaxis.set_major_locator(MaxNLocator(TICKS, steps=[1, 2, 5, 10]))
    bounds(axes, flights, metric, vertical=True)


def _finish_tail(axes: Axes, flights: Flights, metric: str, fewest: int) -> None:
    """Scale a panel of tails, and draw the bounds."""
    axes.set(xlabel=metric, yscale="log", ylim=(_floor(fewest), 1.1))
    axes.yaxis.set_major_formatter(FuncFormatter(_percent))
    _finish(axes, flights, metric)
    if metric in LOWER_IS_WORSE:
        axes.xaxis.set_inverted(True)
    _shares(axes, flights, metric)


def _shares(axes: Axes, flights: Flights, metric: str, inside: Mask | None = None, colour: str = LIMIT) -> None:
    """Mark the share of flights that each expectation of exactly these flights allows to be worse than its bound.

    The flights' curve should pass below the mark. Shares of less than half a flight are below the panel.
    """
    for wanted in flights.wanted(metric, inside):
        bound = wanted.above if wanted.below is None else wanted.below
        if 1.0 - wanted.share > axes.get_ylim()[0] and bound is not None:
            axes.plot(bound, 1.0 - wanted.share, ls="", marker="x", color=colour, label="allowed share beyond it")


def _known(flights: Flights, metric: str, inside: Mask | None = None) -> Array:
    """Return the values that a panel has to show: the flights', and the bounds on all and on some of them."""
    values = flights.metrics[metric]
    expected = bounds_of(flights, metric) + ([] if inside is None else bounds_of(flights, metric, inside))
    return np.append(values[np.isfinite(values)], expected)


def _floor(count: int) -> float:
    return 0.4 / max(count, 1)


def _percent(share: float, _: object) -> str:
    return f"{100.0 * share:g} %"
