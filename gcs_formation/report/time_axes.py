"""Axes over mission time, and the labelled lines where something happened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from matplotlib.axes import Axes

from gcs_formation.report.marks import Mark
from gcs_formation.report.run_data import RunData
from gcs_formation.report.style import CHARACTER_PT, DPI, GREY, THIN

LEVEL_PT = 10.0
MOST_LEVELS = 5
BETWEEN_PT = 25.0
"""Between axes beside each other: what a name may take of it."""
BESIDE_PT = 1.0
"""From a line to its name."""
DARK = "#404040"
UP = {"arrowstyle": "-", "shrinkA": 0, "shrinkB": 0, "color": GREY, "lw": THIN}
BEHIND = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}


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


def draw_marks(columns: Sequence[Sequence[Axes]], marks: Sequence[Mark], *, labels: bool = True) -> None:
    """Draw a line at each mark through axes above each other, named over the topmost; call after setting limits.

    The figure grows by the room that names above each other take.
    """
    levels = 0
    for number, rows in enumerate(columns, 1):
        begin, end = rows[0].get_xlim()
        inside = [mark for mark in marks if begin <= mark.time_s <= end]
        for axes in rows:
            for mark in inside:
                axes.axvline(mark.time_s, color=GREY, lw=THIN, ls=(0, (4, 2)), zorder=1.5)
        if labels:
            levels = max(levels, _label(rows[0], inside, BETWEEN_PT if number < len(columns) else 0.0))
    figure = columns[0][0].get_figure(root=True)
    if figure is not None and levels > 1:
        figure.set_figheight(figure.get_figheight() + (levels - 1) * LEVEL_PT / 72)


def _label(axes: Axes, marks: Sequence[Mark], beyond_pt: float) -> int:
    """Name marks above axes, beyond whose right end there is some room; return on how many levels.

    From the last to the first, so that the lines up to later names don't run through earlier ones.
    """
    taken: list[list[tuple[float, float]]] = [[] for _ in range(MOST_LEVELS)]
    across = axes.get_xaxis_transform()
    for mark in reversed(marks):
        name = _place(axes, mark, beyond_pt)
        free = (i for i, row in enumerate(taken) if all(name.end_pt <= b or e <= name.begin_pt for b, e in row))
        level = next(free, None)
        if level is None:
            continue
        taken[level].append((name.begin_pt, name.end_pt))
        at, up_pt = (mark.time_s, 1.0), 3.0 + level * LEVEL_PT
        axes.annotate("", at, (0.0, up_pt), across, "offset points", UP)
        axes.annotate(
            mark.label, at, (name.shift_pt, up_pt), across, "offset points", ha=name.aligned, color=DARK, bbox=BEHIND
        )
    return sum(bool(row) for row in taken)


class _Name(NamedTuple):
    """Where a mark's name is, in points from the left end of its axes."""

    begin_pt: float
    end_pt: float
    shift_pt: float
    """How far from the mark's line it's aligned."""
    aligned: Literal["left", "right"]


def _place(axes: Axes, mark: Mark, beyond_pt: float) -> _Name:
    """Let a mark's name begin at its line, or end there, or else, in narrow axes, run across it."""
    begin, end = axes.get_xlim()
    width_pt = axes.bbox.width * 72 / DPI
    at_pt = (mark.time_s - begin) / (end - begin) * width_pt
    wide_pt = CHARACTER_PT * (len(mark.label) + 1)
    last_pt = width_pt + beyond_pt - wide_pt
    if last_pt < at_pt and wide_pt <= at_pt:
        return _Name(at_pt - wide_pt, at_pt, -BESIDE_PT, "right")
    left_pt = min(at_pt, max(0.0, last_pt))
    return _Name(left_pt, left_pt + wide_pt, left_pt - at_pt + BESIDE_PT, "left")
