"""The flight seen from above, with the formation at chosen times."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from gcs_formation.arrays import Array
from gcs_formation.report.downsample import evenly
from gcs_formation.report.geometry import Snapshot, path_m, snapshot, snapshot_ticks
from gcs_formation.report.lines import Group, everyone
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import GREY, INK, LIGHT, THIN, WIDTH_CM, axes_grid, legend_below, new_figure

KILOMETRES_FROM_M = 3000.0
SLIMMEST = 0.32
"""Narrow side of the plan by its long side, at least."""
SMALLEST_M = 50.0
MARGIN = 0.06
LONG_CM = 14.5
LETTERS = "ABCDEFGH"
LETTER_PT = 15.0
TRACK_POINTS = 3000
STILLS = 12
"""Times at which everyone's place is dotted into the plan."""
FEW_S = 20.0
"""A flight no longer than this is timed by tenths of a second."""


class Extent(NamedTuple):
    """Least and greatest east and north in m."""

    east: tuple[float, float]
    north: tuple[float, float]

    @property
    def tall(self) -> bool:
        """Whether north reaches further than east."""
        return self.north[1] - self.north[0] > self.east[1] - self.east[0]


def plan(run: RunData) -> Figure:
    """Draw tracks and path from above, and the formation at a few times, all to scale."""
    group = everyone(run)
    stills = [snapshot(run, tick) for tick in snapshot_ticks(run)]
    path = path_m(run)
    extent = _extent(run)
    figure, main, small, aspect = _layout(extent, len(stills))
    _tracks(main, run, group, path)
    _lettered(main, stills)
    _frame(main, extent)
    _formations(small, run, group, stills, aspect)
    legend_below(figure)
    return figure


def _extent(run: RunData) -> Extent:
    """Return the extent of the flown tracks, with a margin and not too slim."""
    everything = np.concatenate([run.flown.place_in_flight(vehicle)[:, :2] for vehicle in run.flown.vehicles])
    known = everything[np.isfinite(everything).all(axis=1)]
    known = known if known.size else np.zeros((1, 2))
    low, high = known.min(axis=0), known.max(axis=0)
    half = (0.5 + MARGIN) * np.maximum(high - low, SLIMMEST * max(float((high - low).max()), SMALLEST_M))
    (south, west), (north, east) = (low + high) / 2 - half, (low + high) / 2 + half
    return Extent((float(west), float(east)), (float(south), float(north)))


def _unit(extent: Extent) -> tuple[float, str]:
    longest = max(extent.north[1] - extent.north[0], extent.east[1] - extent.east[0])
    return (1000.0, "km") if longest >= KILOMETRES_FROM_M else (1.0, "m")


def _layout(extent: Extent, count: int) -> tuple[Figure, Axes, list[Axes], float]:
    """Return a figure, axes for the plan, small ones beside it (if tall) or below, and their height by width."""
    ratio = (extent.north[1] - extent.north[0]) / (extent.east[1] - extent.east[0])
    if extent.tall:
        width_cm = min(LONG_CM / ratio + 1.5, 0.5 * WIDTH_CM)
        height_cm = min(LONG_CM, (width_cm - 1.2) * ratio)
        figure = new_figure(height_cm + 2.2)
        parts = figure.subfigures(1, 2, squeeze=False, width_ratios=[width_cm, WIDTH_CM - width_cm])
        rows, columns = ceil(count / 2), 2
        aspect = (height_cm / rows - 1.2) / ((WIDTH_CM - width_cm - 1.4) / 2 - 0.3)
    else:
        height_cm = LONG_CM * ratio + 1.5
        figure = new_figure(height_cm + 6.0)
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[height_cm, 4.5])
        rows, columns, aspect = 1, count, 1.0
    main, beside = parts.ravel().tolist()
    small = [axes for row in axes_grid(beside, rows, columns) for axes in row]
    for spare in small[count:]:
        spare.set_axis_off()
    return figure, main.subplots(), small[:count], float(np.clip(aspect, 0.8, 2.0))


