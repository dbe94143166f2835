"""The result of a finished run in a few lines of text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gcs_formation.app.columns import WIDE, Group, table, wrapped
from gcs_formation.record.summary import Summary

MOST_ROWS = 24
TABLE_WIDTH = 80
"""Of tables in a pipe or a file; lines of words are whole there."""


def summary_text(summary: Summary, directory: Path, width: int | None = None) -> str:
    """Return the run's figures as a table, the verdicts, and where its files are.

    Args:
        summary: of the run.
        directory: the run's.
        width: of the terminal, characters; None: not on a terminal.
    """
    figures = summary.to_dict()
    words = [_headline(figures), _source(figures)]
    rows = table(_follower_groups(figures), width or TABLE_WIDTH) if figures["followers"] else []
    more = [_more(figures)] if len(figures["followers"]) > MOST_ROWS else []
    after = [_safety(figures), *_verdicts(summary), *(f"safety broken: {breach}" for breach in summary.breaches)]
    lines = [*_wrapped(words, width), *rows, *_wrapped([*more, *after, f"recorded in {directory}"], width)]
    return "\n".join(lines)


def result_line(summary: Summary) -> str:
    """Return how a run came out, for a log."""
    verdicts = [verdict.held for verdict in summary.verdicts]
    counts = {"held": verdicts.count(True), "broken": verdicts.count(False), "not judged": verdicts.count(None)}
    said = [f"{count} {name}" for name, count in counts.items() if count] or ["none"]
    violations = summary.to_dict()["safety"]["violations"]
    flown_s = summary.to_dict()["duration_s"]
    said_of = f"expectations: {', '.join(said)}; safety: {violations} violations"
    return f"{'result':<16}  flown to t = {flown_s:.1f} s; {said_of}"


def _wrapped(lines: Sequence[str], width: int | None) -> list[str]:
    return [part for line in lines for part in wrapped(line, width or WIDE)]


def _verdicts(summary: Summary) -> list[str]:
    """Return a line for each expectation; of many, only those that didn't hold and a count."""
    if len(summary.verdicts) <= MOST_ROWS:
        return [f"expect {verdict}" for verdict in summary.verdicts]
    held, waiting = (sum(verdict.held is state for verdict in summary.verdicts) for state in (True, None))
    others = [f"expect {verdict}" for verdict in summary.verdicts if verdict.held is not True]
    not_judged = f", {waiting} not judged" if waiting else ""
    return [*others[:MOST_ROWS], f"expect: {held} of {len(summary.verdicts)} held{not_judged}"]


def _headline(figures: dict[str, Any]) -> str:
    """Return what was flown, and how long it all took; the factor is that of all simulated seconds."""
    begun_s, wall_s, factor = figures["begun_s"], figures["wall_s"], figures["real_time_factor"]
    flown = "didn't reach its path" if begun_s is None else f"flew {figures['duration_s']:.1f} s of its path"
    before = f" after {begun_s:.1f} s of take-off and assembly" if begun_s else ""
    pace = f"; {factor * wall_s:.1f} s in all, in {wall_s:.1f} s: {factor:.1f} times real time" if factor else ""
    return f"{figures['name']} {flown}{before}{pace}"


def _source(figures: dict[str, Any]) -> str:
    source = "ground truth" if figures["truth"] else "telemetry"
    frame = "|x|, |y|, |z|: forward, right, up"
    return f"formation errors by {source}, m; {frame}" if figures["followers"] else "no vehicle followed"


def _follower_groups(figures: dict[str, Any]) -> list[Group]:
    """Return the table's columns: the largest errors stay longest, then when each settled."""
    shown = list(figures["followers"].items())[:MOST_ROWS]
    axes = [[follower[f"error_{axis}_m"] for axis in "xyz"] for _, follower in shown]
    links = [figures["links"][vehicle] for vehicle, _ in shown]
    return [
        Group(
            ("vehicle", "max x", "y", "z"),
            [(vehicle, *(_number(axis["max"]) for axis in own)) for (vehicle, _), own in zip(shown, axes, strict=True)],
            keep=4,
        ),
        Group(("rms x", "y", "z"), [[_number(axis["rms"]) for axis in own] for own in axes], keep=1),
        Group(("settled s",), [(_number(follower["settled_at_s"], 1),) for _, follower in shown], keep=3),
        Group(("one-way ms",), [(_number(link["measured_delay_ms"]["p50"], 0),) for link in links], keep=2),
        Group(
            ("up", "down"), [[_number(link[f"measured_{way}_ms"], 0) for way in ("up", "down")] for link in links], 0
        ),
    ]


def _more(figures: dict[str, Any]) -> str:
    return f"… and {len(figures['followers']) - MOST_ROWS} more in summary.json"


def _safety(figures: dict[str, Any]) -> str:
    safety, control = figures["safety"], figures["control"]
    return (
        f"least separation {_number(safety['min_separation_m'], 1)} m, clearance "
        f"{_number(safety['min_clearance_m'], 1)} m, {safety['violations']} violations; "
        f"{control['late_ticks']} of {control['ticks']} ticks late"
    )


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
