"""Take-off and assembly: everything before the leader starts along its path."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcs_formation.arrays import Array
from gcs_formation.report.downsample import evenly
from gcs_formation.report.lines import Group, everyone, followers_of
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import axes_grid, column_of, legend_below, new_figure
from gcs_formation.report.time_axes import span, time_label

SHORTEST_S = 5.0
"""A flight that begins in the air and at once has no assembly to show."""
TRACK_POINTS = 3000
IN_SLOT_M = 0.01
"""Smallest distance that the figure shows; its scale is logarithmic."""
MARGIN = 0.06


def assembled_first(run: RunData) -> bool:
    """Whether anything was flown before the path."""
    return run.begun and float(run.whole_time_s[0]) < -SHORTEST_S


def assembly(run: RunData) -> Figure:
    """Draw tracks from above, heights and distances from slots, all before the path."""
    group, followers = everyone(run), followers_of(run)
    before = run.whole_time_s <= 0.0
    time_s = run.whole_time_s[before]
    figure = new_figure(10.0)
    above, beside = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.2)).ravel().tolist()
    _tracks(above.subplots(), group, [run.whole.place_in_flight(vehicle)[before] for vehicle in group.vehicles])
    rows = column_of(axes_grid(beside, 2, 1, sharex=True), 0)
    group.draw(rows[0], time_s, [run.whole.place_in_flight(vehicle)[before, 2] for vehicle in group.vehicles])
    rows[0].set_ylabel("height, m")
    away = [np.linalg.norm(run.whole.error(vehicle)[before], axis=1) for vehicle in followers.vehicles]
    followers.draw(rows[1], time_s, [np.maximum(distance, IN_SLOT_M) for distance in away])
    rows[1].set_yscale("log")
    rows[1].set_ylabel("distance from slot, m")
    rows[1].set_xlabel(time_label(run))
    span(rows[0], float(time_s[0]), 0.0)
    legend_below(figure)
    return figure


def _tracks(axes: Axes, group: Group, places: list[Array]) -> None:
    shown = evenly(len(places[0]), TRACK_POINTS)
    for vehicle, place in zip(group.vehicles, places, strict=True):
        axes.plot(place[shown, 1], place[shown, 0], lw=0.7, label=group.label(vehicle), **group.look(vehicle))
        axes.plot(place[-1, 1], place[-1, 0], ls="", marker="o", ms=3, color=group.colour(vehicle))
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(MARGIN)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
