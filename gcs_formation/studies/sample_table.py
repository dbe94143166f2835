"""The table of a study's samples in Markdown: parameters, and the figures of their flights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median

from gcs_formation.studies import Bisection, Study
from gcs_formation.studies.flight import worst
from gcs_formation.studies.markdown import markdown
from gcs_formation.studies.plan import Crossing, Planned, Row

NONE = "–"


def sample_table(study: Study, rows: Sequence[Row], crossings: Sequence[tuple[Planned, Crossing]]) -> str:
    """Return the table of a study's rows.

    With several seeds a figure is the median, and the worst in brackets. A search has one row, with the figures of the
    two flights between which the bound is crossed.
    """
    if study.bisect is not None:
        return markdown(*_searches(study, study.bisect, rows, crossings))
    found = dict[int, list[Row]]()
    for row in rows:
        found.setdefault(int(row["flight"]) // study.seeds.count, []).append(row)
    cells = [[*_parameters(study, each), *_figures(study, each)] for each in found.values()]
    return markdown([*study.parameters, *(f"{name}," for name in study.measured)], cells).replace(", |", " |")


def _searches(
    study: Study, search: Bisection, rows: Sequence[Row], crossings: Sequence[tuple[Planned, Crossing]]
) -> tuple[list[str], Iterator[list[str]]]:
    name, each = search.parameter, search.max_flights
    others = [metric for metric in study.measured if metric != search.metric]

    def cells() -> Iterator[list[str]]:
        for first, crossing in crossings:
            flown = {row[name]: row for row in rows if row["flight"] // each == first.flight // each}
            ends = [flown[value] for value in crossing if value is not None]
            figures = [" to ".join(dict.fromkeys(_shown(end.get(metric)) for end in ends)) for metric in others]
            yield [*_parameters(study, [first.parameters]), str(first.seed), *map(_shown, crossing), *figures]

    return [*study.parameters, "seed", f"{name} kept up to", "broken from", *others], cells()


def _parameters(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    """Yield a sample's parameters; the range of one that each flight has drawn by itself."""
    for name in study.parameters:
        values = [row[name] for row in rows]
        same = all(value == values[0] for value in values)
        yield _shown(values[0]) if same else f"{_shown(min(values))} to {_shown(max(values))}"


def _figures(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    for metric in study.measured:
        known = [row[metric] for row in rows if row[metric] is not None]
        middle = _shown(median(known)) if known else NONE
        lowest = _shown(worst(metric, [row[metric] for row in rows]))
        yield middle if len(rows) == 1 else f"{middle} ({lowest})"


def _shown(value: object) -> str:
    if value is None:
        return NONE
    return f"{value:.3g}" if isinstance(value, float) else str(value)
