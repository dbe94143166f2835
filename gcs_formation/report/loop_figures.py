"""Figures of the control loops over time: setpoints and responses, scheduled gains, delays; and of separation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Mask
from flight_model.slot import CHANNELS
from formation_scenario.law import PidGains
from gcs_formation.control.laws import gain_range
from gcs_formation.record import figures_of_merit
from gcs_formation.record.figures_of_merit import setpoint_steps
from gcs_formation.record.flight import Columns
from gcs_formation.record.timeseries import INJECTED_MEAN
from gcs_formation.report import RunData, style
from gcs_formation.report.error_figures import WIDTHS, error_windows
from gcs_formation.report.time_axes import Group, draw_line, everyone, finished, followers_of, span
from gcs_formation.stability.mismatch import NEAR

MAX_COLUMNS = 4
GAINS = {"kp": "$k_p$", "ki": "$k_i$", "kd": "$k_d$"}
COLUMNS = {"speed": "speed_mps", "heading": "heading_rad", "height": "height_m"}
"""Names of setpoint columns; the response to a speed is an airspeed."""
STEPS = {"speed": "airspeed step, m/s", "heading": "heading step, °", "height": "height step, m"}
MIN_STEP = 0.01
"""The axis of steps reaches at least this far."""
LABELS = {"speed": "airspeed, m/s", "heading": "heading, °", "height": "height, m"}
SILENT = 8.0
"""The axis of ages ends at this many times the median age: a silent vehicle would flatten all others."""


def setpoints(run: RunData) -> Figure:
    """Draw setpoint and response of the leader and of the followers with the largest errors."""
    shown = _shown(run)
    figure = style.new_figure(11.5)
    grid = style.axes_grid(figure, 3, len(shown), sharex=True, sharey="row")
    for column, vehicle in enumerate(shown):
        name = f"leader ({vehicle})" if vehicle == run.leader else f"vehicle {vehicle}"
        grid[0][column].annotate(
            name, (0.5, 1.0), xycoords="axes fraction", xytext=(0, 5), textcoords="offset points",
            ha="center", fontweight="bold",
        )  # fmt: skip
        for row, channel in enumerate(LABELS):
            setpoint, response = followed(run, vehicle, channel)
            draw_line(grid[row][column], run.time_s, setpoint, color=style.ASKED, lw=1.2, label="setpoint")
            draw_line(grid[row][column], run.time_s, response, color=style.INK, lw=style.THIN, label="response")
            span(grid[row][column], run.time_s)
    return finished(figure, run, grid, LABELS.values(), labels=False)


def followed(run: RunData, vehicle: VehicleId, channel: str) -> tuple[Array, Array]:
    """Return setpoint and response (K,) of a channel over the flown time; headings in degrees, unwrapped."""
    columns = run.flown.vehicles[vehicle]
    asked, true = COLUMNS[channel], "true_" if run.flown.truth else ""
    setpoint, response = columns[f"setpoint_{asked}"], columns[true + asked.replace("speed", "airspeed")]
    if channel != "heading":
        return setpoint, response
    steady = _unwrapped_deg(response)
    difference = np.degrees(setpoint) - steady
    return steady + (difference + 180.0) % 360.0 - 180.0, steady


def has_gains(run: RunData) -> bool:
    """Whether any vehicle followed under a law that has gains."""
    return any(_ticks_following(run.flown.vehicles[vehicle]) for vehicle in run.followers)


def gains(run: RunData) -> Figure:
    """Draw one follower's gains relative to their nominal values: the worst of those that follow longest."""
    figure = style.new_figure(11.0)
    windows = error_windows(run)
    grid = style.axes_grid(figure, 3, len(windows), sharex="col", sharey="row", width_ratios=WIDTHS[-len(windows) :])
    columns = max((run.flown.vehicles[each] for each in run.worst_first()), key=_ticks_following)
    for column, window in enumerate(windows):
        for row, gain in zip(grid, GAINS, strict=True):
            _gain(row[column], run, columns, gain, window)
    return finished(figure, run, grid, [f"{label} / nominal" for label in GAINS.values()])


def steps(run: RunData) -> Figure:
    """Draw the steps of each follower's setpoints from tick to tick."""
    group = followers_of(run)
    figure = style.new_figure(11.0)
    grid = style.axes_grid(figure, len(STEPS), 1, sharex=True)
    for (axes,), channel in zip(grid, STEPS, strict=True):
        sizes = [setpoint_steps(run.flown.vehicles[vehicle], channel) for vehicle in group.vehicles]
        if channel == "heading":
            sizes = [np.degrees(size) for size in sizes]
        group.draw_spread(axes, run.time_s, sizes)
        axes.set_ylim(0.0, max(1.05 * float(axes.dataLim.y1), MIN_STEP))
    span(grid[0][0], run.time_s)
    return finished(figure, run, grid, STEPS.values())


def _ticks_following(columns: Columns) -> int:
    return int(np.isfinite(columns["kp_speed"]).sum())


def _shown(run: RunData) -> list[VehicleId]:
    leaders = [run.leader] if run.leader else []
    worst = set(run.worst_first()[: MAX_COLUMNS - len(leaders)])
    return leaders + [vehicle for vehicle in run.followers if vehicle in worst and vehicle not in leaders]


