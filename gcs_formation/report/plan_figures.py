"""Figures of the flight from above and in three dimensions, with the formation at chosen times."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D

from flight_model.arrays import Array
from formation_scenario.slot_frame import axis_rad
from gcs_formation.report import RunData, style
from gcs_formation.report.time_axes import Group, everyone, span, time_label

SPACE_RATIO = 0.4
"""Height of the box by its length, after heights are stretched."""
NARROWEST = 0.35
"""Least shorter side of the box, relative to its longer side."""
GROUND_CELLS = 180
"""Cells of the ground along the longer side."""
GROUND_COLOURS = LinearSegmentedColormap.from_list("ground", ("#EDF2E4", "#D9D3B8", "#B9A283"))
STEEP = 6.0
"""Factor by which the ground's shading exaggerates slopes."""
GROUND, SHADOW, TRACK = 0, 1, 2
KILOMETRES_FROM_M = 3000.0
SLIMMEST = 0.32
"""Least short side of the plan, relative to its long side."""
SMALLEST_M = 50.0
MARGIN = 0.06
LONG_CM = 14.5
LETTERS = "ABCDEFGH"
LETTER_PT = 15.0
STILLS = 12
"""Number of times at which all vehicles' positions are dotted into the plan."""
BEFORE_CHANGE_S = 1.0
SNAPSHOTS = 4
FEW_S = 20.0
"""Up to this length of flight, times are shown in tenths of a second."""


Side = tuple[float, float]
Positions = npt.NDArray[np.complexfloating[Any, Any]]
"""Complex numbers: north, and east as the imaginary part."""


class Extent(NamedTuple):
    """Limits of the axes, (least, greatest) in m; a plan has no height."""

    north: Side
    east: Side
    height: tuple[float, float] = (0.0, 0.0)

    @property
    def longest(self) -> float:
        """The longer of the two horizontal sides, m."""
        return max(self.north[1] - self.north[0], self.east[1] - self.east[0])

    @property
    def unit(self) -> tuple[float, str]:
        """Unit of the horizontal axes: its length in m, and its name."""
        return (1000.0, "km") if self.longest >= KILOMETRES_FROM_M else (1.0, "m")


def trajectory(run: RunData) -> Figure:
    """Draw the tracks in space over the ground, heights stretched; with terrain, also heights over time."""
    group = everyone(run)
    profile = run.scenario.terrain is not None
    figure = style.new_figure(15.0 if profile else 10.5)
    figure.set_layout_engine("none")
    rect = (-0.13, 0.26, 1.23, 0.84) if profile else (-0.13, -0.04, 1.23, 1.16)
    axes = cast("Axes3D", figure.add_axes(rect, projection="3d", computed_zorder=False))
    shown = style.evenly(run.time_s.size, style.TRACK_POINTS)
    space = _space(run)
    _ground(axes, run, space)
    unit, name = space.unit
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        north, east, up = run.flown.position_in_flight(vehicle)[shown].T
        below = run.flown.vehicles[vehicle]["ground_height_m"][shown] if profile else np.full_like(up, space.height[0])
        axes.plot(
            east / unit, north / unit, below, color="#9A9A9A" if profile else "#DCDCDC", lw=style.THIN, zorder=SHADOW
        )
        look = group.look(vehicle)
        axes.plot(east / unit, north / unit, up, lw=0.8, label=group.label(vehicle), zorder=TRACK, **look)
    _frame_space(axes, space)
    axes.set_xlabel(f"east, {name}", labelpad=6)
    axes.set_ylabel(f"north, {name}", labelpad=8)
    axes.set_zlabel("height, m", labelpad=6)
    if profile:
        _profile(figure.add_axes((0.11, 0.13, 0.86, 0.2)), run, group)
    style.legend_below(figure, outside=False)
    return figure


