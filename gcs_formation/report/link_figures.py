"""Delays of the links, and how near vehicles came to each other and to the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airlink.endpoint import VehicleId
from flight_model.arrays import Array
from gcs_formation.fleet.quality import NEAR
from gcs_formation.record import figures_of_merit
from gcs_formation.record.timeseries import INJECTED_MEAN
from gcs_formation.report.geometry import extremes
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import GREY, LIMIT, NEAREST, axes_grid, column_of, new_figure, note
from gcs_formation.report.time_axes import (
    BUCKETS,
    Group,
    everyone,
    finished,
    followers_of,
    span,
)

SILENT = 8.0
"""How many times the median age the axis of ages reaches at most: a silent vehicle would flatten all others."""
WINDOWS = 200
"""Stretches of time over which delay and age, which jump from tick to tick, are summed up."""


def latency(run: RunData) -> Figure:
    """Draw each link's one-way delay, injected and measured, how old telemetry was, and what was used of the margin."""
    group, followers = _slowest(run, everyone(run)), _slowest(run, followers_of(run))
    figure = new_figure(12.5)
    rows = column_of(axes_grid(figure, 3, 1, sharex=True), 0)
    delays, ages, injected = (
        [1e3 * _used(run, vehicle, name) for vehicle in group.vehicles] for name in ("delay_s", "age_s", INJECTED_MEAN)
    )
    group.draw_spread(rows[0], run.time_s, delays, WINDOWS)
    group.draw_spread(rows[1], run.time_s, ages, WINDOWS)
    span(rows[0], float(run.time_s[0]), float(run.time_s[-1]))
    if np.nan_to_num(injected).any():
        group.draw_medians(rows[0], run.time_s, injected, WINDOWS, "injected")
    _from_zero(rows[0])
    _age_scale(rows[1], np.stack(ages))
    _margin_used(rows[2], run, followers)
    rows[0].set_ylabel("one-way delay, ms")
    rows[1].set_ylabel("age of telemetry, ms")
    rows[2].set_ylabel("margin used, %")
    return finished(figure, run, [[axes] for axes in figure.axes])


def separation(run: RunData) -> Figure:
    """Draw the least distance of any two vehicles, and every vehicle's height above ground."""
    group = everyone(run)
    limits = run.scenario.safety
    figure = new_figure(9.5)
    rows = column_of(axes_grid(figure, 2, 1, sharex=True), 0)
    window = np.ones(run.time_s.shape, dtype=bool)
    least = figures_of_merit.separation_m(run.flown, window)
    if len(group.vehicles) > 1:
        least = np.where(np.isfinite(least), least, np.nan)
        shown = extremes(least, BUCKETS)
        rows[0].plot(run.time_s[shown], least[shown], color=NEAREST, lw=1.2, label="nearest pair")
        _limit(rows[0], limits.separation_m)
    else:
        note(rows[0], "one vehicle: nothing to be separated from")
    heights = [run.flown.clearance(vehicle) for vehicle in group.vehicles]
    group.draw(rows[1], run.time_s, heights)
    _limit(rows[1], limits.clearance_m)
    rows[0].set_ylabel("least separation, m")
    rows[1].set_ylabel("height above ground, m")
    span(rows[0], float(run.time_s[0]), float(run.time_s[-1]))
    return finished(figure, run, [[axes] for axes in figure.axes])


def _used(run: RunData, vehicle: VehicleId, name: str) -> Array:
    """Return (T,) values of a vehicle's link, NaN while it isn't commanded."""
    own = run.flown.vehicles[vehicle]
    return np.where(own["active"] > 0, own[name], np.nan)


def _slowest(run: RunData, group: Group) -> Group:
    """Return the group with the vehicle of the longest delay singled out."""
    longest = {v: float(np.fmax.reduce(_used(run, v, "delay_s"), initial=0.0)) for v in group.vehicles}
    slowest = max(longest, key=lambda vehicle: longest[vehicle], default=None)
    return replace(group, singled_out=slowest, why="longest delay")


def _age_scale(axes: Axes, ages_ms: Array) -> None:
    """Begin at 0; where a vehicle falls silent, end at what the others need and say how far it goes."""
    _from_zero(axes)
    known = ages_ms[np.isfinite(ages_ms)]
    most_ms = SILENT * max(float(np.median(known)), 1.0) if known.size else np.inf
    if known.size and known.max() > most_ms:
        axes.set_ylim(top=most_ms)
        beyond = f"a silent vehicle: up to {known.max() / 1e3:.1f} s"
        axes.text(0.99, 0.96, beyond, transform=axes.transAxes, ha="right", va="top", color=GREY)


def _from_zero(axes: Axes) -> None:
    """Begin at 0, and leave room above the largest value."""
    axes.set_ylim(0.0, max(1.15 * float(axes.dataLim.y1), 1.0))


def _margin_used(axes: Axes, run: RunData, followers: Group) -> None:
    """Draw each follower's share of its delay margin in use, and the share from which an event reports it."""
    used = [100.0 * run.flown.vehicles[vehicle]["margin_used"] for vehicle in followers.vehicles]
    if not used:
        note(axes, "no followers: no loops")
        return
    followers.draw(axes, run.time_s, used)
    axes.axhline(100.0 * NEAR, color=LIMIT, lw=0.9, ls=(0, (5, 2)), label="near the margin")
    axes.set_ylim(0.0, max(axes.get_ylim()[1], 100.0))


def _limit(axes: Axes, limit: float) -> None:
    """Draw a safety limit, with the axes from 0 on."""
    axes.axhline(limit, color=LIMIT, lw=0.9, ls=(0, (5, 2)), label="safety limit")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), max(high, 1.5 * limit))
