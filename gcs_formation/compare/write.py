"""comparison.json, comparison.png and comparison.html of flown laws."""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from pathlib import Path

from gcs_formation.compare.comparison import Comparison
from gcs_formation.compare.figure import comparison_figure, spans
from gcs_formation.compare.laws import LAWS
from gcs_formation.compare.table import comparison_table
from gcs_formation.errors import RecordError
from gcs_formation.report.document import document, figure
from gcs_formation.report.style import print_style, save
from gcs_formation.report.tables import table

NAME = "comparison"
TITLE = "Largest error of any follower over time"
CAPTION = (
    "Drawn is the largest within a second before and after, so that errors that pass through zero are no dips; "
    "what is below 1 mm is drawn there."
)
TWO_SPANS = "Left: how each law settles; right: the window of the table. "


def write_comparison(comparison: Comparison, out: Path) -> Path:
    """Write a comparison's three files into a directory; return the page's path.

    Raises:
        RecordError: the directory can't be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / f"{NAME}.json").write_text(json.dumps(comparison.to_dict(), indent=2), encoding="utf-8")
        picture, target = out / f"{NAME}.png", out / f"{NAME}.html"
        with print_style():
            save(comparison_figure(comparison), picture)
        target.write_text(_page(comparison, picture), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the comparison into {out}: {error.strerror}") from error
    return target


def _page(comparison: Comparison, picture: Path) -> str:
    body = files("gcs_formation.compare") / "comparison.html"
    caption = TWO_SPANS + CAPTION if len(spans(comparison.window)) > 1 else CAPTION
    return document(
        f"{comparison.name}: laws side by side",
        body.read_text(encoding="utf-8"),
        seed=str(comparison.seed),
        frame=escape(comparison.frame.replace("_heading", "")),
        from_s=f"{comparison.window.from_s:g}",
        to_s=f"{comparison.window.to_s:g}",
        table=comparison_table(comparison),
        figure=figure(NAME, TITLE, caption, picture),
        laws=table(
            ["Law", "What it sets in the scenario"],
            [[row.law, ", ".join(LAWS[row.law])] for row in comparison.rows],
            (0, 1),
        ),
    )
