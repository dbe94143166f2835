"""Flies a scenario by several laws, and sets them side by side as table, figure and page."""

from __future__ import annotations

import json
import shutil
from collections import deque
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from airlink.cli.exit_status import raised
from airlink.cli.output_directory import refusal
from formation_scenario import Problem, Scenario, ScenarioError, load_scenario
from formation_scenario.errors import did_you_mean
from formation_scenario.expectation import SETTLED_M
from gcs_formation.app.result_text import WIDE, Group
from gcs_formation.app.result_text import table as text_table
from gcs_formation.control import laws
from gcs_formation.errors import RecordError
from gcs_formation.record.run_directory import SCENARIO
from gcs_formation.report.geometry import extremes
from gcs_formation.report.html import document, figure, number, table
from gcs_formation.report.style import (
    GREY,
    LINE,
    THIN,
    axes_grid,
    column_of,
    legend_below,
    new_figure,
    note,
    print_style,
    save,
)
from gcs_formation.report.time_axes import BUCKETS, draw_marks, span
from gcs_formation.studies.flight import COULD_NOT_GO_ON, EXPECTED, Task
from gcs_formation.studies.keys import Study
from gcs_formation.studies.law_scores import Comparison, Line, Row, Window, compare_flights
from gcs_formation.studies.plan import Planned
from gcs_formation.studies.workers import Workers

WAYS = (("", "law.delay_compensation=true"), ("_uncompensated", "law.delay_compensation=false"))
LAWS: dict[str, tuple[str, ...]] = {
    f"{law}{variant}{way}": (f"law.type={law}", *overrides, compensated)
    for law, kind in laws.LAWS.items()
    for variant, overrides in kind.variants
    for way, compensated in WAYS
}
"""Overrides in the manner of `--set`; gains stay the scenario's, and the consensus law has its own."""
LABELS = ("forward |error| $x$, m", "right |error| $y$, m", "height |error| $z$, m")
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D31")
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1, 1, 1)))
LEAST_M = 1e-3
SETTLING_S = 60.0
"""What the left column shows, where the window begins later."""
HEADS = {"rms": "rms x / y / z, m", "max": "max x / y / z, m", "steady_max": "steady x / y / z, m"}
NAME = "comparison"
TITLE = "Largest error of any follower over time"
CAPTION = (
    "Drawn is the largest within a second before and after, so that errors that pass through zero are no dips; "
    "what is below 1 mm is drawn there."
)
TWO_SPANS = "Left: how each law settles; right: the window of the table. "


def named_laws(names: str) -> tuple[str, ...]:
    """Return the laws of a list like "pid,fuzzy_pid", each once.

    Raises:
        ScenarioError: a name isn't one of `LAWS`.
    """
    found = tuple(dict.fromkeys(name.strip() for name in names.split(",")))
    unknown = [name for name in found if name not in LAWS]
    if unknown:
        allowed = ", ".join(LAWS)
        problems = [
            Problem("--laws", None, None, "", f"found '{name}'{did_you_mean(name, LAWS)}", allowed) for name in unknown
        ]
        raise ScenarioError(problems)
    return found


def comparison_figure(comparison: Comparison) -> Figure:
    """Draw |error| by axis over the window; where that begins later, how the laws settle on the left of it."""
    figure = new_figure(13.5)
    if not comparison.lines:
        note(figure.add_subplot(), "no law flew any follower")
        return figure
    columns = spans(comparison.window)
    ratios = (0.6, 1.0)[-len(columns) :]
    grid = axes_grid(figure, 3, len(columns), sharex="col", sharey="row", width_ratios=ratios)
    for index, (begin, end) in enumerate(columns):
        for axis, axes in enumerate(column_of(grid, index)):
            _panel(axes, comparison.lines, axis, begin, end)
        grid[-1][index].set_xlabel("mission time, s")
    draw_marks([column_of(grid, index) for index in range(len(columns))], comparison.marks)
    for axis, (row, label) in enumerate(zip(grid, LABELS, strict=True)):
        row[0].set_ylabel(label)
        most = max(float(np.nanmax(line.error_m[:, axis], initial=SETTLED_M)) for line in comparison.lines)
        row[0].set_ylim(LEAST_M, 2.0 * most)
    figure.align_ylabels(column_of(grid, 0))
    legend_below(figure)
    return figure


