"""The comparison as a table: for a terminal, and as HTML."""

from __future__ import annotations

from typing import NamedTuple

from gcs_formation.compare.comparison import Comparison, Row
from gcs_formation.report.tables import number, table

HEADS = {"rms": "rms x / y / z, m", "max": "max x / y / z, m", "steady_max": "steady x / y / z, m"}


class Cell(NamedTuple):
    """A figure of a row: its column's head and its text."""

    head: str
    text: str
    width: int
    """Characters of its column in a terminal."""


def comparison_text(comparison: Comparison) -> str:
    """Return the table for a terminal, what its figures are, and what is said of each law."""
    names = [row.law for row in comparison.rows]
    width = max(map(len, ("law", *names)))
    lines = [_about(comparison)]
    shown = [row for row in comparison.rows if not row.aborted]
    if shown:
        heads = [f"{cell.head:>{cell.width}}" for cell in _cells(shown[0])]
        lines.append("  ".join((f"{'law':<{width}}", *heads)))
    for row in shown:
        cells = (f"{cell.text:>{cell.width}}" for cell in _cells(row))
        lines.append("  ".join((f"{row.law:<{width}}", *cells)))
    return "\n".join([*lines, *(f"{law}: {text}" for law, text in _notes(comparison))])


def comparison_table(comparison: Comparison) -> str:
    """Return the table as HTML."""
    shown = [row for row in comparison.rows if not row.aborted]
    heads = [cell.head for cell in _cells(shown[0])] if shown else []
    rows = [[row.law, *(cell.text for cell in _cells(row))] for row in shown]
    notes = _notes(comparison)
    return (table(["Law", *heads], rows) if rows else "") + (table(["Law", "note"], notes, (0, 1)) if notes else "")


def _about(comparison: Comparison) -> str:
    window = comparison.window
    return (
        f"{comparison.name}, seed {comparison.seed}: errors of the worst follower, frame {comparison.frame}, "
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


def _cells(row: Row) -> list[Cell]:
    errors = row.error_x_m, row.error_y_m, row.error_z_m
    used = None if row.margin_used is None else 100.0 * row.margin_used
    return [
        Cell("settled, s", number(row.settled_at_s, 1), 10),
        *(Cell(head, " / ".join(number(axis[figure]) for axis in errors), 21) for figure, head in HEADS.items()),
        Cell("steps, m/s / rad / m", " / ".join(number(row.effort[each]["step_p95"]) for each in row.effort), 21),
        Cell("separation, m", number(row.min_separation_m, 1), 13),
        Cell("margin, s", number(row.delay_margin_s, 2), 9),
        Cell("used, %", number(used, 0), 7),
    ]
