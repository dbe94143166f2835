"""Writes report.html, one self-contained file, and the figures beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Indices
from formation_scenario import dump_scenario
from formation_scenario.extensions import Files, Registry
from gcs_formation.control.laws import law_kind
from gcs_formation.errors import RecordError
from gcs_formation.record.run_directory import FIGURES, REPORT
from gcs_formation.record.timeseries import GROUND
from gcs_formation.report import RunData, load_run, page_parts
from gcs_formation.report.error_figures import (
    assembled_first,
    assembly,
    disturbance,
    disturbed,
    errors,
    has_followers,
    transient_end_s,
)
from gcs_formation.report.gusts import gusts
from gcs_formation.report.loop_figures import gains, has_gains, latency, separation, setpoints, steps
from gcs_formation.report.page_parts import asset, document, figure
from gcs_formation.report.plan_figures import plan, trajectory
from gcs_formation.report.style import FOLLOWERS, evenly, extremes, marks, path_m, print_style, reach, save
from gcs_formation.report.time_axes import Group, everyone

ERROR_POINTS = 80_000
TRACK_NUMBERS = 100_000
"""Limits for all series together, which keep the data of a page of 100 vehicles below 2 MB."""
FEWEST_BUCKETS, MOST_BUCKETS = 50, 1500
MOST_TRACK_POINTS = 1500
PATH_POINTS = 400
GROUND_CELLS = 120
"""Number of cells along the longer side of the ground that is shown."""
GROUND_AROUND_M = 1000.0
ERROR_DIGITS, PLACE_DIGITS, ANGLE_DIGITS, TIME_DIGITS = 4, 1, 3, 2
GROUND_CAPTION = " The browner the ground, the higher."
SCRIPTS = ("surface.js", "errors.js", "plan.js", "space.js", "report.js")


def always(_: RunData) -> bool:
    """Condition of a figure that every run has."""
    return True


PLATES: dict[Callable[[RunData], Figure], Callable[[RunData], bool]] = {
    disturbance: disturbed,
    errors: has_followers,
    trajectory: always,
    plan: always,
    assembly: assembled_first,
    setpoints: always,
    steps: has_followers,
    gains: has_gains,
    separation: always,
    latency: always,
}
"""What draws each figure, and the condition on which a run has anything to show in it."""


def embedded(run: RunData) -> dict[str, Any]:
    """Return the data of the page's plots for JSON; times are mission times in s, unknown values None."""
    group, everybody = everyone(run), list(everyone(run).vehicles)
    return {
        "begun": run.begun,
        "flown_s": _rounded(run.time_s[[0, -1]], TIME_DIGITS),
        "steady_s": transient_end_s(run),
        "vehicles": [_vehicle(run, vehicle) for vehicle in everybody],
        "worst": [everybody.index(vehicle) for vehicle in run.worst_first()],
        "errors": _errors(run, group),
        "tracks": _tracks(run, group),
        "path": _path(run),
        "ground": _ground(run),
        "bounds": [
            {
                "axis": error.axis,
                "from": round(error.at_s, TIME_DIGITS),
                "to": round(error.to_s, TIME_DIGITS),
                "allowed": round(error.allowed_m, ERROR_DIGITS),
                "least": round(error.least_m, ERROR_DIGITS),
            }
            for error in gusts(run)
        ],
        "marks": [{"t": round(mark.time_s, TIME_DIGITS), "label": mark.label} for mark in marks(run)],
    }


