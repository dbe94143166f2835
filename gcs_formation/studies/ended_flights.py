"""A study's flights that came to an end, as columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from gcs_formation.studies import LISTED, Study, Wanted
from gcs_formation.studies.intervals import Chance, Unit, clusters_of
from gcs_formation.studies.plan import Row, concerns, is_number

NO_CLUSTERS = np.zeros(0)


class Flights(NamedTuple):
    """A study's flights that came to an end, as columns."""

    study: Study
    parameters: Mapping[str, Array]
    """(N,) values of parameters that vary; for one that isn't a number, indices into its `levels`."""
    metrics: Mapping[str, Array]
    """(N,), NaN where a flight has no value."""
    levels: Mapping[str, Sequence[str]] = MappingProxyType({})
    """Values of parameters that aren't numbers, in words."""
    concerned: Mapping[int, Mask] = MappingProxyType({})
    """(N,) which flights an expectation with `where` applies to, by the expectation's index in the study; one without
    applies to all, and isn't here."""
    clusters: Array = NO_CLUSTERS
    """(N,) the number of the cluster that each flight is in; empty: each is a cluster of its own."""
    chance: Chance = Chance(Unit.FLIGHT)
    """What is random in the flights; if nothing is, shares of them are exact."""

    def wanted(self, metric: str, inside: Mask | None = None) -> list[Wanted]:
        """Return the study's expectations of a figure that apply to exactly these flights, by default to all."""

        def applies(own: Mask | None) -> bool:
            if inside is None:
                return own is None or bool(own.all())
            return own is not None and np.array_equal(own, inside)

        numbered = enumerate(self.study.expect)
        return [each for i, each in numbered if each.metric == metric and applies(self.concerned.get(i))]

    def clusters_within(self, inside: Mask) -> Array:
        """Return the clusters of some flights."""
        return self.clusters[inside] if self.clusters.size else NO_CLUSTERS

    def draws(self, name: str) -> bool:
        """Return whether a parameter's values are drawn from a distribution."""
        return not isinstance(self.study.parameters.get(name, []), LISTED)

    def groups(self, name: str) -> dict[str, Mask]:
        """Return which flights have each value of a parameter, by the value in words."""
        values = self.parameters[name]
        return {self.word(name, level): values == level for level in np.unique(values).tolist()}

    def word(self, name: str, level: float) -> str:
        """Return a parameter's value in words."""
        return self.levels[name][int(level)] if name in self.levels else f"{level:g}"


def flights_of(study: Study, rows: Iterable[Row]) -> Flights:
    """Return the rows of the flights that came to an end."""
    ended = [row for row in rows if row["exit"] <= 1]
    parameters, levels = dict[str, Array](), dict[str, Sequence[str]]()
    for name in study.columns:
        values = [row.get(name) for row in ended]
        if not all(is_number(value) for value in values):
            words = [str(value) for value in values]
            levels[name] = list(dict.fromkeys(words))
            values = [levels[name].index(word) for word in words]
        column = np.array(values, dtype=np.float64)
        if np.unique(column).size > 1:
            parameters[name] = column
    metrics = {name: np.array([row[name] for row in ended], dtype=np.float64) for name in study.measured}
    known = {name: values for name, values in metrics.items() if np.isfinite(values).any()}
    some = {index: each for index, each in enumerate(study.expect) if each.where}
    concerned = {index: np.array([concerns(each, row) for row in ended]) for index, each in some.items()}
    return Flights(study, parameters, known, levels, concerned, clusters_of(study, ended), Chance.of(study, ended))
