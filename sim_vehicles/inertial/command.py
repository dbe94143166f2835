"""`sim-vehicles sins SCENARIO`: the navigation experiment, its directory and its figures."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final, cast

import click
import matplotlib as mpl
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airlink.cli import SEED, Status, fail
from airlink.cli.output_directory import OUT, default_directory, refusal
from flight_model.arrays import Array
from flight_model.earth import radii_m
from formation_scenario import Scenario, ScenarioError, Vehicle, dump_scenario, load_scenario
from sim_vehicles.inertial.experiment import (
    ANGLES,
    AXES,
    UNITS,
    DivergedError,
    Experiment,
    experiment,
    inertial_vehicles,
    summary,
)

CM: Final = 1 / 2.54
WIDTH_CM: Final = 16.0
DPI: Final = 200
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#8C8C8C"
"""From Okabe and Ito's palette, which colour-blind readers can distinguish."""
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
LENGTHS: Final = tuple(f"{axis}_{unit}" for unit in ("m", "mps") for axis in AXES)
ANGLE_LABELS: Final = ("about east, arcsec", "about north, arcsec", "heading, arcmin")
SHARPEST_LIMIT_RAD = math.radians(5.0)
"""Above this, the alignment's heading error is no small angle any more and its heading is useless."""
EXAMPLES = """\b
Examples:
  sim-vehicles sins configs/sins.yaml                              alignment, then free-inertial flight
  sim-vehicles sins configs/sins.yaml --set vehicles.0.navigation.aiding=gnss --out runs/aided
"""


def draw(done: Experiment, directory: Path) -> None:
    """Write alignment.png, navigation.png and track.png."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        for name, figure in (
            ("alignment", _alignment_figure(done)),
            ("navigation", _navigation(done)),
            ("track", _track(done)),
        ):
            figure.savefig(directory / f"{name}.png", format="png", metadata={"Software": None})


def _figure(height_cm: float) -> Figure:
    return Figure(figsize=(WIDTH_CM * CM, height_cm * CM), dpi=DPI, layout="constrained")


def _grid(figure: Figure, rows: int) -> list[Axes]:
    return cast("list[Axes]", figure.subplots(rows, 3, squeeze=False, sharex=True).ravel().tolist())


def _alignment_figure(done: Experiment) -> Figure:
    """Draw the misalignment, its standard deviation and the alignment's limits on logarithmic axes."""
    figure, aligned = _figure(6.5), done.alignment
    limits = done.limit_rad / UNITS
    for i, (axes, label) in enumerate(zip(_grid(figure, 1), ANGLE_LABELS, strict=True)):
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
    labels = (*(f"{axis}, {unit}" for unit in ("m", "m/s") for axis in AXES), *ANGLE_LABELS)
    units, of_filter = np.concatenate((np.ones(6), UNITS)), "±σ of the filter"
    for i, axes in enumerate(_grid(figure, 3)):
        sigma = flight.sigmas[:, i] / units[i]
        axes.fill_between(flight.times_s, -sigma, sigma, color=ORANGE, alpha=0.2, linewidth=0.0, label=of_filter)
        axes.plot(flight.times_s, flight.errors[:, i] / units[i], color=BLUE, label="error")
        axes.set_ylabel(labels[i])
        if i >= 6:
            axes.set_xlabel("time, s")
    _legend(figure)
    return figure


def _track(done: Experiment) -> Figure:
    """Draw the true and the computed track: plan view, and height over time."""
    figure, flight = _figure(8.0), done.flight
    lat_rad, lon_rad, height_m = flight.position.T
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


def write(directory: Path, done: Experiment) -> None:
    """Write all files, replacing those of an earlier experiment.

    Raises:
        OSError: the directory can't be written.
    """
    figures = directory / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    (directory / "run.yaml").write_text(dump_scenario(done.scenario), encoding="utf-8")
    text = json.dumps(summary(done), indent=2, ensure_ascii=False, allow_nan=False)
    (directory / "summary.json").write_text(text + "\n", encoding="utf-8")
    for name, columns in (("alignment", _alignment(done)), ("flight", _flight(done))):
        pq.write_table(pa.table(dict(columns)), directory / f"{name}.parquet")
    draw(done, figures)


def _alignment(done: Experiment) -> dict[str, Array]:
    aligned = done.alignment
    tables = {"error": aligned.error_rad / UNITS, "sigma": aligned.sigma_rad / UNITS}
    columns = {f"{what}_{name}": table[:, i] for what, table in tables.items() for i, name in enumerate(ANGLES)}
    return {"t_s": aligned.times_s} | columns


