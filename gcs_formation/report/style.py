"""How figures look: sizes for print, a palette that colour-blind readers can tell apart, and marks of what happened."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from formation_scenario.fields import Timed, VehicleSelection
from formation_scenario.formation import FormationChange
from formation_scenario.links import ImpairmentPatch, LinkChange
from gcs_formation.report.run_data import RunData

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

CM = 1 / 2.54
WIDTH_CM = 16.0
DPI = 200
INK = "#000000"
GREY = "#8C8C8C"
LIGHT = "#C8C8C8"
FOLLOWERS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A6FD0", "#8C6D31", "#5F8F8F", "#B05A7A",
)  # fmt: skip
"""Okabe and Ito's first, in figures and on the page alike."""
WORST = "#D55E00"
ASKED = "#E69F00"
BAND = "#0072B2"
LIMIT = "#B00020"
NEAREST = "#56B4E9"
THIN = 0.6
LINE = 0.9
FONT_PT = 8.0
CHARACTER_PT = 4.9
"""Mean width of a character."""
HANDLE_EM, BETWEEN_EM = 1.8, 1.4
"""Length of a legend's lines and what is between its columns, in sizes of the font."""
MOST_COLUMNS = 5

WHITE = (1.0, 1.0, 1.0, 1.0)

SETTINGS: dict[RcKeyType, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": FONT_PT,
    "axes.titlesize": FONT_PT,
    "axes.labelsize": FONT_PT,
    "xtick.labelsize": FONT_PT,
    "ytick.labelsize": FONT_PT,
    "legend.fontsize": FONT_PT,
    "legend.frameon": False,
    "axes.linewidth": THIN,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.5,
    "xtick.major.width": THIN,
    "ytick.major.width": THIN,
    "lines.linewidth": LINE,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "axes3d.xaxis.panecolor": WHITE,
    "axes3d.yaxis.panecolor": WHITE,
    "axes3d.zaxis.panecolor": WHITE,
}
SAME_S = 0.5
"""Marks of one label no further apart than this are one."""
MOST_EVENTS = 12
"""Events shown; a link that comes and goes would hide everything else."""
WORDS = {
    "delay_ms": "delay {:g} ms",
    "jitter_ms": "jitter {:g} ms",
    "loss": "loss {:.0%}",
    "duplicate": "twice {:.0%}",
    "rate_kbps": "{:g} kbit/s",
}


@contextmanager
def print_style() -> Generator[None]:
    """Draw in this module's style, and leave Matplotlib's settings as they were."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def new_figure(height_cm: float) -> Figure:
    """Return an empty figure as wide as a page, with automatic layout."""
    return Figure(figsize=(WIDTH_CM * CM, height_cm * CM), dpi=DPI, layout="constrained")


def axes_grid(
    figure: FigureBase,
    rows: int,
    columns: int,
    *,
    sharex: bool | Literal["col"] = False,
    sharey: bool | Literal["row"] = False,
    width_ratios: Sequence[float] | None = None,
) -> list[list[Axes]]:
    """Return axes by row and column."""
    grid = figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey, width_ratios=width_ratios)
    return cast("list[list[Axes]]", grid.tolist())


def column_of(grid: Sequence[Sequence[Axes]], column: int) -> list[Axes]:
    """Return the axes above each other in a column, from the top."""
    return [row[column] for row in grid]


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, without Matplotlib's version in it, so that the same run gives the same bytes."""
    figure.savefig(path, format="png", metadata={"Software": None})


def legend_below(figure: Figure, *, outside: bool = True) -> None:
    """Name everything that has a label, once, under the axes, row after row, in as many columns as fit.

    `outside`: the axes make room for it by themselves.
    """
    named: dict[str, Artist] = {}
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        named |= {str(label): handle for handle, label in zip(handles, labels, strict=True)}
    if named:
        room_pt = 72.0 * figure.get_figwidth()
        columns = _columns_that_fit([_width_pt(label) for label in named], room_pt)
        by_row = [label for column in range(columns) for label in list(named)[column::columns]]
        figure.legend(
            [named[label] for label in by_row],
            by_row,
            loc="outside lower center" if outside else "lower center",
            ncols=columns,
            handlelength=HANDLE_EM,
            columnspacing=BETWEEN_EM,
        )


