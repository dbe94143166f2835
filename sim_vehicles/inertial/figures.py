"""The experiment's figures: alignment, navigation errors, and the true and the computed track."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flight_model.earth import radii_m
from sim_vehicles.inertial.experiment import UNITS, Experiment

CM: Final = 1 / 2.54
DPI: Final = 200
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#8C8C8C"
"""Of Okabe and Ito's palette, which colour-blind readers can tell apart."""
STYLE: Final[dict[Any, Any]] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.5,
    "lines.linewidth": 0.9,
    "axes.linewidth": 0.6,
}


def draw(done: Experiment, directory: Path) -> None:
    """Write alignment.png, navigation.png and track.png."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        for name, figure in (
            ("alignment", _alignment(done)),
            ("navigation", _navigation(done)),
            ("track", _track(done)),
        ):
            figure.savefig(directory / f"{name}.png", format="png", metadata={"Software": None})


def _figure(height_cm: float, width_cm: float = 16.0) -> Figure:
    return Figure(figsize=(width_cm * CM, height_cm * CM), dpi=DPI, layout="constrained")


def _grid(figure: Figure, rows: int, columns: int) -> list[list[Axes]]:
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True)
    return cast("list[list[Axes]]", axes.tolist())


def _alignment(done: Experiment) -> Figure:
    """Draw the misalignment, its standard deviation and the alignment's limits on logarithmic axes."""
    figure, aligned = _figure(6.5), done.alignment
    labels = ("about east, arcsec", "about north, arcsec", "heading, arcmin")
    limits = done.limit_rad / UNITS
    for i, (axes, label) in enumerate(zip(_grid(figure, 1, 3)[0], labels, strict=True)):
        axes.loglog(aligned.times_s, np.abs(aligned.error_rad[:, i]) / UNITS[i], color=BLUE, label="error")
        axes.loglog(aligned.times_s, aligned.sigma_rad[:, i] / UNITS[i], color=ORANGE, label="σ of the filter")
        if limits[i] > 0.0:
            axes.axhline(limits[i], color=GREY, linestyle="--", label="least possible σ")
        axes.set(xlabel="time, s", ylabel=label)
    _legend(figure)
    return figure


def _navigation(done: Experiment) -> Figure:
    """Draw the errors of position, velocity and attitude, with plus and minus one standard deviation."""
    figure, flight = _figure(13.0), done.flight
    labels = (
        ("east, m", "north, m", "up, m"),
        ("east, m/s", "north, m/s", "up, m/s"),
        ("about east, arcsec", "about north, arcsec", "heading, arcmin"),
    )
    units = np.concatenate((np.ones(6), UNITS))
    grid = _grid(figure, 3, 3)
    for i in range(9):
        axes = grid[i // 3][i % 3]
        sigma = flight.sigmas[:, i] / units[i]
        axes.fill_between(
            flight.times_s, -sigma, sigma, color=ORANGE, alpha=0.2, linewidth=0.0, label="±σ of the filter"
        )
        axes.plot(flight.times_s, flight.errors[:, i] / units[i], color=BLUE, label="error")
        axes.set_ylabel(labels[i // 3][i % 3])
        if i >= 6:
            axes.set_xlabel("time, s")
    _legend(figure)
    return figure


def _track(done: Experiment) -> Figure:
    """Draw the true and the computed track: plan view, and height over time."""
    figure, flight = _figure(8.0), done.flight
    lat_rad, lon_rad, height_m = flight.place.T
    meridian_m, across_m = radii_m(float(lat_rad[0]))
    north_m = (lat_rad - lat_rad[0]) * meridian_m
    east_m = (lon_rad - lon_rad[0]) * across_m * np.cos(lat_rad)
    plan, height = cast("list[Axes]", figure.subplots(1, 2).tolist())
    plan.plot(east_m, north_m, color=GREY, label="flown")
    plan.plot(east_m + flight.errors[:, 0], north_m + flight.errors[:, 1], color=BLUE, linestyle="--", label="computed")
    plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", adjustable="datalim")
    height.plot(flight.times_s, height_m, color=GREY)
    height.plot(flight.times_s, height_m + flight.errors[:, 2], color=BLUE, linestyle="--")
    height.set(xlabel="time, s", ylabel="height, m")
    _legend(figure)
    return figure


def _legend(figure: Figure) -> None:
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