def _flight(done: Experiment) -> dict[str, Array]:
    """Return true positions, and errors and standard deviations of position, velocity and attitude."""
    flight, names = done.flight, (*LENGTHS, *ANGLES)
    lat_rad, lon_rad, height_m = flight.position.T
    position = {"true_lat_deg": np.degrees(lat_rad), "true_lon_deg": np.degrees(lon_rad), "true_height_m": height_m}
    units = np.concatenate((np.ones(len(LENGTHS)), UNITS))
    tables = {"error": flight.errors / units, "sigma": flight.sigmas / units}
    columns = {f"{what}_{name}": table[:, i] for what, table in tables.items() for i, name in enumerate(names)}
    return {"t_s": flight.times_s} | position | columns


@click.command(epilog=EXAMPLES)
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--vehicle", metavar="ID", help="Which vehicle.  [default: the first with source: ins]")
@click.option("--seed", type=SEED, help="Seed of the sensors' noise, instead of the scenario's.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key of the scenario.")
@click.option("--out", type=OUT, help="Directory to write to.  [default: runs/NAME-TIME]")
@click.option("--overwrite", is_flag=True, help="Replace an earlier run in --out.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary alone, as JSON.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def sins(
    scenario: Path,
    vehicle: str | None,
    seed: int | None,
    overrides: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Align a vehicle of SCENARIO and navigate along its path by inertia; write figures and summary.json."""
    seeded = overrides if seed is None else (*overrides, f"seed={seed}")
    try:
        loaded = load_scenario(scenario, seeded)
    except ScenarioError as error:
        fail(str(error))
    chosen = _chosen(loaded, vehicle, scenario)
    directory = out or default_directory(loaded.name)
    try:
        refused = refusal(directory, overwrite=overwrite)
        if refused is not None:
            fail(refused)
        directory.mkdir(parents=True, exist_ok=True)
        done = experiment(loaded, chosen)
        write(directory, done)
    except OSError as error:
        fail(f"cannot write the directory {directory}: {error.strerror}; allowed: a directory that can be written")
    except DivergedError as error:
        fail(str(error), Status.COULD_NOT_GO_ON)
    _warn(done)
    figures = summary(done)
    if as_json:
        click.echo(json.dumps(figures, indent=2, ensure_ascii=False))
    elif not quiet:
        click.echo(_in_words(figures, directory))


def _chosen(scenario: Scenario, wanted: str | None, file: Path) -> Vehicle:
    able = {str(each.vehicle_id): each for each in inertial_vehicles(scenario)}
    if not able:
        fail(f"{file}: vehicles: found none with navigation: {{source: ins}}; allowed: one or more")
    name = next(iter(able)) if wanted is None else wanted
    if name not in able:
        fail(f"--vehicle: found '{wanted}'; allowed: those with navigation: {{source: ins}}: {', '.join(able)}")
    return able[name]


def _warn(done: Experiment) -> None:
    if done.limit_rad[2] > SHARPEST_LIMIT_RAD:
        off_deg = min(180.0, math.degrees(done.limit_rad[2]))
        text = f"warning: gyroscopes of this bias don't find the heading: the alignment's may be {off_deg:.0f}° off"
        click.echo(text, err=True)


def _in_words(figures: dict[str, Any], directory: Path) -> str:
    alignment, flight = figures["alignment"], figures["flight"]
    rows = [f'alignment, {alignment["duration_s"]:g} s      east, "   north, "   heading, \'']
    rows += [
        f"  {label:<20}{row['east_arcsec']:>11.2f}{row['north_arcsec']:>11.2f}{row['heading_arcmin']:>13.2f}"
        for label, row in (
            ("coarse error", alignment["coarse_error"]),
            ("error", alignment["error"]),
            ("σ of the filter", alignment["sigma"]),
            ("least possible σ", alignment["limit"]),
        )
    ]
    aided = {"none": "by inertia alone", "baro": "height by barometer", "gnss": "with GNSS"}[figures["aiding"]]
    rows += [f"flight, {flight['duration_s']:g} s, {aided}      max, m   at the end, m"]
    rows += [f"  {axis:<20}{row['max']:>11.2f}{row['final']:>16.2f}" for axis, row in flight["error_m"].items()]
    return "\n".join([*rows, f"figures and summary.json: {directory}"])
