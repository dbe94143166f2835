"""The flights of a study: samples of its parameters, and the next flight of a search."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.special import ndtri

from airlink.random_streams import random_stream
from flight_model.arrays import Array
from formation_scenario import expectation
from gcs_formation.studies import (
    DRAWN,
    Bisection,
    LogUniform,
    Normal,
    Parameter,
    Study,
    Uniform,
    Value,
    Wanted,
    levels_of,
)

Sample: TypeAlias = Mapping[str, Value]
INSIDE = 1e-12
"""Least distance of a share from 0 and 1, where a normal quantile is infinite."""
Row: TypeAlias = Mapping[str, Any]
"""The result of a flight: its columns in flights.parquet."""


def count_samples(study: Study) -> int:
    """Return the number of samples of a study, without making them."""
    sizes = [len(levels) for levels in study.levels.values()]
    match study.design:
        case "grid":
            return math.prod(sizes)
        case "one_at_a_time":
            return 1 + sum(size - 1 for size in sizes)
        case _:
            return study.samples


def samples(study: Study) -> list[Sample]:
    """Return the samples in order. A parameter with a distribution is left out if each flight draws its own value."""
    names, listed = list(study.parameters), study.levels
    match study.design:
        case "grid":
            return [dict(zip(listed, values, strict=True)) for values in product(*listed.values())]
        case "one_at_a_time":
            first = {name: levels[0] for name, levels in listed.items()}
            return [first, *({**first, name: value} for name, levels in listed.items() for value in levels[1:])]
        case _:
            return [
                {name: at(study.parameters[name], float(share)) for name, share in zip(names, row, strict=True)}
                for row in _shares(study, len(names))
            ]


def drawn(study: Study, flight: int) -> Sample:
    """Return the values that each flight draws by itself: distributions in designs of lists."""
    if study.design in DRAWN:
        return {}
    listed, random = study.levels, random_stream(study.seeds.first, "study", flight)
    return {name: at(each, float(random.random())) for name, each in study.parameters.items() if name not in listed}


def at(parameter: Parameter, share: float) -> Value:
    """Return a parameter's quantile at a share from 0 to 1 of its distribution or list."""
    match parameter:
        case Uniform(uniform=(low, high)):
            return low + (high - low) * share
        case LogUniform(log_uniform=(low, high)):
            return low * (high / low) ** share
        case Normal(normal=(mean, sigma)):
            return mean + sigma * float(ndtri(min(max(share, INSIDE), 1.0 - INSIDE)))
        case _:
            levels = levels_of(parameter) or [None]
            return levels[min(int(share * len(levels)), len(levels) - 1)]


def _shares(study: Study, dimensions: int) -> Array:
    """Return (samples, dimensions) points of the unit cube."""
    count, random = study.samples, random_stream(study.seeds.first, "design")
    if dimensions == 0:
        return np.zeros((count, 0))
    if study.design == "random":
        return random.random((count, dimensions))
    from scipy.stats import qmc  # noqa: PLC0415 - takes half a second to import

    match study.design:
        case "latin_hypercube":
            return qmc.LatinHypercube(dimensions, rng=random).random(count)
        case _:
            # The first 2^m points are balanced; a study of another size takes a part of them.
            return qmc.Sobol(dimensions, rng=random).random_base2(max(0, math.ceil(math.log2(count))))[:count]


class Planned(NamedTuple):
    """A flight to be flown."""

    flight: int
    seed: int
    parameters: Sample


class Crossing(NamedTuple):
    """The crossing of a search's bound."""

    kept: float | None
    """Largest value flown, below `broken`, at which the bound was kept; None if it is broken at the low end."""
    broken: float | None
    """Least value flown at which the bound was broken; None if it is kept up to the high end."""


class Plan:
    """A study's flights. Later flights of a search follow from the rows of its earlier ones, in any order."""

    def __init__(self, study: Study) -> None:
        """Number the flights: samples first, then seeds, then the largest possible number of flights of a search."""
        self.study = study
        self._samples = samples(study)
        self._each = study.bisect.max_flights if study.bisect else 1
        self._chains: dict[int, list[tuple[float, bool]]] = {}

    def first_flights(self) -> Iterator[Planned]:
        """Yield the flights that don't depend on other flights' results."""
        for chain in range(len(self._samples) * self.study.seeds.count):
            low = {self.study.bisect.parameter: self.study.bisect.low} if self.study.bisect else {}
            yield self._planned(chain * self._each, low)

    def after(self, row: Row) -> Planned | None:
        """Return the flight that follows from a flight's row; None if there is none."""
        search = self.study.bisect
        if search is None:
            return None
        chain, step = divmod(int(row["flight"]), self._each)
        flown = self._chains.setdefault(chain, [])
        flown.append((float(row[search.parameter]), keeps(search, row)))
        value = _next(search, flown)
        return None if value is None else self._planned(chain * self._each + step + 1, {search.parameter: value})

    def crossings(self) -> list[tuple[Planned, Crossing]]:
        """Return the crossing that each search found, with the first flight of the search."""
        search = self.study.bisect
        if search is None:
            return []
        return [(first, _crossing(self._chains.get(first.flight // self._each, []))) for first in self.first_flights()]

    def _planned(self, flight: int, searched: Sample) -> Planned:
        sample, seed = divmod(flight // self._each, self.study.seeds.count)
        mine = {**self._samples[sample], **drawn(self.study, flight // self._each), **searched}
        ordered = [name for name in (*self.study.parameters, *searched) if name in mine]
        return Planned(flight, self.study.seeds.first + seed, {name: mine[name] for name in ordered})


def count_flights(study: Study) -> int:
    """Return the largest possible number of a study's flights, without planning them."""
    return count_samples(study) * study.seeds.count * (study.bisect.max_flights if study.bisect else 1)


def keeps(bound: Any, row: Row) -> bool:  # noqa: ANN401 - whatever has a metric and bounds
    """Whether a flight kept a bound; False for one that couldn't go on or lacks the figure."""
    value = row.get(bound.metric)
    if row["exit"] not in (0, 1) or value is None:
        return False
    return expectation.keeps(value, bound.below, bound.above)


def seed_changes_nothing(study: Study, rows: Iterable[Row]) -> bool:
    """Whether flights with the same parameters but different seeds are identical to the last digit.

    One equal figure isn't enough: all may have kept a limit by different margins and still count the same.
    """
    found = dict[str, list[str | None]]()
    for row in rows:
        if row["exit"] <= 1:
            found.setdefault(repr([row.get(name) for name in study.columns]), []).append(row.get("digest"))
    repeated = study.seeds.count > 1 and any(len(each) > 1 for each in found.values())
    return repeated and all(each[0] is not None and len(set(each)) == 1 for each in found.values())


def concerns(wanted: Wanted, row: Row) -> bool:
    """Whether an expectation applies to a flight: the parameters have the values in its `where`."""
    return all(row.get(name) == value for name, value in wanted.where.items())


def is_number(cell: object) -> bool:
    """Return whether a cell of a row is a number."""
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def replayed(plan: Plan, rows: Iterable[Row]) -> list[Planned]:
    """Return the flights that are still to be flown, given the rows of those that have been."""
    done = {int(row["flight"]): row for row in rows}
    open_ones = list(plan.first_flights())
    left: list[Planned] = []
    while open_ones:
        planned = open_ones.pop()
        if planned.flight not in done:
            left.append(planned)
        elif (following := plan.after(done[planned.flight])) is not None:
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
