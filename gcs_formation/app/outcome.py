"""The result of a finished run in a few lines of text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcs_formation.record.summary import Summary

MOST_ROWS = 24


def summary_text(summary: Summary, directory: Path) -> str:
    """Return the run's figures as a table, the verdicts, and where its files are."""
    figures = summary.to_dict()
    lines = [_headline(figures), *_follower_rows(figures), _safety(figures)]
    lines += _verdicts(summary)
    lines += [f"safety broken: {breach}" for breach in summary.breaches]
    return "\n".join([*lines, f"recorded in {directory}"])


def _verdicts(summary: Summary) -> list[str]:
    """Return a line for each expectation; of many, only those that didn't hold and a count."""
    if len(summary.verdicts) <= MOST_ROWS:
        return [f"expect {verdict}" for verdict in summary.verdicts]
    held = sum(verdict.held is True for verdict in summary.verdicts)
    others = [f"expect {verdict}" for verdict in summary.verdicts if verdict.held is not True]
    return [*others[:MOST_ROWS], f"expect: {held} of {len(summary.verdicts)} held"]


def _headline(figures: dict[str, Any]) -> str:
    factor = figures["real_time_factor"]
    pace = f", {factor:.1f} times real time" if factor else ""
    return f"{figures['name']}: flew {figures['duration_s']:.1f} s in {figures['wall_s']:.1f} s{pace}"


def _follower_rows(figures: dict[str, Any]) -> list[str]:
    source = "ground truth" if figures["truth"] else "telemetry"
    rows = [f"formation errors by {source}, m   rms x     y     z   max x     y     z   settled s   one-way ms"]
    for vehicle, follower in list(figures["followers"].items())[:MOST_ROWS]:
        axes = [follower[f"error_{axis}_m"] for axis in "xyz"]
        cells = [_number(axis[figure]) for figure in ("rms", "max") for axis in axes]
        delay = figures["links"][vehicle]["measured_delay_ms"]["p50"]
        settled = follower["settled_at_s"]
        name = f"vehicle {vehicle}"
        rows.append(f"  {name:<32} {' '.join(cells)}   {_number(settled, 1):>9}   {_number(delay, 1):>10}")
    if len(figures["followers"]) > MOST_ROWS:
        rows.append(f"  … and {len(figures['followers']) - MOST_ROWS} more in summary.json")
    return rows


def _safety(figures: dict[str, Any]) -> str:
    safety, control = figures["safety"], figures["control"]
    return (
        f"least separation {_number(safety['min_separation_m'], 1).strip()} m, clearance "
        f"{_number(safety['min_clearance_m'], 1).strip()} m, {safety['violations']} violations; "
        f"{control['late_ticks']} of {control['ticks']} ticks late"
    )


def _number(value: float | None, digits: int = 2) -> str:
    return f"{'–':>5}" if value is None else f"{value:5.{digits}f}"