def spans(window: Window) -> list[tuple[float, float]]:
    """Return the spans of time that are drawn beside each other: one, where it shows how laws settle as well."""
    if window.from_s > 0.0 and window.to_s > SETTLING_S:
        return [(0.0, SETTLING_S), (window.from_s, window.to_s)]
    return [(0.0, window.to_s)]


def _panel(axes: Axes, lines: tuple[Line, ...], axis: int, begin: float, end: float) -> None:
    axes.set_yscale("log")
    highest_m = LEAST_M
    axes.yaxis.set_major_formatter(FuncFormatter(_plain))
    for index, line in enumerate(lines):
        kept = (line.time_s >= begin) & (line.time_s <= end)
        time_s, error_m = line.time_s[kept], np.maximum(line.error_m[kept, axis], LEAST_M)
        shown = extremes(error_m, BUCKETS)
        colour, dash = COLOURS[index % len(COLOURS)], DASHES[index % len(DASHES)]
        axes.plot(time_s[shown], error_m[shown], color=colour, ls=dash, lw=LINE, label=line.law)
        highest_m = max(highest_m, float(error_m.max(initial=LEAST_M)))
    if highest_m <= LEAST_M:
        note(axes, "all below 1 mm")
    axes.axhline(SETTLED_M, color=GREY, lw=THIN, ls=(0, (4, 2)), label="settled: within 0.5 m")
    span(axes, begin, end)


def _plain(value: float, _: int | None) -> str:
    return f"{value:g}"


def comparison_text(comparison: Comparison) -> str:
    """Return the table for a terminal, what its figures are, and what is said of each law."""
    shown = [row for row in comparison.rows if not row.aborted]
    rows = [(row.law, *_cells(row).values()) for row in shown]
    lines = text_table([Group(("law", *_cells(shown[0])), rows, 0)], WIDE) if shown else []
    return "\n".join([_about(comparison), *lines, *(f"{law}: {text}" for law, text in _notes(comparison))])


def comparison_table(comparison: Comparison) -> str:
    """Return the table as HTML."""
    shown = [row for row in comparison.rows if not row.aborted]
    rows = [[row.law, *_cells(row).values()] for row in shown]
    notes = _notes(comparison)
    made = table(["Law", *_cells(shown[0])], rows) if shown else ""
    return made + (table(["Law", "note"], notes, (0, 1)) if notes else "")


def _about(comparison: Comparison) -> str:
    window, scenario = comparison.window, comparison.scenario
    return (
        f"{scenario.name}, seed {scenario.seed}: errors of the worst follower, frame {scenario.formation.frame}, "
        f"{window.from_s:g} to {window.to_s:g} s; settled: all within 0.5 m for 10 s; steady: max from 30 s "
        "after that on; steps: of the setpoints from tick to tick, 95th percentile"
    )


def _notes(comparison: Comparison) -> list[tuple[str, str]]:
    """Return what is said of each law beside its figures."""
    return [
        (row.law, text)
        for row in comparison.rows
        for text in (*row.warnings, *((f"could not go on: {row.aborted}",) if row.aborted else ()))
    ]


