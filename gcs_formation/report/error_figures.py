"""Figures of formation errors over time, of what came before them, of disturbances, and of several laws compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flight_model.arrays import Array, Mask
from formation_scenario.expectation import SETTLED_M, Expectation
from formation_scenario.slot_frame import axis_names
from gcs_formation.record.timeseries import DISTURBANCE
from gcs_formation.report import RunData, style
from gcs_formation.report.gusts import GustError, gusts
from gcs_formation.report.time_axes import (
    Group,
    at_least,
    draw_line,
    everyone,
    finished,
    followers_of,
    span,
    time_label,
)

SHORTEST_S = 5.0
"""A shorter time before the path isn't shown as an assembly: the flight began in the air."""
IN_SLOT_M = 0.01
"""Smallest distance that the figure shows; its scale is logarithmic."""
MARGIN = 0.06
LABELS = ("north, m/s", "east, m/s", "down, m/s")
MIN_MPS = 0.1
"""The axes reach at least this far upwards and downwards."""
WIDTHS = (0.42, 1.0)
"""Widths of the axes of the transient and of the rest."""
HIDES = 3.0
"""The transient gets axes of its own if it is this many times as large as what follows, and not yet settled."""
LONGEST_TRANSIENT = 0.4
"""Share of the flown time in which the transient ends; what comes later counts as steady flight."""
STEADY = 1.3
"""The transient is over once no error exceeds this many times the largest one in steady flight."""
MIN_STEADY_M = 0.02
GONE_M = 10.0
STANDS_OUT = 50.0
"""An error above `GONE_M` and this many times the median means that a vehicle left; the scale becomes logarithmic."""
MIN_M = 0.012
"""The axes reach at least this far upwards and downwards, so that less than a centimetre isn't magnified."""
AROUND_S = 1.0
"""Laws are compared by the largest error within this time before and after each tick, because errors cross zero."""
LAW_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1, 1)))
MIN_SIZE_M = 1e-3
"""Smallest |error| in the comparison of laws, whose scale is logarithmic."""
MINIMUM = r"least possible: $|D|\,T + D^2/2a$"
JOINING_M = 1.0
"""Followers that began in the air, and never were farther from their slots than this, had nothing to join up for."""
ALLOWED = r"held to: $1.5\,(|D|\,T + D^2/2a)$ + 0.05 m"


def assembled_first(run: RunData) -> bool:
    """Whether anything was flown before the path that is to be seen: not by followers that began in their slots."""
    if not run.begun or float(run.whole_time_s[0]) >= -SHORTEST_S:
        return False
    if not run.scenario.start.in_air or not run.followers:
        return True
    before = run.whole_time_s <= 0.0
    known = np.concatenate([np.linalg.norm(run.whole.error(vehicle)[before], axis=1) for vehicle in run.followers])
    return bool((known[np.isfinite(known)] > JOINING_M).any())


def assembly(run: RunData) -> Figure:
    """Draw tracks from above, heights and distances from slots, all before the path."""
    group, followers = everyone(run), followers_of(run)
    before = run.whole_time_s <= 0.0
    time_s = run.whole_time_s[before]
    positions_m = [run.whole.position_in_flight(vehicle)[before] for vehicle in group.vehicles]
    figure = style.new_figure(10.0)
    above, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.2)).ravel().tolist()
    _tracks(above.subplots(), group, positions_m)
    (heights,), (distances,) = style.axes_grid(right, 2, 1, sharex=True)
    group.draw(heights, time_s, [position_m[:, 2] for position_m in positions_m])
    heights.set_ylabel("height, m")
    away = [np.linalg.norm(run.whole.error(vehicle)[before], axis=1) for vehicle in followers.vehicles]
    followers.draw(distances, time_s, [np.maximum(distance, IN_SLOT_M) for distance in away])
    distances.set(yscale="log", ylabel="distance from slot, m", xlabel=time_label(run))
    span(heights, (time_s[0], 0.0))
    style.legend_below(figure)
    return figure


def _tracks(axes: Axes, group: Group, positions_m: list[Array]) -> None:
    shown = style.evenly(len(positions_m[0]), style.TRACK_POINTS)
    for vehicle, position_m in zip(group.vehicles, positions_m, strict=True):
        axes.plot(position_m[shown, 1], position_m[shown, 0], lw=0.7, label=group.label(vehicle), **group.look(vehicle))
        axes.plot(position_m[-1, 1], position_m[-1, 0], ls="", marker="o", ms=3, color=group.colour(vehicle))
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(MARGIN)
    axes.set(xlabel="east, m", ylabel="north, m")


