"""Which flights a study consists of; in a search, which comes next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

from gcs_formation.studies.design import Sample, count_samples, drawn, samples
from gcs_formation.studies.keys import Bisection, Study

Row: TypeAlias = Mapping[str, Any]
"""What came of a flight: its columns in flights.parquet."""


class Planned(NamedTuple):
    """A flight to be flown."""

    flight: int
    seed: int
    parameters: Sample


class Crossing(NamedTuple):
    """Where a search found that its bound is crossed."""

    kept: float | None
    """The largest value flown at which it was kept, from the low end up; None if it is broken there."""
    broken: float | None
    """The least value flown at which it was broken; None if it is kept up to the high end."""


@dataclass
class Plan:
    """A study's flights. A search's further flights follow from the rows of its earlier ones, in whatever order."""

    study: Study
    _chains: dict[int, list[tuple[float, bool]]] = field(default_factory=dict[int, list[tuple[float, bool]]])

    def __post_init__(self) -> None:
        """Number the flights: sample by sample, each with every seed, a search in as many as it takes at most."""
        self._samples = samples(self.study)
        self._each = self.study.bisect.most_flights if self.study.bisect else 1

    def begin(self) -> Iterator[Planned]:
        """Yield the flights that need no other's result."""
        for chain in range(len(self._samples) * self.study.seeds.count):
            low = {self.study.bisect.parameter: self.study.bisect.low} if self.study.bisect else {}
            yield self._planned(chain * self._each, low)

    def after(self, row: Row) -> Planned | None:
        """Return the flight that follows from a flight's row, None where there is none."""
        search = self.study.bisect
        if search is None:
            return None
        chain, step = divmod(int(row["flight"]), self._each)
        flown = self._chains.setdefault(chain, [])
        flown.append((float(row[search.parameter]), keeps(search, row)))
        value = _next(search, flown)
        return None if value is None else self._planned(chain * self._each + step + 1, {search.parameter: value})

    def crossings(self) -> list[tuple[Planned, Crossing]]:
        """Return where each search found its bound crossed, with the first flight of the search."""
        search = self.study.bisect
        if search is None:
            return []
        return [(first, _crossing(self._chains.get(first.flight // self._each, []))) for first in self.begin()]

    def _planned(self, flight: int, searched: Sample) -> Planned:
        sample, seed = divmod(flight // self._each, self.study.seeds.count)
        mine = {**self._samples[sample], **drawn(self.study, flight // self._each), **searched}
        ordered = [name for name in (*self.study.parameters, *searched) if name in mine]
        return Planned(flight, self.study.seeds.first + seed, {name: mine[name] for name in ordered})


def count_flights(study: Study) -> int:
    """Return how many flights a study has, at most, without planning them."""
    return count_samples(study) * study.seeds.count * (study.bisect.most_flights if study.bisect else 1)


def keeps(bound: Any, row: Row) -> bool:  # noqa: ANN401 - whatever has a metric and bounds
    """Whether a flight kept a bound; one that couldn't go on, or without the figure, didn't."""
    value = row.get(bound.metric)
    if row["exit"] not in (0, 1) or value is None:
        return False
    return (bound.below is None or value < bound.below) and (bound.above is None or value > bound.above)


def columns_of(study: Study) -> list[str]:
    """Return the names of the parameters' columns."""
    searched = [study.bisect.parameter] if study.bisect else []
    return list(dict.fromkeys([*study.parameters, *searched]))


def replayed(plan: Plan, rows: Iterable[Row]) -> list[Planned]:
    """Return the flights that are still to be flown when some have been."""
    done = {int(row["flight"]): row for row in rows}
    open_ones = list(plan.begin())
    left: list[Planned] = []
    while open_ones:
        planned = open_ones.pop()
        row = done.get(planned.flight)
        following = None if row is None else plan.after(row)
        if row is None:
            left.append(planned)
        elif following is not None:
            open_ones.append(following)
    return sorted(left)


def _next(search: Bisection, flown: list[tuple[float, bool]]) -> float | None:
    found = _crossing(flown)
    if len(flown) == 1:
        return search.high if found.kept is not None else None
    if found.kept is None or found.broken is None or found.broken - found.kept <= search.tolerance:
        return None
    return (found.kept + found.broken) / 2.0


def _crossing(flown: list[tuple[float, bool]]) -> Crossing:
    broken = min((value for value, kept in flown if not kept), default=None)
    below = [value for value, kept in flown if kept and (broken is None or value < broken)]
    return Crossing(max(below, default=None), broken)
