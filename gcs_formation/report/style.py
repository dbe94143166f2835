"""Style of figures: sizes for print, a palette for colour-blind readers, and marks of events."""

from __future__ import annotations

import math
import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.resources import as_file, files
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple, cast

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase

from flight_model.arrays import Array, Indices
from formation_scenario.fields import VehicleSelection
from formation_scenario.links import ImpairmentPatch, LinkChange
from gcs_formation.report import RunData

CM = 1 / 2.54
WIDTH_CM = 16.0
DPI = 200
TRACK_POINTS = 3000
"""Largest number of a track's points in a figure."""
INK = "#000000"
GREY = "#8C8C8C"
LIGHT = "#C8C8C8"
FOLLOWERS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#7A6FD0",
    "#8C6D31",
    "#5F8F8F",
    "#B05A7A",
)
"""Okabe and Ito's colours come first; used in figures and on the page."""
WORST = "#D55E00"
ASKED = "#E69F00"
BAND = "#0072B2"
LIMIT = "#B00020"
NEAREST = "#56B4E9"
THIN = 0.6
LINE = 0.9
FONT_PT = 8.0
"""As in print.mplstyle."""
CHARACTER_PT = 4.9
"""Mean width of a character."""
HANDLE_EM, BETWEEN_EM = 1.8, 1.4
"""Length of a legend's lines and the space between its columns, in font sizes."""
MAX_COLUMNS = 5

PATH_POINTS = 2000
SAME_S = 0.5
"""Marks with the same label within this time are shown once."""
MAX_EVENTS = 12
"""Largest number of events shown; a link that comes and goes would hide everything else."""
WORDS = {
    "delay_ms": "delay {:g} ms",
    "jitter_ms": "jitter {:g} ms",
    "loss": "loss {:.0%}",
    "duplicate": "twice {:.0%}",
    "rate_kbps": "{:g} kbit/s",
}


@contextmanager
def print_style() -> Generator[None]:
    """Draw in the style of `print.mplstyle`; restore Matplotlib's settings afterwards."""
    with mpl.rc_context(), as_file(files("gcs_formation.report") / "assets" / "print.mplstyle") as settings:
        mpl.rcdefaults()
        mpl.rcParams.update(mpl.rc_params_from_file(settings, use_default_template=False))
        yield


def new_figure(height_cm: float) -> Figure:
    """Return an empty figure as wide as a page, with automatic layout."""
    return Figure(figsize=(WIDTH_CM * CM, height_cm * CM), dpi=DPI, layout="constrained")


def axes_grid(figure: FigureBase, rows: int, columns: int, **shared: Any) -> list[list[Axes]]:
    """Return axes by row and column; `shared` is passed to Matplotlib's `subplots`."""
    return cast("list[list[Axes]]", figure.subplots(rows, columns, squeeze=False, **shared).tolist())


def panels(figure: FigureBase, rows: int, columns: int, count: int) -> list[Axes]:
    """Return `count` axes, row by row; the rest of the grid stays empty."""
    made = [axes for row in axes_grid(figure, rows, columns) for axes in row]
    for spare in made[count:]:
        spare.set_axis_off()
    return made[:count]


UNDATED: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Creator": None, "Date": None},
    "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
}
"""Formats of figures, and what Matplotlib would write about itself and the day: the same run gives the same bytes."""
FORMATS = tuple(UNDATED)


def save(figure: Figure, path: Path, kind: str = "png") -> None:
    """Write a figure in one of `FORMATS`, without Matplotlib's version and the date."""
    with mpl.rc_context({"svg.hashsalt": path.stem}):
        figure.savefig(path, format=kind, metadata=UNDATED[kind])


def legend_below(figure: Figure, *, outside: bool = True) -> None:
    """Draw one legend below the axes for all labels, row by row, in as many columns as fit.

    `outside`: Matplotlib's layout makes room for it.
    """
    named: dict[str, Artist] = {}
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        named |= {str(label): handle for handle, label in zip(handles, labels, strict=True)}
    if named:
        columns = _columns_that_fit([_width_pt(label) for label in named], 72.0 * figure.get_figwidth())
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
    """Return the approximate width of a legend entry with its line and the space after it."""
    shown = re.sub(r"\\.|[$^_{}]", "", label)
    return CHARACTER_PT * len(shown) + (HANDLE_EM + BETWEEN_EM + 0.8) * FONT_PT


def _columns_that_fit(widths_pt: Sequence[float], room_pt: float) -> int:
    """Return the largest number of columns, filled row by row, that fit."""
    wide_pt = {n: sum(max(widths_pt[i::n]) for i in range(n)) for n in range(min(MAX_COLUMNS, len(widths_pt)), 1, -1)}
    return next((columns for columns, needed_pt in wide_pt.items() if needed_pt <= room_pt), 1)