def _tracks(axes: Axes, run: RunData, group: Group, path: Array) -> None:
    axes.plot(path[:, 1], path[:, 0], color="#F0C27A", lw=3.0, alpha=0.7, label="path", solid_capstyle="butt")
    shown = evenly(run.time_s.size, TRACK_POINTS)
    dots = evenly(run.time_s.size, STILLS)
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        place = run.flown.place_in_flight(vehicle)
        axes.plot(place[shown, 1], place[shown, 0], lw=THIN, label=group.label(vehicle), **group.look(vehicle))
        axes.plot(place[dots, 1], place[dots, 0], ls="", marker=".", ms=1.5, color=group.colour(vehicle))
    axes.plot(path[0, 1], path[0, 0], ls="", marker="o", ms=6, mfc="none", mec=INK, mew=0.9, label="start")


def _lettered(axes: Axes, stills: Sequence[Snapshot]) -> None:
    """Name the places of the snapshots, to the right of the way that the leader goes."""
    for still, letter in zip(stills, LETTERS, strict=False):
        north, east = still.reference
        away = LETTER_PT * np.cos(still.up_rad), -LETTER_PT * np.sin(still.up_rad)
        axes.annotate(
            letter, (east, north), xytext=away, textcoords="offset points", fontweight="bold",
            ha="center", va="center", arrowprops={"arrowstyle": "-", "lw": 0.5, "color": GREY, "shrinkB": 1},
        )  # fmt: skip


def _frame(axes: Axes, extent: Extent) -> None:
    unit, name = _unit(extent)

    def shown(value: float, _: int | None) -> str:
        return f"{value / unit:g}".replace("-", "−")

    axes.set_xlim(*extent.east)
    axes.set_ylim(*extent.north)
    axes.set_aspect("equal", adjustable="box")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(shown))
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.set_xlabel(f"east, {name}")
    axes.set_ylabel(f"north, {name}")


def _formations(small: Sequence[Axes], run: RunData, group: Group, stills: Sequence[Snapshot], aspect: float) -> None:
    """Draw the formation at a few times, all at one scale, the leader's heading up."""
    everything = np.concatenate([part for still in stills for part in (still.slots_m, still.places_m)])
    centre, half = _view(everything, aspect)
    vehicles = list(run.flown.vehicles)
    digits = 0 if run.time_s[-1] - run.time_s[0] > FEW_S else 1
    size = 2.5 if group.banded else 5.0
    for axes, still, letter in zip(small, stills, LETTERS, strict=False):
        axes.plot(*still.slots_m.T, ls="", marker="o", ms=1.4 * size, mfc="none", mec=GREY, mew=THIN, label="slot")
        for vehicle, place, turn in zip(vehicles, still.places_m, still.headings_rad, strict=True):
            colour = group.colour(vehicle)
            pointed = (3, 0, float(-np.degrees(turn)) if np.isfinite(turn) else 0.0)
            shown = GREY if colour == LIGHT else colour
            axes.plot(*place, ls="", marker=pointed, ms=size, color=shown, zorder=2 + (colour != LIGHT))
        axes.set_xlim(centre[0] - half, centre[0] + half)
        axes.set_ylim(centre[1] - half * aspect, centre[1] + half * aspect)
        axes.set_aspect("equal")
        at_s = abs(run.time_s[still.tick])
        axes.set_title(f"{letter}: {at_s:.{digits}f} s", pad=3, fontweight="bold")
        axes.set_xlabel("right, m")
        axes.label_outer()
    small[0].set_ylabel("forward, m")


def _view(places_m: Array, aspect: float) -> tuple[Array, float]:
    """Return the centre and the half width that show all but a vehicle that flew off."""
    known = places_m[np.isfinite(places_m).all(axis=1)]
    if not known.size:
        return np.zeros(2), 10.0
    away = np.hypot(*(known - np.median(known, axis=0)).T)
    near = known[away <= 6.0 * max(float(np.median(away)), 10.0)]
    low, high = near.min(axis=0), near.max(axis=0)
    return (low + high) / 2, 0.62 * max(high[0] - low[0], (high[1] - low[1]) / aspect, 20.0)