def _gain(axes: Axes, run: RunData, columns: Columns, gain: str, window: Mask) -> None:
    law, time_s = run.scenario_in_force.law, run.time_s[window]
    for channel, colour in zip(CHANNELS, style.FOLLOWERS, strict=False):
        nominal: PidGains = getattr(law, channel)
        values = columns[f"{gain}_{channel}"][window] / (getattr(nominal, gain) or np.nan)
        label = f"{channel}: $k_p$ {nominal.kp:.3g}, $k_i$ {nominal.ki:.3g}/s, $k_d$ {nominal.kd:.3g} s"
        draw_line(axes, time_s, values, color=colour, lw=0.8, label=label)
    gains_range = gain_range(run.scenario)
    if gains_range.span > 0.0:
        low, high = gains_range.base, gains_range.base + gains_range.span
        axes.axhspan(low, high, color=style.GREY, alpha=0.12, lw=0, label="range of the fuzzy scheduler")
    span(axes, time_s)


def _unwrapped_deg(heading_rad: Array) -> Array:
    """Return unwrapped headings, the first known one from -180 to 180 degrees."""
    unwrapped: Array = np.full(heading_rad.shape, np.nan)
    known = np.isfinite(heading_rad)
    unwrapped[known] = np.degrees(np.unwrap(heading_rad[known]))
    first = float(unwrapped[known][0]) if known.any() else 0.0
    return unwrapped - 360.0 * round(first / 360.0)


def latency(run: RunData) -> Figure:
    """Draw each link's one-way delay (injected and measured), the age of telemetry, and the margin in use."""
    group, followers = _slowest(run, everyone(run)), _slowest(run, followers_of(run))
    figure = style.new_figure(12.5)
    grid = style.axes_grid(figure, 3, 1, sharex=True)
    (delay,), (age,), (margin,) = grid
    delays, ages, injected = (
        [1e3 * _used(run, vehicle, name) for vehicle in group.vehicles] for name in ("delay_s", "age_s", INJECTED_MEAN)
    )
    group.draw_spread(delay, run.time_s, delays)
    group.draw_spread(age, run.time_s, ages)
    span(delay, run.time_s)
    if np.nan_to_num(injected).any():
        group.draw_medians(delay, run.time_s, injected, "injected")
    _from_zero(delay)
    _age_scale(age, np.stack(ages))
    _margin_used(margin, run, followers)
    return finished(figure, run, grid, ("one-way delay, ms", "age of telemetry, ms", "margin used, %"))


def separation(run: RunData) -> Figure:
    """Draw the least distance of any two vehicles, and every vehicle's height above ground."""
    group, limits = everyone(run), run.scenario.safety
    figure = style.new_figure(9.5)
    grid = style.axes_grid(figure, 2, 1, sharex=True)
    (difference,), (above,) = grid
    if len(group.vehicles) > 1:
        minimum = figures_of_merit.separation_m(run.flown, np.ones(run.time_s.shape, dtype=bool))
        minimum = np.where(np.isfinite(minimum), minimum, np.nan)
        draw_line(difference, run.time_s, minimum, color=style.NEAREST, lw=1.2, label="nearest pair")
        _limit(difference, limits.separation_m)
    else:
        style.annotate(difference, "one vehicle: nothing to be separated from")
    group.draw(above, run.time_s, [run.flown.clearance(vehicle) for vehicle in group.vehicles])
    _limit(above, limits.clearance_m)
    span(difference, run.time_s)
    return finished(figure, run, grid, ("least separation, m", "height above ground, m"))


def _used(run: RunData, vehicle: VehicleId, name: str) -> Array:
    """Return (T,) values of a vehicle's link, NaN while the vehicle isn't commanded."""
    own = run.flown.vehicles[vehicle]
    return np.where(own["active"] > 0, own[name], np.nan)


def _slowest(run: RunData, group: Group) -> Group:
    """Return the group with the vehicle of the longest delay singled out."""
    longest = {v: float(np.fmax.reduce(_used(run, v, "delay_s"), initial=0.0)) for v in group.vehicles}
    slowest = max(longest, key=lambda vehicle: longest[vehicle], default=None)
    return replace(group, singled_out=slowest, why="longest delay")


def _age_scale(axes: Axes, ages_ms: Array) -> None:
    """Begin at 0. If a vehicle falls silent, end where the others fit, and print its largest age."""
    _from_zero(axes)
    known = ages_ms[np.isfinite(ages_ms)]
    max_ms = SILENT * max(float(np.median(known)), 1.0) if known.size else np.inf
    if known.size and known.max() > max_ms:
        axes.set_ylim(top=max_ms)
        beyond = f"a silent vehicle: up to {known.max() / 1e3:.1f} s"
        axes.text(0.99, 0.96, beyond, transform=axes.transAxes, ha="right", va="top", color=style.GREY)


def _from_zero(axes: Axes) -> None:
    """Begin the axis at 0, and leave room above the largest value."""
    axes.set_ylim(0.0, max(1.15 * float(axes.dataLim.y1), 1.0))


def _margin_used(axes: Axes, run: RunData, followers: Group) -> None:
    """Draw the share of its delay margin that each follower uses, and the share from which an event reports it."""
    used = [100.0 * run.flown.vehicles[vehicle]["margin_used"] for vehicle in followers.vehicles]
    if not used:
        style.annotate(axes, "no followers: no loops")
        return
    followers.draw(axes, run.time_s, used)
    axes.axhline(100.0 * NEAR, color=style.LIMIT, lw=0.9, ls=(0, (5, 2)), label="near the margin")
    axes.set_ylim(0.0, max(axes.get_ylim()[1], 100.0))


def _limit(axes: Axes, limit: float) -> None:
    """Draw a safety limit, and let the axis begin at 0 or below."""
    axes.axhline(limit, color=style.LIMIT, lw=0.9, ls=(0, (5, 2)), label="safety limit")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), max(high, 1.5 * limit))