def disturbed(run: RunData) -> bool:
    """Whether ground truth shows that any vehicle was disturbed."""
    own = run.flown.vehicles.values()
    return run.flown.truth and any(np.nan_to_num(each[name]).any() for each in own for name in DISTURBANCE)


def disturbance(run: RunData) -> Figure:
    """Draw the true disturbance of every vehicle; the down component only if there is any."""
    group = everyone(run)
    values = [[run.flown.vehicles[vehicle][name] for vehicle in group.vehicles] for name in DISTURBANCE]
    shown = 3 if np.nan_to_num(np.array(values[2])).any() else 2
    figure = style.new_figure(3.2 + 2.8 * shown)
    grid = style.axes_grid(figure, shown, 1, sharex=True)
    for (axes,), series in zip(grid, values, strict=False):
        group.draw(axes, run.time_s, series)
        at_least(axes, -MIN_MPS, MIN_MPS)
    span(grid[0][0], run.time_s)
    return finished(figure, run, grid, LABELS[:shown])


def has_followers(run: RunData) -> bool:
    """Whether any vehicle followed."""
    return bool(run.followers)


def errors(run: RunData) -> Figure:
    """Draw the errors x, y and z of every follower."""
    group, gusted = followers_of(run), gusts(run)
    figure = style.new_figure(12.5)
    values = np.stack([run.flown.error(vehicle) for vehicle in group.vehicles])
    windows = error_windows(run)
    grid = style.axes_grid(figure, 3, len(windows), sharex="col", width_ratios=WIDTHS[-len(windows) :])
    for column, window in enumerate(windows):
        for row, axis in enumerate("xyz"):
            axes = grid[row][column]
            _panel(axes, group, run.time_s[window], values[:, window, row])
            _expected(axes, run.scenario.expect, axis)
            _after_gusts(axes, gusted, axis)
            at_least(axes, -MIN_M, MIN_M)
    return finished(figure, run, grid, _labels(run, "error"))


def transient_end_s(run: RunData) -> float | None:
    """Return when the transient of the errors is over; None if it doesn't hide what follows."""
    if not run.followers:
        return None
    time_s = run.time_s
    values = np.stack([run.flown.error(vehicle) for vehicle in run.followers])
    size = np.abs(np.where(np.isfinite(values), values, 0.0)).max(axis=0)
    later = time_s >= time_s[0] + LONGEST_TRANSIENT * (time_s[-1] - time_s[0])
    steady = size[later].max(axis=0)
    if not (size.max(axis=0) > np.maximum(HIDES * steady, SETTLED_M)).any():
        return None
    loud = np.flatnonzero((size > STEADY * np.maximum(steady, MIN_STEADY_M)).any(axis=1))
    over_s = float(time_s[loud[-1]]) if loud.size else float(time_s[0])
    split_s = 10.0 * np.ceil((over_s + 1.0) / 10.0)
    return float(split_s) if time_s[0] < split_s < time_s[-1] else None


def error_windows(run: RunData) -> list[Mask]:
    """Return (T,) masks of the flown ticks in the transient and after it; one mask of all if it hides nothing."""
    time_s = run.time_s
    split_s = transient_end_s(run)
    if split_s is None:
        return [np.ones(time_s.shape, dtype=bool)]
    return [time_s <= split_s, time_s >= split_s]


def _panel(axes: Axes, group: Group, time_s: Array, values: Array) -> None:
    size = np.abs(values[np.isfinite(values)])
    usual = max(float(np.median(size)), 1e-3) if size.size else np.inf
    if size.size and size.max() > max(GONE_M, STANDS_OUT * usual):
        axes.set_yscale("symlog", linthresh=10 ** np.ceil(np.log10(usual)))
    group.draw(axes, time_s, list(values))
    axes.axhline(0.0, color="#606060", lw=0.4, zorder=1.2)
    span(axes, time_s)


def _expected(axes: Axes, wanted: tuple[Expectation, ...], axis: str) -> None:
    """Draw the scenario's bounds that are near the range of the axes."""
    low, high = axes.get_ylim()
    begin, end = axes.get_xlim()
    for bound in wanted:
        if bound.metric == f"error_{axis}_m.max" and bound.below and bound.below < 2.0 * max(high, -low):
            reach = max(begin, bound.from_s), min(end, bound.to_s)
            if reach[0] < reach[1]:
                _symmetric(axes, reach, bound.below, "expected bound", color=style.LIMIT, ls=(0, (1, 1.5)))