def _space(run: RunData) -> Extent:
    """Return limits around the flown tracks and, with terrain, the ground below them."""
    low, high = style.reach(np.concatenate([run.flown.position_in_flight(vehicle) for vehicle in run.flown.vehicles]))
    north, east = _sides(low[:2], high[:2], NARROWEST, 10.0, 0.52)
    if run.scenario.terrain is None:
        floor = float(low[2] - 0.15 * max((high[2] - low[2]) * 1.1, 10.0))
    else:
        below = np.concatenate([own["ground_height_m"] for own in run.flown.vehicles.values()])
        floor = float(np.fmin.reduce(below, initial=low[2]))
    top = float(high[2]) + 0.1 * max(float(high[2]) - floor, 10.0)
    return Extent(north, east, (floor, top))


def _sides(low: Array, high: Array, slimmest: float, smallest_m: float, share: float) -> tuple[Side, Side]:
    """Return limits that extend by `share` of the sides from the middle of `low` to `high`; no side is too narrow."""
    half = share * np.maximum(high - low, slimmest * max(float((high - low).max()), smallest_m))
    (south, west), (north, east) = ((low + high) / 2 + sign * half for sign in (-1.0, 1.0))
    return (float(south), float(north)), (float(west), float(east))


def _ground(axes: Axes3D, run: RunData, space: Extent) -> None:
    """Draw the terrain as a shaded surface, if there is one."""
    if run.scenario.terrain is None:
        return
    cell_m = space.longest / GROUND_CELLS
    sides = [np.arange(low, high + cell_m, cell_m) for low, high in (space.north, space.east)]
    north, east = np.meshgrid(*sides, indexing="ij")
    height = run.scenario.ground.height(north, east)
    known = np.where(np.isfinite(height), height, np.nanmin(height)) if np.isfinite(height).any() else None
    if known is None:
        return
    colours = LightSource(315, 45).shade(
        known, GROUND_COLOURS, blend_mode="soft", vert_exag=STEEP, dx=cell_m, dy=cell_m
    )
    unit, _ = space.unit
    axes.plot_surface(
        east / unit, north / unit, np.clip(known, space.height[0], space.height[1]), facecolors=colours,
        rstride=1, cstride=1, lw=0, antialiased=False, shade=False, zorder=GROUND,
    )  # fmt: skip


def _frame_space(axes: Axes3D, space: Extent) -> None:
    unit, _ = space.unit
    axes.set_xlim(space.east[0] / unit, space.east[1] / unit)
    axes.set_ylim(space.north[0] / unit, space.north[1] / unit)
    axes.set_zlim(*space.height)
    wide, deep = space.east[1] - space.east[0], space.north[1] - space.north[0]
    axes.set_box_aspect((wide, deep, SPACE_RATIO * space.longest))
    axes.view_init(elev=28, azim=-25 if deep > wide else -65)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(5))
    axes.tick_params(pad=1)


def _profile(axes: Axes, run: RunData, group: Group) -> None:
    """Draw all heights over time, and the ground below the leader (below the first follower if there is none)."""
    shown = style.evenly(run.time_s.size, style.TRACK_POINTS)
    time_s = run.time_s[shown]
    below = run.flown.vehicles[group.vehicles[0]]["ground_height_m"][shown]
    span(axes, time_s)
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        axes.plot(time_s, run.flown.position_in_flight(vehicle)[shown, 2], lw=0.8, **group.look(vehicle))
    low = min(0.0, float(np.fmin.reduce(below, initial=0.0)))
    axes.fill_between(time_s, below, low, color="#D9D3B8", lw=0)
    axes.plot(time_s, below, color=style.GREY, lw=style.THIN)
    axes.set_ylim(bottom=low)
    axes.set_xlabel(time_label(run))
    axes.set_ylabel("height, m")


def plan(run: RunData) -> Figure:
    """Draw tracks and path from above, and the formation at a few times, all to scale."""
    group = everyone(run)
    stills = [snapshot(run, tick) for tick in snapshot_ticks(run)]
    path = style.path_m(run)
    extent = _extent(run)
    figure, main, small, aspect = _layout(extent, len(stills))
    _tracks(main, run, group, path)
    _lettered(main, stills)
    _frame(main, extent)
    _formations(small, run, group, stills, aspect)
    style.legend_below(figure)
    return figure


