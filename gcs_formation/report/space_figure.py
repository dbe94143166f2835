"""The flight in three dimensions above the ground, and its height over time."""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D

from formation_scenario import ground_of
from gcs_formation.report.downsample import evenly
from gcs_formation.report.lines import Group, everyone
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import GREY, THIN, legend_below, new_figure
from gcs_formation.report.time_axes import span, time_label

TRACK_POINTS = 3000
KILOMETRES_FROM_M = 3000.0
SPACE_RATIO = 0.4
"""Height of the space by its length, once heights are stretched."""
NARROWEST = 0.35
"""Shorter side of the space by its longer one, at least."""
GROUND_CELLS = 180
"""Cells of the ground along the longer side."""
GROUND_COLOURS = LinearSegmentedColormap.from_list("ground", ("#EDF2E4", "#D9D3B8", "#B9A283"))
STEEP = 6.0
"""How much steeper than it is the ground is shaded."""
GROUND, SHADOW, TRACK = 0, 1, 2


class Space(NamedTuple):
    """Limits of the axes: (least, greatest) in m."""

    north: tuple[float, float]
    east: tuple[float, float]
    height: tuple[float, float]

    @property
    def longest(self) -> float:
        """The longer of the two horizontal sides, m."""
        return max(self.north[1] - self.north[0], self.east[1] - self.east[0])

    @property
    def unit(self) -> tuple[float, str]:
        """Unit of the horizontal axes, in m and by name."""
        return (1000.0, "km") if self.longest >= KILOMETRES_FROM_M else (1.0, "m")


def trajectory(run: RunData) -> Figure:
    """Draw the tracks in space over the ground below, heights stretched; with terrain, also heights over time."""
    group = everyone(run)
    profile = run.scenario.terrain is not None
    figure = new_figure(15.0 if profile else 10.5)
    figure.set_layout_engine("none")
    place = (-0.13, 0.26, 1.23, 0.84) if profile else (-0.13, -0.04, 1.23, 1.16)
    axes = cast("Axes3D", figure.add_axes(place, projection="3d", computed_zorder=False))
    shown = evenly(run.time_s.size, TRACK_POINTS)
    space = _space(run)
    _ground(axes, run, space)
    unit, name = space.unit
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        north, east, up = run.flown.place_in_flight(vehicle)[shown].T
        below = run.flown.vehicles[vehicle]["ground_height_m"][shown] if profile else np.full_like(up, space.height[0])
        axes.plot(east / unit, north / unit, below, color="#9A9A9A" if profile else "#DCDCDC", lw=THIN, zorder=SHADOW)
        look = group.look(vehicle)
        axes.plot(east / unit, north / unit, up, lw=0.8, label=group.label(vehicle), zorder=TRACK, **look)
    _frame(axes, space)
    axes.set_xlabel(f"east, {name}", labelpad=6)
    axes.set_ylabel(f"north, {name}", labelpad=8)
    axes.set_zlabel("height, m", labelpad=6)
    if profile:
        _profile(figure.add_axes((0.11, 0.13, 0.86, 0.2)), run, group)
    legend_below(figure, outside=False)
    return figure


def _space(run: RunData) -> Space:
    """Return limits around the flown tracks and, with terrain, the ground below them."""
    places = np.concatenate([run.flown.place_in_flight(vehicle) for vehicle in run.flown.vehicles])
    known = places[np.isfinite(places).all(axis=1)]
    known = known if known.size else np.zeros((1, 3))
    low, high = known.min(axis=0), known.max(axis=0)
    longest = max(float((high - low)[:2].max()), 10.0)
    half = np.maximum((high - low)[:2], NARROWEST * longest) * 0.52
    middle = (low + high)[:2] / 2
    (south, west), (north, east) = middle - half, middle + half
    if run.scenario.terrain is None:
        floor = float(low[2] - 0.15 * max((high[2] - low[2]) * 1.1, 10.0))
    else:
        below = np.concatenate([own["ground_height_m"] for own in run.flown.vehicles.values()])
        floor = float(np.fmin.reduce(below, initial=low[2]))
    top = float(high[2]) + 0.1 * max(float(high[2]) - floor, 10.0)
    return Space((float(south), float(north)), (float(west), float(east)), (floor, top))


def _ground(axes: Axes3D, run: RunData, space: Space) -> None:
    """Draw the terrain as a shaded surface; nothing where the scenario has none."""
    if run.scenario.terrain is None:
        return
    cell_m = space.longest / GROUND_CELLS
    sides = [np.arange(low, high + cell_m, cell_m) for low, high in (space.north, space.east)]
    north, east = np.meshgrid(*sides, indexing="ij")
    height = ground_of(run.scenario).height(north, east)
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


def _frame(axes: Axes3D, space: Space) -> None:
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
    """Draw everyone's height over time, and the ground below the leader (the first follower without one)."""
    shown = evenly(run.time_s.size, TRACK_POINTS)
    time_s = run.time_s[shown]
    below = run.flown.vehicles[group.vehicles[0]]["ground_height_m"][shown]
    span(axes, float(time_s[0]), float(time_s[-1]))
    for vehicle in sorted(group.vehicles, key=group.stands_out):
        axes.plot(time_s, run.flown.place_in_flight(vehicle)[shown, 2], lw=0.8, **group.look(vehicle))
    low = min(0.0, float(np.fmin.reduce(below, initial=0.0)))
    axes.fill_between(time_s, below, low, color="#D9D3B8", lw=0)
    axes.plot(time_s, below, color=GREY, lw=THIN)
    axes.set_ylim(bottom=low)
    axes.set_xlabel(time_label(run))
    axes.set_ylabel("height, m")
