"""Flights in a notebook: a figure that follows one, a run's figures and its summary inline.

Nothing here needs Jupyter: an object says by `_repr_png_` and `_repr_html_` how a notebook shows it
(ipython.readthedocs.io, "Rich display"), and elsewhere figures are saved or left.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from html import escape
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure

from flight_model.arrays import Array
from gcs_formation.report import load_run
from gcs_formation.report.page import PLATES
from gcs_formation.report.style import FOLLOWERS, GREY, INK, evenly, new_figure, print_style

HEIGHT_CM = 9.0
MAX_POINTS = 1000
"""Of each vehicle's line: what more there is can't be seen."""
SCREEN_DPI = 110


class _Vehicle(Protocol):
    @property
    def state(self) -> Any: ...  # noqa: ANN401 - north_m, east_m
    @property
    def error_m(self) -> tuple[float, float, float]: ...


class Tick(Protocol):
    """What is shown of a flight's tick: `FlightTick` has it."""

    @property
    def time_s(self) -> float:
        """Since the run's clock began, s."""

    @property
    def phase(self) -> str:
        """The run's phase."""

    @property
    def vehicles(self) -> Mapping[Any, Any]:
        """Every vehicle by its id."""


AnyTick = TypeVar("AnyTick", bound=Tick)
Show = Callable[[object], None]


class Picture:
    """A figure that a notebook shows inline."""

    def __init__(self, figure: Figure) -> None:
        """Take a Matplotlib figure."""
        self.figure = figure

    def save(self, path: str | Path) -> Path:
        """Write it as PNG; return the path."""
        Path(path).write_bytes(self._png(self.figure.dpi))
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self._png(SCREEN_DPI)

    def _png(self, dpi: float) -> bytes:
        written = BytesIO()
        with print_style():
            self.figure.savefig(written, format="png", dpi=dpi, metadata={"Software": None})
        return written.getvalue()


def run_figure(run_dir: Path, name: str) -> Picture:
    """Return a figure of a run, as `gcs-formation report` draws it.

    Raises:
        ValueError: there is no figure of that name, or this run has nothing to show in it.
        RecordError: the run can't be read.
    """
    draws = {draw.__name__: (draw, has) for draw, has in PLATES.items()}
    run = load_run(run_dir)
    shown = [each for each, (_, has) in draws.items() if has(run)]
    if name not in shown:
        raise ValueError(f"found '{name}'; allowed: {', '.join(shown)}")
    with print_style():
        return Picture(draws[name][0](run))


def table_html(text: str, verdict: str, where: str) -> str:
    """Return a summary's table of text, and its verdict, as HTML."""
    head, *rows = [line.split("  ") for line in text.splitlines()]
    cells = [[each.strip() for each in row if each.strip()] for row in (head, *rows)]
    lines = ["".join(f"<{tag}>{escape(each)}</{tag}>" for each in row) for tag, row in _tagged(cells)]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<p>{escape(verdict)}, <code>{escape(where)}</code></p><table>{body}</table>"


def _tagged(rows: list[list[str]]) -> Iterator[tuple[str, list[str]]]:
    yield from zip(("th", *("td",) * (len(rows) - 1)), rows, strict=True)


class FlightFigure:
    """A figure that follows a stepped flight: tracks over the ground, and followers' distances from their slots.

    `for tick in figure.follow(flight): …` draws it while the flight goes on, in a notebook in place of the last one.
    """

    def __init__(self, show: Show | None = None) -> None:
        """Show it by a function; default: in the notebook's output, if there is one."""
        self._show = show
        self._tracks: dict[str, list[tuple[float, float]]] = {}
        """North and east of each vehicle, m."""
        self._off: dict[str, list[tuple[float, float]]] = {}
        """Time, s, and each follower's distance from its slot, m."""
        self._head = ""

    def follow(self, ticks: Iterable[AnyTick], every_s: float = 5.0) -> Iterator[AnyTick]:
        """Yield a flight's ticks, and show the figure every `every_s` of it, and when it is over."""
        show, due_s = self._show or _in_place(), -math.inf
        for tick in ticks:
            self.append(tick)
            if tick.time_s >= due_s:
                due_s = tick.time_s + every_s
                show(self)
            yield tick
        show(self)

    def append(self, tick: Tick) -> None:
        """Add a tick."""
        self._head = f"{tick.time_s:.0f} s, {tick.phase}"
        for ref, vehicle in tick.vehicles.items():
            north_m, east_m = vehicle.state.north_m, vehicle.state.east_m
            if math.isfinite(north_m) and math.isfinite(east_m):
                self._tracks.setdefault(str(ref), []).append((north_m, east_m))
            off_m = math.sqrt(sum(each * each for each in vehicle.error_m))
            if math.isfinite(off_m):
                self._off.setdefault(str(ref), []).append((tick.time_s, off_m))

    def picture(self) -> Picture:
        """Return the figure as it is now."""
        with print_style():
            figure = new_figure(HEIGHT_CM)
            plan, errors = figure.subplots(1, 2)
            for number, (ref, track) in enumerate(self._tracks.items()):
                colour = INK if ref not in self._off else FOLLOWERS[number % len(FOLLOWERS)]
                positions = _thinned(track)
                plan.plot(positions[:, 1], positions[:, 0], color=colour, label=ref)
                plan.plot(*positions[-1, ::-1], marker="o", color=colour, markersize=3)
            for number, (ref, off) in enumerate(self._off.items(), 1):
                errors.plot(*_thinned(off).T, color=FOLLOWERS[number % len(FOLLOWERS)], label=ref)
            plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", adjustable="datalim", title=self._head)
            errors.set(xlabel="time, s", ylabel="from the slot, m", ylim=(0.0, None))
            errors.grid(color=GREY, alpha=0.3)
            if self._tracks:
                plan.legend(title="vehicle", fontsize="small")
        return Picture(figure)

    def _repr_png_(self) -> bytes:
        return self.picture()._repr_png_()


def _thinned(points: list[tuple[float, float]]) -> Array:
    """Return points (n, 2), at most `MAX_POINTS` of them."""
    every = np.array(points, dtype=np.float64).reshape(-1, 2)
    return every[evenly(len(every), MAX_POINTS)]


def _in_place() -> Show:
    """Return what shows an object in a notebook's output, in place of the last one; nothing outside of a notebook."""
    python: Any = sys.modules.get("IPython")
    if python is None or python.get_ipython() is None:
        return lambda _: None
    handles = list[Any]()

    def show(shown: object) -> None:
        if handles:
            handles[0].update(shown)
        else:
            handles.append(import_module("IPython.display").display(shown, display_id=True))

    return show