def _after_gusts(axes: Axes, gusted: list[GustError], axis: str) -> None:
    """Draw, after each gust on followers only, the least error possible under any law and the allowed one."""
    begin, end = axes.get_xlim()
    for error in gusted:
        reach = max(begin, error.at_s), min(end, error.to_s)
        if error.axis == axis and reach[0] < reach[1]:
            _symmetric(axes, reach, error.allowed_m, ALLOWED, color=style.INK, ls=(0, (6, 2)))
            _symmetric(axes, reach, error.min_m, MINIMUM, color=style.INK, ls=(0, (1, 1.5)))


def _symmetric(axes: Axes, reach: tuple[float, float], size: float, label: str, **look: Any) -> None:
    for sign in (-1, 1):
        axes.plot(reach, [sign * size] * 2, lw=style.THIN, label=label, zorder=1.8, **look)


def law_errors(runs: Mapping[str, RunData], spans: Sequence[tuple[float, float]]) -> Figure:
    """Draw the largest |error| under several laws over spans of time, with the marks of the first run."""
    figure = style.new_figure(13.5)
    lines = {law: (run.time_s, largest_around_m(run)) for law, run in runs.items() if run.followers}
    if not lines:
        style.annotate(figure.add_subplot(), "no law flew any follower")
        return figure
    grid = style.axes_grid(figure, 3, len(spans), sharex="col", sharey="row", width_ratios=(0.6, 1.0)[-len(spans) :])
    for axis, row in enumerate(grid):
        for axes, (begin, end) in zip(row, spans, strict=True):
            _laws(axes, {law: (time_s, error_m[:, axis]) for law, (time_s, error_m) in lines.items()}, begin, end)
        largest = max(float(np.nanmax(error_m[:, axis], initial=SETTLED_M)) for _, error_m in lines.values())
        row[0].set_ylim(MIN_SIZE_M, 2.0 * largest)
    first = next(iter(runs.values()))
    return finished(figure, first, grid, _labels(first, "|error|"))


def _labels(run: RunData, what: str) -> tuple[str, str, str]:
    """Return the labels of a figure's rows: errors, or their sizes, along the axes of the run's frame."""
    x, y = axis_names(run.scenario.formation.frame)
    return f"{x} {what} $x$, m", f"{y} {what} $y$, m", f"height {what} $z$, m"


def largest_around_m(run: RunData) -> Array:
    """Return (T, 3): the largest |error| of any follower within `AROUND_S` of each tick."""
    import scipy  # noqa: PLC0415 - few reports compare laws

    errors = np.fmax.reduce(np.abs(np.stack([run.flown.error(vehicle) for vehicle in run.followers])))
    known = np.isfinite(errors)
    ticks = 2 * round(AROUND_S * run.scenario.law.rate_hz) + 1
    around = scipy.ndimage.maximum_filter1d(np.where(known, errors, 0.0), ticks, axis=0, mode="nearest")
    return np.where(known, around, np.nan)


def _laws(axes: Axes, lines: Mapping[str, tuple[Array, Array]], begin: float, end: float) -> None:
    """Draw each law's (T,) |error| of one axis."""
    axes.set_yscale("log")
    highest_m = MIN_SIZE_M
    axes.yaxis.set_major_formatter("{x:g}")
    for index, (law, (time_s, error_m)) in enumerate(lines.items()):
        colour, dash = LAW_COLOURS[index % len(LAW_COLOURS)], DASHES[index % len(DASHES)]
        kept = (time_s >= begin) & (time_s <= end)
        sizes_m = np.maximum(error_m[kept], MIN_SIZE_M)
        draw_line(axes, time_s[kept], sizes_m, color=colour, ls=dash, lw=style.LINE, label=law)
        highest_m = max(highest_m, float(sizes_m.max(initial=MIN_SIZE_M)))
    if highest_m <= MIN_SIZE_M:
        style.annotate(axes, "all below 1 mm")
    axes.axhline(SETTLED_M, color=style.GREY, lw=style.THIN, ls=(0, (4, 2)), label="settled: within 0.5 m")
    span(axes, (begin, end))
