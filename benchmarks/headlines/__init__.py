"""Headline figures of the documents: each is the worst of at least ten held-out flights.

A `Case` draws its flights (path, instants, directions, seeds) from a generator seeded by its name, so that they are
none of the shipped scenarios' flights, and the same ones each time. The documents have its figures between comments,
`<!-- figure: NAME -->0.023<!-- /figure -->`, where the command writes them and the nightly tier compares them.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import gcs_formation
from benchmarks import flown
from formation_scenario.fields import ScenarioError

COUNT = 12
"""Flights of a case."""
MAX_DRAWS = 5
"""How many scenarios are drawn for each flight until one can be flown."""
ANY = 1e6
"""Bound of an expectation that is there for its figure."""


class Flight(NamedTuple):
    """A drawn flight: keys that differ from the case's scenario, and the window of mission time that is judged."""

    keys: Mapping[str, Any]
    from_s: float
    to_s: float


class Figure(NamedTuple):
    """One figure of each flight, of which the worst is stated."""

    of: str | Callable[[gcs_formation.Summary, Flight], float]
    """A metric of `expect`, of the worst follower over the flight's window; or a function."""
    digits: int = 3
    worst: Callable[..., float] = max


@dataclass(frozen=True)
class Case:
    """Flights that a document's headlines are the worst of."""

    name: str
    """The page and the case, `latency.step`."""
    base: Path | Mapping[str, Any]
    draw: Callable[[Random], Flight]
    figures: Mapping[str, Figure]
    count: int = COUNT

    def names(self) -> list[str]:
        """Return the names of the figures in the documents."""
        return [f"{self.name}.{figure}" for figure in self.figures]


@dataclass(frozen=True)
class Found:
    """A figure in all flights of its case."""

    name: str
    values: tuple[float, ...]
    figure: Figure

    @property
    def worst(self) -> float:
        """The worst of all flights; NaN if one couldn't be flown."""
        return math.nan if any(map(math.isnan, self.values)) else float(self.figure.worst(self.values))

    @property
    def text(self) -> str:
        """The worst as it's stated."""
        return f"{self.worst:.{self.figure.digits}f}"

    @property
    def tolerance(self) -> float:
        """How far a stated figure may be off: the flights' standard deviation, or one of its last digit."""
        spread = 0.0 if math.isnan(self.worst) else statistics.pstdev(self.values)
        return max(spread, 10.0**-self.figure.digits)

    def agrees(self, stated: str) -> bool:
        """Return whether a stated figure is that of the flights."""
        return abs(float(stated) - self.worst) <= self.tolerance * (1.0 + 1e-9)


def fly(case: Case, number: int) -> dict[str, float]:
    """Fly a case's flight of a number, from 0; return its figures.

    Raises:
        RuntimeError: none of the scenarios that were drawn can be flown, or a flight lacks a figure.
    """
    for attempt in range(MAX_DRAWS):
        flight = case.draw(Random(f"{case.name} {number} {attempt}"))
        try:
            return _figures(case, flight)
        except ScenarioError as error:
            refused = str(error)
    raise RuntimeError(f"{case.name}, flight {number}: none of {MAX_DRAWS} draws can be flown: {refused}")


def _figures(case: Case, flight: Flight) -> dict[str, float]:
    metrics = {figure.of for figure in case.figures.values() if isinstance(figure.of, str)}
    expect = [_expectation(metric, flight) for metric in sorted(metrics)]
    with flown(case.base, **{**flight.keys, "duration_s": flight.to_s, "expect": expect}) as summary:
        return {name: _value(figure, summary, flight) for name, figure in case.figures.items()}


def _expectation(metric: str, flight: Flight) -> dict[str, Any]:
    return {"metric": metric, "from_s": flight.from_s, "to_s": flight.to_s, "below": ANY}


def _value(figure: Figure, summary: gcs_formation.Summary, flight: Flight) -> float:
    if not isinstance(figure.of, str):
        return figure.of(summary, flight)
    values = [each.value for each in summary.verdicts if each.expectation.metric == figure.of]
    if not values or None in values:
        raise RuntimeError(f"{summary.run_dir}: found no {figure.of} from {flight.from_s:g} to {flight.to_s:g} s")
    return float(figure.worst(values))