def as_script(data: dict[str, Any]) -> str:
    """Return JSON in which nothing can end the script element around it."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _vehicle(run: RunData, vehicle: VehicleId) -> dict[str, Any]:
    leads = vehicle == run.leader
    colour = None if leads else FOLLOWERS[run.followers.index(vehicle) % len(FOLLOWERS)]
    return {"name": str(vehicle), "role": "leader" if leads else "follower", "colour": colour}


def _errors(run: RunData, group: Group) -> list[dict[str, Any]]:
    """Return each follower's errors, reduced to extremes and their times."""
    buckets = int(np.clip(ERROR_POINTS // (6 * max(len(run.followers), 1)), FEWEST_BUCKETS, MOST_BUCKETS))
    found: list[dict[str, Any]] = []
    for index, vehicle in enumerate(group.vehicles):
        if vehicle in run.followers:
            found.append({"vehicle": index})
            for axis, values in zip("xyz", run.whole.error(vehicle).T, strict=True):
                kept = extremes(values, buckets)
                times = _rounded(run.whole_time_s[kept], TIME_DIGITS)
                found[-1][axis] = {"t": times, "v": _rounded(values[kept], ERROR_DIGITS)}
    return found


def _tracks(run: RunData, group: Group) -> dict[str, Any]:
    points = min(MOST_TRACK_POINTS, TRACK_NUMBERS // (5 * len(group.vehicles)))
    kept = evenly(run.whole_time_s.size, points)
    return {
        "t": _rounded(run.whole_time_s[kept], TIME_DIGITS),
        "vehicles": [_track(run, vehicle, kept) for vehicle in group.vehicles],
    }


def _track(run: RunData, vehicle: VehicleId, kept: Indices) -> dict[str, Any]:
    below = run.whole.vehicles[vehicle][GROUND[0]][kept]
    named = zip(("north", "east", "height", "below"), (*run.whole.place(vehicle)[kept].T, below), strict=True)
    heading = run.whole.heading(vehicle)[kept]
    known = np.isfinite(heading)
    heading[known] = np.unwrap(heading[known])
    track = {name: _rounded(values, PLACE_DIGITS) for name, values in named}
    return {**track, "heading": _rounded(heading, ANGLE_DIGITS)}


def _path(run: RunData) -> dict[str, Any]:
    path = path_m(run)
    north, east, _ = path[evenly(len(path), PATH_POINTS)].T
    return {"north": _rounded(north, PLACE_DIGITS), "east": _rounded(east, PLACE_DIGITS)}


def _ground(run: RunData) -> dict[str, Any] | None:
    """Return the terrain's heights on a grid around the tracks, rows from south to north; None without terrain."""
    if run.scenario.terrain is None:
        return None
    low, high = reach(np.concatenate([run.flown.place(vehicle)[:, :2] for vehicle in run.flown.vehicles]))
    low, high = low - GROUND_AROUND_M, high + GROUND_AROUND_M
    cell_m = float((high - low).max()) / GROUND_CELLS
    north, east = (np.arange(least, most, cell_m) for least, most in zip(low, high, strict=True))
    height = run.scenario.ground.height(*np.meshgrid(north, east, indexing="ij"))
    return {
        "south": round(float(low[0]), PLACE_DIGITS),
        "west": round(float(low[1]), PLACE_DIGITS),
        "cell": round(cell_m, 3),
        "columns": int(east.size),
        "height": _rounded(height.ravel(), 0),
    }


def _rounded(values: Array, digits: int) -> list[float | None]:
    # Adding 0 turns -0.0 into 0.0, which is shorter and looks better.
    return [value if np.isfinite(value) else None for value in (np.round(values, digits) + 0.0).tolist()]


def write_figures(run: RunData, directory: Path) -> Iterator[Path]:
    """Draw every figure that the run has something to show in, one file each, into a directory; yield the files."""
    directory.mkdir(exist_ok=True)
    for draw, has_something in PLATES.items():
        path = directory / f"{draw.__name__}.png"
        if not has_something(run):
            path.unlink(missing_ok=True)
            continue
        with print_style():
            save(draw(run), path)
        yield path


def page(run: RunData, figures: Iterable[Path]) -> str:
    """Return the page of a run; `figures` are its pictures' files."""
    summary, compared = run.summary, page_parts.beside_the_paper(run) + page_parts.after_gusts(run)
    gallery = "".join(figure(path.stem, path) for path in figures)
    return document(
        str(summary["name"]),
        "report.html",
        subtitle=escape(_subtitle(run)),
        script="\n".join(asset(name) for name in SCRIPTS),
        data=as_script(embedded(run)),
        verdict=page_parts.verdict(summary),
        missing=page_parts.missing(run.missing),
        cards=page_parts.cards(run),
        error_source=escape(_error_source(run)),
        followers=page_parts.followers(summary) + page_parts.from_path(summary),
        expectations=page_parts.expectations(summary),
        paper_link='<a href="#paper">Beside the paper</a>' if compared else "",
        paper=compared and f'<section id="paper">\n<h2>Beside the paper</h2>\n{compared}\n</section>',
        ground=GROUND_CAPTION if run.scenario.terrain is not None else "",
        figures=f'<div class="gallery">{gallery}</div>',
        links=page_parts.links(summary),
        control=page_parts.control(summary),
        events=page_parts.events(run),
        scenario=escape(dump_scenario(run.scenario)),
    )


def _subtitle(run: RunData) -> str:
    scenario, count = run.scenario, len(run.scenario.followers)
    leader = "a leader" if run.leader else "a virtual leader"
    followers = f"{count} follower{'s' * (count != 1)}" if count else "no followers"
    law = law_kind(scenario).name
    prediction = "with" if scenario.law.delay_compensation else "without"
    return (
        f"{leader} and {followers}; {scenario.formation.shape} of {scenario.formation.spacing_m:g} m; "
        f"{law} at {scenario.law.rate_hz:g} Hz, {prediction} delay compensation; seed {run.summary['seed']}"
        + (f"; gcs-formation {run.summary['version']}" if run.summary.get("version") else "")
    )


def _error_source(run: RunData) -> str:
    source = "ground truth" if run.flown.truth else "telemetry, as the law saw it"
    frame = {
        "leader_heading": "x forward and y right of the leader's heading",
        "follower_heading": "x forward and y right of the follower's heading",
        "north": "x north and y east",
    }[run.scenario.formation.frame]
    return (
        f"Metres, absolute values, from {source}; {frame}, z up. "
        "Settled: the first time from which every axis stays within 0.5 m for 10 s; steady max: the maximum from "
        "30 s after it on; left: when a settled vehicle was beyond 0.5 m first; "
        "followed: the share of the time that these are of; else it led or was lost. "
        "Steps: of the setpoints from tick to tick."
    )


def write_report(run_dir: Path, lacks: Callable[[str], None] = lambda _: None, plugins: Files | Registry = ()) -> Path:
    """Write figures/*.png and report.html of a run into its directory; return the page's path.

    `lacks` is called for each thing that the record lacks, in words; `plugins` are files of extensions that the run's
    scenario names, or what they register.

    Raises:
        RecordError: the directory isn't that of a run, nothing was flown, or it can't be read or written.
    """
    run = load_run(run_dir, plugins)
    for text in run.missing:
        lacks(text)
    target = run_dir / REPORT
    try:
        figures = list(write_figures(run, run_dir / FIGURES))
        target.write_text(page(run, figures), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {run_dir}: {error.strerror}") from error
    return target
