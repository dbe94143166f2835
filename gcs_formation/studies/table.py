"""A study's table in Markdown: a row for each sample, its figures over the seeds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from gcs_formation.studies.flight import worst
from gcs_formation.studies.keys import Study
from gcs_formation.studies.plan import Crossing, Planned, Row

NONE = "–"


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table: text to the left, numbers to the right; a row's cells are numbers where `head` ends in a unit."""
    lines = [_line(head), _line(["---:" if "," in cell else "---" for cell in head])]
    return "\n".join([*lines, *(_line([str(cell) for cell in row]) for row in rows)])


def sample_table(study: Study, rows: Sequence[Row], crossings: Sequence[tuple[Planned, Crossing]]) -> str:
    """Return the table of a study's rows.

    Of several seeds a figure is the median, with the worst in brackets. Of a search there is a row for each, with the
    figures of the two flights between which the bound is crossed.
    """
    if study.bisect is not None:
        return markdown(*_searches(study, rows, crossings))
    found = dict[int, list[Row]]()
    for row in rows:
        found.setdefault(int(row["flight"]) // study.seeds.count, []).append(row)
    cells = [[*_parameters(study, each[0]), *_figures(study, each)] for each in found.values()]
    return markdown([*study.parameters, *(f"{name}," for name in study.measured)], cells).replace(", |", " |")


def _searches(
    study: Study, rows: Sequence[Row], crossings: Sequence[tuple[Planned, Crossing]]
) -> tuple[list[str], Iterator[list[str]]]:
    search = study.bisect
    name = "" if search is None else search.parameter
    others = [each for each in study.measured if search is None or each != search.metric]

    def cells() -> Iterator[list[str]]:
        each = 1 if search is None else search.most_flights
        for first, crossing in crossings:
            flown = {row[name]: row for row in rows if row["flight"] // each == first.flight // each}
            ends = [flown[value] for value in crossing if value is not None]
            figures = [" to ".join(dict.fromkeys(_shown(end.get(metric)) for end in ends)) for metric in others]
            yield [*_parameters(study, first.parameters), str(first.seed), *map(_shown, crossing), *figures]

    return [*study.parameters, "seed", f"{name} kept up to", "broken from", *others], cells()


def _parameters(study: Study, row: Mapping[str, Any]) -> list[str]:
    return [_shown(row.get(name)) for name in study.parameters]


def _figures(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    for metric in study.measured:
        known = [row[metric] for row in rows if row[metric] is not None]
        middle = _shown(median(known)) if known else NONE
        least = _shown(worst(metric, [row[metric] for row in rows]))
        yield middle if len(rows) == 1 else f"{middle} ({least})"


def _shown(value: object) -> str:
    if value is None:
        return NONE
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
