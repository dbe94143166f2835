"""Axes over mission time, and the labelled lines where something happened."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes

from gcs_formation.report.marks import Mark
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import DPI, GREY, THIN

CHARACTER_PT = 5.0
"""Mean width of a character of the labels."""
LEVEL_PT = 10.0
MOST_LEVELS = 5


def time_label(run: RunData) -> str:
    """Return what the time axis counts."""
    return "mission time, s" if run.begun else "time, s"


def span(axes: Axes, begin_s: float, end_s: float) -> None:
    """Show a span of time, also one of a single tick; from 0 on if it begins right after."""
    begin_s = 0.0 if 0.0 < begin_s < 0.01 * end_s else begin_s
    axes.set_xlim(begin_s, end_s if end_s > begin_s else begin_s + 1.0)


def at_least(axes: Axes, low: float, high: float) -> None:
    """Show values from `low` to `high` and whatever else is drawn; call when everything is."""
    shown = axes.get_ylim()
    axes.set_ylim(min(shown[0], low), max(shown[1], high))


def draw_marks(rows: Sequence[Axes], marks: Sequence[Mark], *, labels: bool = True) -> None:
    """Draw a line at each mark through axes above each other, named over the topmost; call after setting limits."""
    begin, end = rows[0].get_xlim()
    inside = [mark for mark in marks if begin <= mark.time_s <= end]
    for axes in rows:
        for mark in inside:
            axes.axvline(mark.time_s, color=GREY, lw=THIN, ls=(0, (4, 2)), zorder=1.5)
    if labels:
        _label(rows[0], inside, begin, end)


def _label(axes: Axes, marks: Sequence[Mark], begin: float, end: float) -> None:
    width_pt = axes.bbox.width * 72 / DPI
    free_from = [float("-inf")] * MOST_LEVELS
    for mark in marks:
        at_pt = (mark.time_s - begin) / (end - begin) * width_pt
        wide_pt = CHARACTER_PT * (len(mark.label) + 1)
        left_pt = min(at_pt, max(0.0, width_pt - wide_pt))
        level = next((i for i, free in enumerate(free_from) if left_pt >= free), None)
        if level is None:
            continue
        free_from[level] = left_pt + wide_pt
        axes.annotate(
            mark.label,
            (mark.time_s, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(left_pt - at_pt, 3.0 + level * LEVEL_PT),
            textcoords="offset points",
            color="#404040",
        )