def _cells(row: Row) -> dict[str, str]:
    """Return a row's figures by their columns' heads."""
    errors = row.error_x_m, row.error_y_m, row.error_z_m
    used = None if row.margin_used is None else 100.0 * row.margin_used
    return {
        "settled, s": number(row.settled_at_s, 1),
        **{head: " / ".join(number(axis[figure]) for axis in errors) for figure, head in HEADS.items()},
        "steps, m/s / rad / m": " / ".join(number(row.effort[each]["step_p95"]) for each in row.effort),
        "separation, m": number(row.min_separation_m, 1),
        "margin, s": number(row.delay_margin_s, 2),
        "used, %": number(used, 0),
    }


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
    scenario = comparison.scenario
    caption = TWO_SPANS + CAPTION if len(spans(comparison.window)) > 1 else CAPTION
    return document(
        f"{scenario.name}: laws side by side",
        "comparison.html",
        seed=str(scenario.seed),
        frame=escape(scenario.formation.frame.replace("_heading", "")),
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


@dataclass(frozen=True)
class CompareOptions:
    """Options on the command line of `compare`."""

    scenario: Path
    laws: str
    overrides: tuple[str, ...]
    out: Path
    from_s: float = 0.0
    to_s: float | None = None
    until_s: float | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class Compared:
    """Result of `compare`."""

    comparison: Comparison
    said: tuple[tuple[str, int, str], ...]
    """Each law that was flown, its flight's exit status, and what was broken or why it could not go on, in lines."""
    page: Path
    interrupted: bool

    @property
    def text(self) -> str:
        """The table, and where its files are."""
        return f"{comparison_text(self.comparison)}\nwrote {self.page}"

    @property
    def json(self) -> str:
        """What comparison.json holds."""
        return json.dumps(self.comparison.to_dict(), indent=2)

    def broken(self) -> list[str]:
        """Return what each law broke of the scenario's expectations and safety limits."""
        return self._of(EXPECTED)

    def stopped(self) -> list[str]:
        """Return which flights could not go on, and why."""
        return self._of(COULD_NOT_GO_ON)

    def _of(self, exit_status: int) -> list[str]:
        return [
            f"{law}: {text}" for law, status, words in self.said if status == exit_status for text in words.splitlines()
        ]


def compare_laws(options: CompareOptions, workers: Workers) -> Compared:
    """Fly a scenario by each law on one seed, and write and return the comparison: a study of one parameter, the law.

    Raises:
        ScenarioError: the scenario, an override or a law's name is wrong; nothing was started.
        RecordError: the directory holds an earlier comparison or other files, or it can't be written.
        RunAbortedError: no flight can be flown.
    """
    laws = named_laws(options.laws)
    scenario = load_scenario(options.scenario, options.overrides)
    window = _window(scenario, options)
    tasks = [_task(number, law, options) for number, law in enumerate(laws)]
    _claim(options.out, overwrite=options.overwrite)
    rows = dict[int, dict[str, Any]]()
    interrupted = False
    try:
        with raised(), workers:
            for row in workers.rows(deque(tasks)):
                rows[row["flight"]] = row
    except KeyboardInterrupt:
        interrupted = True
    said = tuple((laws[flight], rows[flight]["exit"], rows[flight]["words"]) for flight in sorted(rows))
    flown = {law: words if status > EXPECTED else "" for law, status, words in said}
    comparison = compare_flights(flown, options.out, scenario, window)
    return Compared(comparison, said, write_comparison(comparison, options.out), interrupted)


def _task(number: int, law: str, options: CompareOptions) -> Task:
    """Return a law's flight; its settings take precedence over the command line's."""
    scenario = load_scenario(options.scenario, (*options.overrides, *LAWS[law]))
    planned = Planned(number, scenario.seed, {})
    return Task(planned, Study(record="full", until_s=options.until_s), scenario, str(options.out / law))


def _claim(out: Path, *, overwrite: bool) -> None:
    """Make the directory, without what an earlier comparison has left in it.

    Raises:
        RecordError: it holds an earlier comparison or other files, or it can't be written.
    """
    try:
        refused = refusal(out, overwrite=overwrite, mark=f"{NAME}.json")
        if refused is not None:
            raise RecordError(refused)
        out.mkdir(parents=True, exist_ok=True)
        for stale in out.glob(f"{NAME}.*"):
            stale.unlink()
        for law in LAWS:
            if (out / law / SCENARIO).is_file():
                shutil.rmtree(out / law)
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error.strerror}; allowed: a directory that can be written") from error


def _window(scenario: Scenario, options: CompareOptions) -> Window:
    end_s = scenario.duration_s if options.until_s is None else min(options.until_s, scenario.duration_s)
    window = Window(options.from_s, end_s if options.to_s is None else options.to_s)
    if not window.from_s < window.to_s <= end_s:
        found = f"found {window.from_s:g} s to {window.to_s:g} s"
        raise ScenarioError([Problem("--from, --to", None, None, "", found, f"a window within 0 s to {end_s:g} s")])
    return window
