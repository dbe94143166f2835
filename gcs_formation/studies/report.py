"""The page of a study: verdicts, figures, worst flights and how to fly them again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gcs_formation.errors import RecordError
from gcs_formation.report import document
from gcs_formation.report.style import print_style, save
from gcs_formation.report.tables import badge, number, table
from gcs_formation.studies.dataset import RESULT, STUDY, read_journal, read_plan
from gcs_formation.studies.figures import Flights, distributions, heat_map, marginals, pairs
from gcs_formation.studies.flight import LEAST_IS_WORST
from gcs_formation.studies.keys import Study
from gcs_formation.studies.plan import columns_of

REPORT, FIGURES = "report.html", "figures"
WORST = 3
MOST_FAILED = 50
CAPTIONS = {
    "distributions": "Cumulative distributions; flights without the figure count as beyond its end.",
    "marginals": "Over each parameter, whatever the others are.",
    "map": "Median of the flights in each cell. Beyond the line, drawn where `margin_used` is a metric and both "
    "sides of it were flown, delays are longer than the margin computed for the loops.",
}
Rows = list[dict[str, Any]]


def is_study(directory: Path) -> bool:
    """Whether a directory is that of a study."""
    return (directory / STUDY).is_file()


def write_study_report(directory: Path) -> Path:
    """Write figures/*.png and report.html of a study, finished or not, into its directory; return the page's path.

    Raises:
        RecordError: nothing was flown yet, or it can't be read or written.
    """
    study = Study.model_validate(read_plan(directory)["study"])
    rows = sorted(read_journal(directory), key=lambda row: row["flight"])
    if not rows:
        raise RecordError(f"found no flight in {directory}; expected: a study of which something was flown")
    flights, result = _flights(study, rows), _result(directory)
    target = directory / REPORT
    try:
        (directory / FIGURES).mkdir(exist_ok=True)
        gallery = "".join(_gallery(flights, directory / FIGURES))
        target.write_text(_page(study, rows, result, gallery, directory), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {directory}: {error.strerror or error}") from error
    return target


def _flights(study: Study, rows: Rows) -> Flights:
    ended = [row for row in rows if row["exit"] <= 1]
    names = [name for name in columns_of(study) if all(_is_number(row.get(name)) for row in ended)]
    columns = {name: np.array([float(row[name]) for row in ended]) for name in names}
    varied = {name: values for name, values in columns.items() if np.unique(values).size > 1}
    metrics = {name: np.array([row[name] for row in ended], dtype=np.float64) for name in study.measured}
    return Flights(study, varied, {name: v for name, v in metrics.items() if np.isfinite(v).any()})


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _gallery(flights: Flights, directory: Path) -> Iterator[str]:
    for name, title, draw in _plates(flights):
        path = directory / f"{name}.png"
        with print_style():
            save(draw(), path)
        yield document.figure(name, title, CAPTIONS[name.partition("-")[0]], path)


def _plates(flights: Flights) -> Iterator[tuple[str, str, Callable[[], Figure]]]:
    if flights.metrics:
        yield "distributions", "Distributions", partial(distributions, flights)
    varied = [name for name, values in flights.metrics.items() if np.unique(values[np.isfinite(values)]).size > 1]
    for metric in varied if flights.parameters else ():
        yield f"marginals-{metric}", metric, partial(marginals, flights, metric)
        for across, up in pairs(list(flights.parameters)):
            title = f"{metric} over {across} and {up}"
            yield f"map-{metric}-{up}", title, partial(heat_map, flights, metric, across, up)


def _page(study: Study, rows: Rows, result: Mapping[str, Any], gallery: str, directory: Path) -> str:
    body = (files("gcs_formation.studies") / "study.html").read_text(encoding="utf-8")
    failed = [row for row in rows if row["exit"] > 1]
    heads = ["Flight", "Exit", "In words"]
    failures = table(heads, [[str(r["flight"]), str(r["exit"]), r["words"]] for r in failed[:MOST_FAILED]], (2,))
    return document.document(
        study.name,
        body,
        subtitle=escape(
            f"{len(rows)} flights; design: {study.design}; seeds {study.seeds.first} and on; {rows[0]['version']}"
        ),
        expectations=_expectations(result),
        crossings=_crossings(study, result),
        figures=gallery,
        worst=_worst(study, rows, directory),
        failed=f"<section>\n<h2>Couldn't be flown</h2>\n{failures}\n</section>" if failed else "",
    )


def _result(directory: Path) -> Mapping[str, Any]:
    """Return study.json; empty for a study that hasn't ended."""
    try:
        return json.loads((directory / RESULT).read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError):
        return {}


def _expectations(result: Mapping[str, Any]) -> str:
    rows = [
        [
            entry["metric"],
            " and ".join(f"{name} {entry[name]:g}" for name in ("below", "above") if name in entry),
            ", ".join(f"{name} = {value}" for name, value in entry["where"].items()),
            f"{entry['kept']} of {entry['flights']}",
            " to ".join(f"{100 * end:.2f} %" for end in entry["interval"]),
            f"{100 * entry['share']:g} %",
            badge(entry["held"], "held" if entry["held"] else "broken"),
        ]
        for entry in result.get("expect", [])
    ]
    heads = ["Figure", "Bound", "Of flights with", "Kept", "Confidence interval", "Expected", ""]
    return table(heads, rows, (0, 1, 2, 6)) if rows else '<p class="note">None, or the study has not ended.</p>'


def _crossings(study: Study, result: Mapping[str, Any]) -> str:
    search = study.bisect
    if search is None or "bisect" not in result:
        return ""
    names = [name for name in study.parameters if name != search.parameter]
    rows = [
        [str(entry["seed"]), *(str(entry.get(name)) for name in names), number(entry["kept"]), number(entry["broken"])]
        for entry in result["bisect"]
    ]
    heads = ["Seed", *names, "kept up to", "broken from"]
    bound = " and ".join(f"{n} {v:g}" for n, v in (("below", search.below), ("above", search.above)) if v is not None)
    title = escape(f"{search.parameter} at which {search.metric} is no longer {bound}")
    return f"<section>\n<h2>{title}</h2>\n{table(heads, rows, ())}\n</section>"


def _worst(study: Study, rows: Rows, directory: Path) -> str:
    names = columns_of(study)
    found: list[list[str]] = []
    for metric in study.measured:
        known = [row for row in rows if row[metric] is not None]
        ordered = sorted(known, key=lambda row: row[metric], reverse=metric not in LEAST_IS_WORST)
        found += [
            [metric, number(row[metric]), str(row["flight"]), str(row["seed"]), *(f"{row.get(name)}" for name in names),
             f"gcs-formation study fly {directory} {row['flight']}"]
            for row in ordered[:WORST]
        ]  # fmt: skip
    return table(["Figure", "Value", "Flight", "Seed", *names, "Again"], found, (0, 4 + len(names)))