def annotate(axes: Axes, text: str) -> None:
    """Write into empty axes why they are empty."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=GREY)


def extremes(values: Array, buckets: int) -> Indices:
    """Return ascending indices into (T,) values that keep every extreme a plot could show.

    The series is cut into at most `buckets` pieces. In each the smallest, the largest and, if there is one, an unknown
    (NaN) value are kept, so that a line through them has the same range and the same gaps. First and last are kept too.
    A series of at most 2 * `buckets` values is kept whole.
    """
    size = values.size
    if size <= 2 * buckets:
        return np.arange(size)
    width = -(-size // buckets)
    padded = np.full(width * -(-size // width), values[-1])
    padded[:size] = values
    pieces = padded.reshape(-1, width)
    unknown = np.isnan(pieces)
    begin = np.arange(pieces.shape[0]) * width
    kept = [
        begin + np.where(unknown, np.inf, pieces).argmin(axis=1),
        begin + np.where(unknown, -np.inf, pieces).argmax(axis=1),
        (begin + unknown.argmax(axis=1))[unknown.any(axis=1)],
        np.array([0, size - 1]),
    ]
    return np.unique(np.minimum(np.concatenate(kept), size - 1))


def reach(positions: Array) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates (D,) of the known ones of (N, D) positions; 0 if none is known."""
    known = positions[np.isfinite(positions).all(axis=1)]
    known = known if known.size else np.zeros_like(positions[:1])
    return known.min(axis=0), known.max(axis=0)


def evenly(size: int, count: int) -> Indices:
    """Return at most `count` ascending indices, spread over a series of `size`, first and last included."""
    if size <= count:
        return np.arange(size)
    return np.unique(np.round(np.linspace(0, size - 1, count)).astype(np.intp))


def path_m(run: RunData) -> Array:
    """Return the scenario's path, (P, 3) north, east, height."""
    path = run.scenario.leader_path
    points = path.at(np.linspace(0.0, path.length_m, PATH_POINTS))
    return np.column_stack((points.north_m, points.east_m, points.height_m))


class Mark(NamedTuple):
    """A short label at a mission time."""

    time_s: float
    label: str


def marks(run: RunData) -> list[Mark]:
    """Return marks of planned changes, changes of leader, orders and lost links, by time, without duplicates."""
    kept: list[Mark] = []
    for mark in sorted([*_planned(run), *_happened(run)]):
        alike = any(mark.time_s - other.time_s <= SAME_S and other.label == mark.label for other in kept)
        if run.time_s[0] <= mark.time_s <= run.time_s[-1] and not alike:
            kept.append(mark)
    return kept


def _planned(run: RunData) -> Iterator[Mark]:
    if not run.begun:
        return
    scenario = run.scenario
    named = (("disturbance", each) for each in scenario.disturbances), ((each.kind, each) for each in scenario.faults)
    for name, each in chain(*named):
        yield Mark(each.at_s, f"{name}{_of(each.vehicles)}")
        if each.end_s < math.inf:
            yield Mark(each.end_s, f"{name} over{_of(each.vehicles)}")
    for change in scenario.formation.changes:
        leader = f"leader {change.leader}" if change.leader is not None else ""
        spacing = f"spacing {change.spacing_m:g} m" if change.shape is None and change.spacing_m is not None else ""
        yield Mark(change.at_s, ", ".join(filter(None, (change.shape, spacing, leader))) or "slots")
    for change_of_links in scenario.links.changes:
        yield Mark(change_of_links.at_s, f"{_link(change_of_links)}{_of(change_of_links.vehicles)}")


def _happened(run: RunData) -> Iterator[Mark]:
    marked = (Mark(float(e["t_s"]) - run.zero_s, words) for e in run.events if (words := _words(e)) is not None)
    return islice(marked, MAX_EVENTS)


def _words(event: Mapping[str, Any]) -> str | None:
    """Return the label of an event, None if it gets no mark."""
    match event.get("kind"), event.get("text"):
        case "link", "lost":
            return f"link lost ({event.get('vehicle', '?')})"
        case "link_choice", _:
            return f"link {event.get('link', '?')} ({event.get('vehicle', '?')})"
        case "leader", _:
            return f"leader {event.get('vehicle', '?')}"
        case "order", text if event.get("accepted"):
            return str(text).removesuffix(": accepted")
        case _:
            return None


def _of(vehicles: VehicleSelection) -> str:
    if vehicles == "all":
        return ""
    return f" ({', '.join(map(str, vehicles[:3]))}{', …' if len(vehicles) > 3 else ''})"


def _link(change: LinkChange) -> str:
    patches: dict[str, ImpairmentPatch | None] = {"": change, "up ": change.uplink, "down ": change.downlink}
    words = [
        direction + text.format(value)
        for direction, patch in patches.items()
        for key, text in WORDS.items()
        if (value := getattr(patch, key, None)) is not None
    ]
    return ", ".join(words) or "link change"
