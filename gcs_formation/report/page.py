"""report.html: one file that needs nothing but itself."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path

from formation_scenario import dump_scenario
from gcs_formation.report import tables
from gcs_formation.report.document import asset, document, figure
from gcs_formation.report.embedded import as_script, embedded
from gcs_formation.report.figures import Plate
from gcs_formation.report.paper import after_gusts, beside_the_paper
from gcs_formation.report.run_data import RunData

GROUND = " The browner the ground, the higher."
SCRIPTS = ("surface.js", "errors.js", "plan.js", "space.js", "report.js")


def page(run: RunData, plates: Iterable[tuple[Plate, Path]]) -> str:
    """Return the page of a run; `plates` are its figures and their files."""
    summary, compared = run.summary, beside_the_paper(run) + after_gusts(run)
    gallery = "".join(figure(plate.name, plate.title, plate.caption, path) for plate, path in plates)
    return document(
        str(summary["name"]),
        asset("report.html"),
        subtitle=escape(_subtitle(run)),
        script="\n".join(asset(name) for name in SCRIPTS),
        data=as_script(embedded(run)),
        verdict=tables.verdict(summary),
        missing=tables.missing(run.missing),
        cards=tables.cards(run),
        error_source=escape(_error_source(run)),
        followers=tables.followers(summary),
        expectations=tables.expectations(summary),
        paper_link='<a href="#paper">Beside the paper</a>' if compared else "",
        paper=compared and f'<section id="paper">\n<h2>Beside the paper</h2>\n{compared}\n</section>',
        ground=GROUND if run.scenario.terrain is not None else "",
        figures=f'<div class="gallery">{gallery}</div>',
        links=tables.links(summary),
        control=tables.control(summary),
        events=tables.events(run),
        scenario=escape(dump_scenario(run.scenario)),
    )


def _subtitle(run: RunData) -> str:
    scenario, count = run.scenario, len(run.scenario.followers)
    leader = "a leader" if run.leader else "a virtual leader"
    followers = f"{count} follower{'s' * (count != 1)}" if count else "no followers"
    law = {"fuzzy_pid": "fuzzy PID", "pid": "PID", "consensus": "consensus"}[scenario.law.type]
    prediction = "with" if scenario.law.delay_compensation else "without"
    parts = (
        f"{leader} and {followers}",
        f"{scenario.formation.shape} of {scenario.formation.spacing_m:g} m",
        f"{law} at {scenario.law.rate_hz:g} Hz, {prediction} delay compensation",
        f"seed {run.summary['seed']}",
    )
    return "; ".join(parts)


def _error_source(run: RunData) -> str:
    source = "ground truth" if run.flown.truth else "telemetry, as the law saw it"
    frame = {"leader_heading": "leader's", "follower_heading": "follower's"}[run.scenario.formation.frame]
    return (
        f"Metres, absolute values, from {source}; x forward and y right of the {frame} heading, z up. "
        "Settled: the first time from which every axis stays within 0.5 m for 10 s; steady max: the maximum from "
        "30 s after it on; left: when a settled vehicle was beyond 0.5 m first. "
        "Steps: of the setpoints from tick to tick."
    )