def _extent(run: RunData) -> Extent:
    """Return the extent of the flown tracks, with a margin and not too slim."""
    low, high = style.reach(
        np.concatenate([run.flown.position_in_flight(vehicle)[:, :2] for vehicle in run.flown.vehicles])
    )
    return Extent(*_sides(low, high, SLIMMEST, SMALLEST_M, 0.5 + MARGIN))


def _layout(extent: Extent, count: int) -> tuple[Figure, Axes, list[Axes], float]:
    """Return a figure, its axes for the plan, small axes (beside a tall plan, below others), and their aspect ratio."""
    ratio = (extent.north[1] - extent.north[0]) / (extent.east[1] - extent.east[0])
    if ratio > 1.0:
        width_cm = min(LONG_CM / ratio + 1.5, 0.5 * style.WIDTH_CM)
        height_cm = min(LONG_CM, (width_cm - 1.2) * ratio)
        figure = style.new_figure(height_cm + 2.2)
        parts = figure.subfigures(1, 2, squeeze=False, width_ratios=[width_cm, style.WIDTH_CM - width_cm])
        rows, columns = ceil(count / 2), 2
        aspect = (height_cm / rows - 1.2) / ((style.WIDTH_CM - width_cm - 1.4) / 2 - 0.3)
    else:
        height_cm = LONG_CM * ratio + 1.5
        figure = style.new_figure(height_cm + 6.0)
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[height_cm, 4.5])
        rows, columns, aspect = 1, count, 1.0
    main, narrow = parts.ravel().tolist()
    small = style.panels(narrow, rows, columns, count)
    return figure, main.subplots(), small, float(np.clip(aspect, 0.8, 2.0))


def _tracks(axes: Axes, run: RunData, group: Group, path: Array) -> None:
    axes.plot(path[:, 1], path[:, 0], color="#F0C27A", lw=3.0, alpha=0.7, label="path", solid_capstyle="butt")
    shown = style.evenly(run.time_s.size, style.TRACK_POINTS)
    dots = style.evenly(run.time_s.size, STILLS)
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        position_m = run.flown.position_in_flight(vehicle)
        axes.plot(
            position_m[shown, 1], position_m[shown, 0], lw=style.THIN, label=group.label(vehicle), **group.look(vehicle)
        )
        axes.plot(position_m[dots, 1], position_m[dots, 0], ls="", marker=".", ms=1.5, color=group.colour(vehicle))
    axes.plot(path[0, 1], path[0, 0], ls="", marker="o", ms=6, mfc="none", mec=style.INK, mew=0.9, label="start")


def _lettered(axes: Axes, stills: Sequence[Snapshot]) -> None:
    """Letter the positions of the snapshots, to the right of the leader's direction of flight."""
    for still, letter in zip(stills, LETTERS, strict=False):
        position, away = still.reference, (LETTER_PT * np.cos(still.up_rad), -LETTER_PT * np.sin(still.up_rad))
        axes.annotate(
            letter, (position.imag, position.real), xytext=away, textcoords="offset points", fontweight="bold",
            ha="center", va="center", arrowprops={"arrowstyle": "-", "lw": 0.5, "color": style.GREY, "shrinkB": 1},
        )  # fmt: skip


def _frame(axes: Axes, extent: Extent) -> None:
    unit, name = extent.unit

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
    everything = np.concatenate([part for still in stills for part in (still.slots_m, still.positions_m)])
    centre, half = _view(everything, aspect)
    vehicles = list(run.flown.vehicles)
    digits = 0 if run.time_s[-1] - run.time_s[0] > FEW_S else 1
    size = 2.5 if group.banded else 5.0
    for axes, still, letter in zip(small, stills, LETTERS, strict=False):
        axes.plot(
            *still.slots_m.T, ls="", marker="o", ms=1.4 * size, mfc="none", mec=style.GREY, mew=style.THIN, label="slot"
        )
        for vehicle, position_m, turn in zip(vehicles, still.positions_m, still.headings_rad, strict=True):
            colour = group.colour(vehicle)
            pointed = (3, 0, float(-np.degrees(turn)) if np.isfinite(turn) else 0.0)
            shown = style.GREY if colour == style.LIGHT else colour
            axes.plot(*position_m, ls="", marker=pointed, ms=size, color=shown, zorder=2 + (colour != style.LIGHT))
        axes.set_xlim(centre[0] - half, centre[0] + half)
        axes.set_ylim(centre[1] - half * aspect, centre[1] + half * aspect)
        axes.set_aspect("equal")
        at_s = abs(run.time_s[still.tick])
        axes.set_title(f"{letter}: {at_s:.{digits}f} s", pad=3, fontweight="bold")
        axes.set_xlabel("right, m")
        axes.label_outer()
    small[0].set_ylabel("forward, m")


