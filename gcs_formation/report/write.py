"""Writes the figures and the page of a finished run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gcs_formation.errors import RecordError
from gcs_formation.record.run_directory import FIGURES, REPORT
from gcs_formation.report.figures import write_figures
from gcs_formation.report.page import page
from gcs_formation.report.run_data import load_run


def _unsaid(text: str) -> None:
    """Leave it to the page, which says it as well."""


def write_report(run_dir: Path, lacks: Callable[[str], None] = _unsaid) -> Path:
    """Write figures/*.png and report.html of a run into its directory; return the page's path.

    `lacks` is called with each thing that the record of an unfinished run lacks, in words.

    Raises:
        RecordError: the directory isn't that of a run, nothing was flown, or it can't be read or written.
    """
    run = load_run(run_dir)
    for text in run.missing:
        lacks(text)
    target = run_dir / REPORT
    try:
        plates = list(write_figures(run, run_dir / FIGURES))
        target.write_text(page(run, plates), encoding="utf-8")
    except OSError as error:
        raise RecordError(f"cannot write the report into {run_dir}: {error.strerror}") from error
    return target
