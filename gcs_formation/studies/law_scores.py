"""Compares the laws' flights in one window of time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d

from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from gcs_formation.app.check import lag_margins, warnings
from gcs_formation.record.figures_of_merit import Effort, axis_figures, effort, least, separation_m
from gcs_formation.record.timeseries import CHANNELS
from gcs_formation.report.run_data import RunData, load_run
from gcs_formation.report.style import Mark, marks
from gcs_formation.stability import law_margins
from gcs_formation.studies.flight import figure, worst

SCHEMA = 1
AROUND_S = 1.0
"""Errors cross zero, so the figure shows the largest one within this time before and after each tick."""
FIGURES = ("rms", "max", "steady_max")


@dataclass(frozen=True)
class Window:
    """Mission times from which and up to which errors count, both included, s."""

    from_s: float
    to_s: float


@dataclass(frozen=True)
class Row:
    """One law's figures; errors are those of the worst follower, by axis; None where there are none."""

    law: str
    settled_at_s: float | None
    """When the last follower settled, None if one never did; of the whole flight."""
    error_x_m: dict[str, float | None]
    error_y_m: dict[str, float | None]
    error_z_m: dict[str, float | None]
    effort: Effort
    """Of the setpoints, by channel, over the window: the worst follower's."""
    min_separation_m: float | None
    delay_margin_s: float | None
    margin_used: float | None
    warnings: tuple[str, ...] = ()
    """Warnings of `check`: loops whose delay is near or beyond their margin."""
    aborted: str = ""
    """Why there are no figures: the reason for which the run was aborted."""


@dataclass(frozen=True)
class Line:
    """One law's largest error of any follower within `AROUND_S` of each tick: (T,) mission times, (T, 3) m."""

    law: str
    time_s: Array
    error_m: Array


@dataclass(frozen=True)
class Comparison:
    """All laws' rows and lines."""

    scenario: Scenario
    window: Window
    rows: tuple[Row, ...]
    lines: tuple[Line, ...]
    marks: tuple[Mark, ...]
    """What happened in the first of the flights."""

    def to_dict(self) -> dict[str, Any]:
        """Return what comparison.json holds."""
        laws = {row.law: {key: value for key, value in asdict(row).items() if key != "law"} for row in self.rows}
        window = {"from_s": self.window.from_s, "to_s": self.window.to_s}
        flown = {"name": self.scenario.name, "seed": self.scenario.seed, "frame": self.scenario.formation.frame}
        return {"schema": SCHEMA, **flown, **window, "laws": laws}


def compare_flights(flown: Mapping[str, str], out: Path, scenario: Scenario, window: Window) -> Comparison:
    """Return the comparison of finished flights.

    Args:
        flown: why each law's run could not go on, "" where it could.
        out: has a run's directory of each law's name.
        scenario: that they flew.
        window: in which errors count.

    Raises:
        RecordError: a run directory can't be read.
    """
    runs = {law: load_run(out / law) for law, aborted in flown.items() if not aborted}
    rows = tuple(_row(law, runs[law], window) if law in runs else _no_row(law, why) for law, why in flown.items())
    lines = tuple(_line(law, run) for law, run in runs.items() if run.followers)
    happened = tuple(marks(next(iter(runs.values())))) if runs else ()
    return Comparison(scenario, window, rows, lines, happened)


def _no_row(law: str, aborted: str) -> Row:
    nothing: dict[str, float | None] = dict.fromkeys(FIGURES)
    return Row(law, None, nothing, nothing, nothing, {}, None, None, None, aborted=aborted)


def _row(law: str, run: RunData, window: Window) -> Row:
    within = run.flown.window(window.from_s, window.to_s)
    stability = run.summary["stability"]
    x, y, z = (_axis(run, window, axis) for axis in range(3))
    return Row(
        law=law,
        settled_at_s=figure(run.summary, "settled_at_s"),
        error_x_m=x,
        error_y_m=y,
        error_z_m=z,
        effort=_effort(run, within),
        min_separation_m=least(separation_m(run.flown, within)),
        delay_margin_s=stability["delay_margin_s"],
        margin_used=stability.get("margin_used"),
        warnings=tuple(warnings(run.scenario, law_margins(run.scenario), lag_margins(run.scenario)[0])),
    )


def _effort(run: RunData, within: Mask) -> Effort:
    found = [effort(run.flown.vehicles[vehicle], within) for vehicle in run.followers]
    return {
        channel: {
            name: worst(name, [each[channel][name] for each in found]) for name in ("variation_per_s", "step_p95")
        }
        for channel in CHANNELS
    }


def _axis(run: RunData, window: Window, axis: int) -> dict[str, float | None]:
    """Return the worst follower's figures on an axis; no steady figure unless all have settled."""
    settled_s = figure(run.summary, "settled_at_s")
    found: list[dict[str, float | None]] = []
    for vehicle in run.followers:
        error_m = run.flown.error(vehicle)[:, axis]
        kept = run.flown.window(window.from_s, window.to_s) & np.isfinite(error_m)
        found.append(axis_figures(run.time_s[kept], error_m[kept], settled_s))
    return {name: worst(name, [each[name] for each in found]) for name in FIGURES}


def _line(law: str, run: RunData) -> Line:
    errors = np.fmax.reduce(np.abs(np.stack([run.flown.error(vehicle) for vehicle in run.followers])))
    known = np.isfinite(errors)
    ticks = 2 * round(AROUND_S * run.scenario.law.rate_hz) + 1
    around = maximum_filter1d(np.where(known, errors, 0.0), ticks, axis=0, mode="nearest")
    return Line(law, run.time_s, np.where(known, around, np.nan))