def _view(positions_m: Array, aspect: float) -> tuple[Array, float]:
    """Return the centre and half width of a view of all vehicles but one that flew off."""
    known = positions_m[np.isfinite(positions_m).all(axis=1)]
    if not known.size:
        return np.zeros(2), 10.0
    away = np.hypot(*(known - np.median(known, axis=0)).T)
    near = known[away <= 6.0 * max(float(np.median(away)), 10.0)]
    low, high = near.min(axis=0), near.max(axis=0)
    return (low + high) / 2, 0.62 * max(high[0] - low[0], (high[1] - low[1]) / aspect, 20.0)


class Snapshot(NamedTuple):
    """The formation at one tick: (N, 2) metres right and forward of the leader, or of the middle without one."""

    tick: int
    reference: complex
    """North, and east as the imaginary part, of the leader or the middle, m."""
    positions_m: Array
    slots_m: Array
    """(F, 2), the followers' only."""
    headings_rad: Array
    """(N,) clockwise from up."""
    up_rad: float
    """Direction that is up: the leader's heading, or the mean heading."""


def snapshot_ticks(run: RunData) -> list[int]:
    """Return flown ticks worth a closer look: start, end, just before changes of shape, and in between."""
    time_s = run.time_s
    begin, end = float(time_s[0]), float(time_s[-1])
    changes = [c.at_s - BEFORE_CHANGE_S for c in run.scenario.formation.changes if begin < c.at_s < end]
    wanted = sorted([begin, *changes[: SNAPSHOTS - 2], end])
    while len(wanted) < SNAPSHOTS:
        gap = int(np.argmax(np.diff(wanted)))
        wanted.insert(gap + 1, (wanted[gap] + wanted[gap + 1]) / 2)
    return sorted({min(int(np.searchsorted(time_s, at)), time_s.size - 1) for at in wanted})


def snapshot(run: RunData, tick: int) -> Snapshot:
    """Return the formation at a flown tick; positions inside are complex: north, and east as the imaginary part."""
    flight, vehicles = run.flown, list(run.flown.vehicles)
    positions, errors = (
        np.array([of(vehicle)[tick, :2] for vehicle in vehicles]) @ (1.0, 1.0j)
        for of in (flight.position_in_flight, flight.error)
    )
    headings = np.array([flight.heading(vehicle)[tick] for vehicle in vehicles])
    leader = flight.leader_at(tick)
    lead = vehicles.index(leader) if leader is not None and flight.airborne(leader)[tick] else None
    reference = _mean(positions) if lead is None else complex(positions[lead])
    up_rad = float(np.angle(_mean(np.exp(1j * headings))) if lead is None else headings[lead])
    leaders_rad = headings if lead is None else np.full_like(headings, up_rad)
    slots = positions + errors * np.exp(1j * axis_rad(run.scenario.formation.frame, leaders_rad, headings))
    following = np.arange(len(vehicles)) != lead

    def right_forward(of: Positions) -> Array:
        turned = (of - reference) * np.exp(-1j * up_rad)
        return np.column_stack((turned.imag, turned.real))

    return Snapshot(
        tick, reference, right_forward(positions), right_forward(slots[following]), headings - up_rad, up_rad
    )


def _mean(values: Positions) -> complex:
    known = values[np.isfinite(values)]
    return complex(known.mean()) if known.size else 0j
