"""The page of a study: verdicts, figures, the worst flights and how to repeat them."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from html import escape
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from airlink.cli import counted
from formation_scenario.bounded_read import require_file
from formation_scenario.expectation import bounds_text
from gcs_formation.errors import RecordError
from gcs_formation.record.json_shape import (
    INTEGER,
    NUMBER,
    NUMBER_OR_NULL,
    OBJECT,
    TEXT,
    TRUTH_OR_NULL,
    Each,
    Kind,
    Maybe,
    Shape,
    mismatch,
)
from gcs_formation.record.run_directory import FIGURES, REPORT
from gcs_formation.report import page_parts
from gcs_formation.report.page_parts import badge, brief, table
from gcs_formation.report.style import print_style, save
from gcs_formation.studies import Study
from gcs_formation.studies.curves import by_level, distributions, exceedances, has_tail, split_by
from gcs_formation.studies.dataset import RESULT, read_rows, read_study
from gcs_formation.studies.ended_flights import Flights, flights_of
from gcs_formation.studies.figures import heat_maps, marginals, pairs, searched
from gcs_formation.studies.flight import LOWER_IS_WORSE

WORST = 3
MAX_FAILED = 50
Rows = list[dict[str, Any]]
RESULT_SHAPE: Shape = {
    "expect": Each(
        {
            **{"metric": TEXT, "where": OBJECT, "interval": Kind("an array or null", (list, NoneType))},
            **{"kept": INTEGER, "flights": INTEGER, "share": NUMBER, "held": TRUTH_OR_NULL},
            **{"confidence": NUMBER, "interval_of": Maybe({"by": TEXT, "clusters": INTEGER})},
        }
    ),
    "bisect": Maybe(Each({"seed": INTEGER, "kept": NUMBER_OR_NULL, "broken": NUMBER_OR_NULL})),
}
"""What a report reads from study.json."""


def write_study_report(directory: Path) -> Path:
    """Write figures/*.png and report.html of a study, finished or not, into its directory; return the page's path.

    Raises:
        RecordError: nothing was flown yet, or it can't be read or written.
    """
    study = read_study(directory)
    rows = sorted(read_rows(directory, study), key=lambda row: row["flight"])
    if not rows:
        raise RecordError(f"found no flight in {directory}; expected: a study of which something was flown")
    flights, result = flights_of(study, rows), _result(directory)
    target = directory / REPORT
    try:
        (directory / FIGURES).mkdir(exist_ok=True)
        gallery = "".join(_gallery(_plates(flights, result, rows), directory / FIGURES))
        page = _page(study, rows, result, gallery, directory, flights.chance.words)
        target.write_text(page, encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {directory}: {error.strerror or error}") from error
    return target


Plate = tuple[str, str, Callable[[], Figure]]
"""A figure's name, its title, and the function that draws it."""


def _gallery(plates: Iterator[Plate], directory: Path) -> Iterator[str]:
    for name, title, draw in plates:
        path = directory / f"{name}.png"
        with print_style():
            save(draw(), path)
        yield page_parts.figure(name, path, title)


def _plates(flights: Flights, result: Mapping[str, Any], rows: Rows) -> Iterator[Plate]:
    search = flights.study.bisect
    if search is not None:
        if result.get("bisect"):
            title = f"{search.parameter} at which {search.metric} breaks its bound"
            yield "searched", title, partial(searched, flights, search, result["bisect"], rows)
        return
    if flights.metrics:
        yield "distributions", "Distributions", partial(distributions, flights)
    known = {name: values[np.isfinite(values)] for name, values in flights.metrics.items()}
    if any(map(has_tail, known.values())):
        yield "exceedances", "Exceedance", partial(exceedances, flights)
    for metric in (name for name, values in known.items() if np.unique(values).size > 1 and flights.parameters):
        yield from _over_parameters(flights, metric)


def _over_parameters(flights: Flights, metric: str) -> Iterator[Plate]:
    if split_by(flights) and has_tail(flights.metrics[metric]):
        yield f"levels-{metric}", f"{metric} by parameters' values", partial(by_level, flights, metric)
    yield f"marginals-{metric}", metric, partial(marginals, flights, metric)
    if pairs(flights, metric):
        yield f"maps-{metric}", f"{metric} over two parameters", partial(heat_maps, flights, metric)


def _page(study: Study, rows: Rows, result: Mapping[str, Any], gallery: str, directory: Path, words: str) -> str:
    failed = [row for row in rows if row["exit"] > 1]
    heads = ["Flight", "Exit", "In words"]
    failures = table(heads, [[str(r["flight"]), str(r["exit"]), r["words"]] for r in failed[:MAX_FAILED]], (2,))
    flown = counted(len(rows), "flight")
    return page_parts.document(
        study.name,
        "study.html",
        subtitle=escape(f"{flown}; design: {study.design}; seeds {study.seeds.first} and on; {rows[0]['version']}"),
        expectations=_expectations(result) + f'<p class="note">Intervals are {escape(words)}.</p>',
        crossings=_crossings(study, result),
        figures=gallery,
        worst=_worst(study, rows, directory),
        failed=f"<section>\n<h2>Couldn't be flown</h2>\n{failures}\n</section>" if failed else "",
    )


def _result(directory: Path) -> Mapping[str, Any]:
    """Return study.json; empty if the study hasn't ended.

    Raises:
        RecordError: it doesn't have the form that a study writes.
    """
    try:
        require_file(directory / RESULT)
        result: Any = json.loads((directory / RESULT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    text = mismatch(result, RESULT_SHAPE, str(directory / RESULT))
    if text is not None:
        raise RecordError(text)
    return result


def _expectations(result: Mapping[str, Any]) -> str:
    rows = [
        [
            entry["metric"],
            bounds_text(entry.get("below"), entry.get("above")),
            ", ".join(f"{name} = {value}" for name, value in entry["where"].items()),
            f"{entry['kept']} of {entry['flights']}",
            _interval(entry),
            f"{100 * entry['share']:g} %",
            badge(entry["held"], "held" if entry["held"] else "broken"),
        ]
        for entry in result.get("expect", [])
    ]
    heads = ["Figure", "Bound", "Of flights with", "Kept", "Confidence interval", "Expected", ""]
    return table(heads, rows, (0, 1, 2, 6)) if rows else '<p class="note">None, or the study has not ended.</p>'


def _interval(entry: Mapping[str, Any]) -> str:
    """Return an expectation's interval in words, with the number of clusters that it is from."""
    if entry["interval"] is None:
        return "none: the share is exact"
    ends, of = " to ".join(f"{100 * end:.2f} %" for end in entry["interval"]), entry.get("interval_of")
    by = f", by {counted(of['clusters'], of['by'])}" if of else ""  # older versions took flights to be independent
    return f"{ends} ({100 * entry['confidence']:g} %{by})"


def _crossings(study: Study, result: Mapping[str, Any]) -> str:
    search = study.bisect
    if search is None or "bisect" not in result:
        return ""
    names = [name for name in study.parameters if name != search.parameter]
    rows = [
        [*(str(entry.get(name)) for name in ("seed", *names)), brief(entry["kept"]), brief(entry["broken"])]
        for entry in result["bisect"]
    ]
    heads = ["Seed", *names, "kept up to", "broken from"]
    bounds = bounds_text(search.below, search.above)
    title = escape(f"{search.parameter} at which {search.metric} is no longer {bounds}")
    return f"<section>\n<h2>{title}</h2>\n{table(heads, rows, ())}\n</section>"


def _worst(study: Study, rows: Rows, directory: Path) -> str:
    names, again = study.columns, f"gcs-formation study fly {shlex.quote(str(directory))}"
    found, cells = list[list[str]](), ("flight", "seed", *names)
    ended = [row for row in rows if row["exit"] <= 1]
    for metric in study.measured:
        ordered = sorted(ended, key=lambda row: _badness(metric, row[metric]), reverse=True)
        if not ordered or ordered[0][metric] == ordered[-1][metric]:
            continue
        found += [
            [metric, brief(row[metric]), *(str(row.get(name)) for name in cells), f"{again} {row['flight']}"]
            for row in ordered[:WORST]
        ]
    return table(["Figure", "Value", "Flight", "Seed", *names, "Again"], found, (0, 4 + len(names)))


def _badness(metric: str, value: float | None) -> float:
    """Return a sort key of how bad a figure is; a missing one, such as of a flight that never settled, is worst."""
    if value is None:
        return math.inf
    return -value if metric in LOWER_IS_WORSE else value
