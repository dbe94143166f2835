"""Writes report.html, one self-contained file, and the figures beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from formation_scenario import dump_scenario
from formation_scenario.feature_folders import brought
from formation_scenario.registry import Files, Registry
from gcs_formation.control.laws import law_kind
from gcs_formation.errors import RecordError
from gcs_formation.record.run_directory import FIGURES, REPORT
from gcs_formation.record.timeseries import PHASES
from gcs_formation.report import RunData, load_run, page_parts
from gcs_formation.report.error_figures import (
    assembled_first,
    assembly,
    disturbance,
    disturbed,
    errors,
    has_followers,
)
from gcs_formation.report.gusts import gusts
from gcs_formation.report.loop_figures import gains, has_gains, latency, separation, setpoints, steps
from gcs_formation.report.page_parts import document, figure
from gcs_formation.report.plan_figures import plan, trajectory
from gcs_formation.report.style import FORMATS, print_style, save
from gcs_formation.view import flight_in_a_file
from gcs_formation.view.flight_in_a_file import WholeFlight
from gcs_formation.view.flight_in_a_file import embedded as of_flight
from gcs_formation.view.recording import Times
from gcs_formation.view.scene import scene
from gcs_formation.view.tick_rows import as_rows


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
for _module in brought("plate"):
    PLATES.update(_module.PLATES)


def embedded(run: RunData) -> dict[str, Any]:
    """Return what the page that shows the flight reads, for JSON."""
    names, order = run.whole.common.keys(), list(run.whole.vehicles)
    columns = {name: np.stack([run.whole.vehicles[each][name] for each in order], axis=1) for name in names}
    times = Times(run.whole.common["t_s"], run.whole.mission_time_s, run.whole.common["phase"])
    rows = as_rows(columns, run.scenario.formation.frame)
    bounds = [{"axis": each.axis, "from": each.at_s, "to": each.to_s, "allowed": each.allowed_m} for each in gusts(run)]
    still = scene(run.scenario) | {"bounds": bounds}
    return of_flight(WholeFlight([str(each) for each in order], times, rows, run.events, PHASES, still))


def as_script(data: dict[str, Any]) -> str:
    """Return JSON in which nothing can end the script element around it."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def write_figures(run: RunData, directory: Path, formats: Sequence[str] = ()) -> Iterator[Path]:
    """Draw every figure that the run has something to show in, into a directory; yield the PNG files.

    `formats`: further ones beside them.
    """
    directory.mkdir(exist_ok=True)
    for draw, has_something in PLATES.items():
        path = directory / f"{draw.__name__}.png"
        if not has_something(run):
            for stale in FORMATS:
                path.with_suffix(f".{stale}").unlink(missing_ok=True)
            continue
        with print_style():
            drawn = draw(run)
            save(drawn, path)
            for kind in formats:
                save(drawn, path.with_suffix(f".{kind}"), kind)
        yield path


def page(run: RunData, figures: Iterable[Path]) -> str:
    """Return the page of a run; `figures` are its pictures' files."""
    summary, compared = run.summary, page_parts.compared_with_paper(run) + page_parts.after_gusts(run)
    gallery = "".join(figure(path.stem, path) for path in figures)
    return document(
        str(summary["name"]),
        "report.html",
        subtitle=escape(_subtitle(run)),
        script=flight_in_a_file.script(),
        viewer_style=flight_in_a_file.style(),
        data=as_script(embedded(run)),
        verdict=page_parts.verdict(summary),
        missing=page_parts.missing(run.missing),
        cards=page_parts.cards(run),
        error_source=escape(_error_source(run)),
        followers=page_parts.followers(summary) + page_parts.from_path(summary),
        expectations=page_parts.expectations(summary),
        paper_link='<a href="#paper">Beside the paper</a>' if compared else "",
        paper=compared and f'<section id="paper">\n<h2>Beside the paper</h2>\n{compared}\n</section>',
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


def write_report(
    run_dir: Path,
    lacks: Callable[[str], None] = lambda _: None,
    plugins: Files | Registry = (),
    formats: Sequence[str] = (),
) -> Path:
    """Write figures/*.png and report.html of a run into its directory; return the page's path.

    `lacks` is called for each thing that the record lacks, in words; `plugins` are files of extensions that the run's
    scenario names, or what they register; `formats` of `style.FORMATS` are written beside PNG.

    Raises:
        RecordError: the directory isn't that of a run, nothing was flown, or it can't be read or written.
    """
    run = load_run(run_dir, plugins)
    for text in run.missing:
        lacks(text)
    target = run_dir / REPORT
    try:
        figures = list(write_figures(run, run_dir / FIGURES, formats))
        target.write_text(page(run, figures), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {run_dir}: {error.strerror}") from error
    return target