def _width_pt(label: str) -> float:
    """Return about how wide a legend's entry is with its line and the space after it."""
    shown = re.sub(r"\\.|[$^_{}]", "", label)
    return CHARACTER_PT * len(shown) + (HANDLE_EM + BETWEEN_EM + 0.8) * FONT_PT


def _columns_that_fit(widths_pt: Sequence[float], room_pt: float) -> int:
    """Return the most columns, filled row after row, that have room beside each other."""
    for columns in range(min(MOST_COLUMNS, len(widths_pt)), 1, -1):
        if sum(max(widths_pt[column::columns]) for column in range(columns)) <= room_pt:
            return columns
    return 1


def note(axes: Axes, text: str) -> None:
    """Write in the middle of empty axes why they are empty."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)


class Mark(NamedTuple):
    """Something at a mission time, in a word or two."""

    time_s: float
    label: str
    kind: str
    """disturbance, fault, shape, link, order or lost."""


def marks(run: RunData) -> list[Mark]:
    """Return planned changes and events, changes of leader, orders and lost links, by time."""
    begin, end = float(run.time_s[0]), float(run.time_s[-1])
    found = [*_planned(run), *_happened(run)]
    inside = (mark for mark in found if begin <= mark.time_s <= end)
    return _merged(sorted(inside))


def _planned(run: RunData) -> Iterator[Mark]:
    if not run.begun:
        return
    scenario = run.scenario
    for disturbance in scenario.disturbances:
        yield from _passing(disturbance, "disturbance", "disturbance", disturbance.until_s)
    for fault in scenario.faults:
        yield from _passing(fault, fault.kind, "fault", fault.until_s)
    for change in scenario.formation.changes:
        yield Mark(change.at_s, _changed(change), "shape")
    for change in scenario.links.changes:
        yield Mark(change.at_s, f"{_link(change)}{_of(change.vehicles)}", "link")


def _changed(change: FormationChange) -> str:
    """Return a change of the formation in a few words."""
    leader = f"leader {change.leader}" if change.leader is not None else ""
    spacing = f"spacing {change.spacing_m:g} m" if change.shape is None and change.spacing_m is not None else ""
    return ", ".join(part for part in (change.shape or "", spacing, leader) if part) or "slots"


def _passing(each: Timed, name: str, kind: str, until_s: float | None) -> Iterator[Mark]:
    """Yield when something begins and, if it does, ends."""
    yield Mark(each.at_s, f"{name}{_of(each.vehicles)}", kind)
    if until_s is not None:
        yield Mark(until_s, f"{name} over{_of(each.vehicles)}", kind)


def _happened(run: RunData) -> list[Mark]:
    marked = (Mark(float(e["t_s"]) - run.zero_s, *words) for e in run.events if (words := _words(e)) is not None)
    return list(islice(marked, MOST_EVENTS))


def _words(event: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return label and kind of an event that is worth a mark."""
    vehicle = event.get("vehicle", "?")
    match event.get("kind"), event.get("text"):
        case "link", "lost":
            return f"link lost ({vehicle})", "lost"
        case "leader", _:
            return f"leader {vehicle}", "shape"
        case "order", text if event.get("accepted"):
            return str(text).removesuffix(": accepted"), "order"
        case _:
            return None


def _of(vehicles: VehicleSelection) -> str:
    if vehicles == "all":
        return ""
    return f" ({', '.join(map(str, vehicles[:3]))}{', …' if len(vehicles) > 3 else ''})"


def _link(change: LinkChange) -> str:
    ways = ("", "up ", "down ")
    patches: tuple[ImpairmentPatch | None, ...] = (change, change.uplink, change.downlink)
    words = [
        way + text.format(value)
        for way, patch in zip(ways, patches, strict=True)
        if patch is not None
        for key, text in WORDS.items()
        if (value := getattr(patch, key)) is not None
    ]
    return ", ".join(words) or "link change"


def _merged(ordered: Iterable[Mark]) -> list[Mark]:
    kept: list[Mark] = []
    for mark in ordered:
        same = (other for other in kept if mark.time_s - other.time_s <= SAME_S and other.label == mark.label)
        if next(same, None) is None:
            kept.append(mark)
    return kept
