"""Text that fits a terminal: tables that leave columns out, lines that leave parts out, words that are never cut."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

GAP = "  "
WIDE = 10**6


class Group(NamedTuple):
    """Columns of a table that stay or go together."""

    heads: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    keep: int
    """The groups of the lowest number go first where the table is too wide."""


def table(groups: Sequence[Group], width: int) -> list[str]:
    """Return a table's lines, with as many groups as fit; at least the one to keep longest."""
    chosen = list(groups)
    lines = _lines(chosen)
    while len(chosen) > 1 and max(map(len, lines)) > width:
        chosen.remove(min(chosen, key=lambda group: group.keep))
        lines = _lines(chosen)
    return lines


def line(parts: Sequence[tuple[str, ...]], width: int) -> str:
    """Return parts beside each other; where they don't fit, each takes its next wording or goes, the last first."""
    wordings = [[*each, ""] for each in parts]
    while len(_joined(wordings)) > width:
        longest = max(map(len, wordings))
        next(each for each in reversed(wordings) if len(each) == longest).pop(0)
    return _joined(wordings)


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """Return a text in lines of whole words; all but the first are indented."""
    lines = textwrap.wrap(text, max(width, 1), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return lines or [""]


def _joined(wordings: Sequence[Sequence[str]]) -> str:
    return GAP.join(wording[0] for wording in wordings if wording[0])


def _lines(groups: Sequence[Group]) -> list[str]:
    heads = [head for group in groups for head in group.heads]
    count = len(groups[0].rows)
    rows = [heads, *([cell for group in groups for cell in group.rows[i]] for i in range(count))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [_row(row, widths) for row in rows]


def _row(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a row: the first column, and texts in the last, set left; figures right."""
    first = cells[0].ljust(widths[0])
    rest = [cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True)]
    return GAP.join((first, *rest)).rstrip()
