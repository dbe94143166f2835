"""A study's flights that came to an end as columns, and how a parameter's values lie on an axis."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, NullFormatter

from flight_model.arrays import Array
from gcs_formation.studies.keys import LISTED, LogUniform, Study
from gcs_formation.studies.plan import Row, columns_of
from gcs_formation.studies.preparation import DRAWN

LEVELS_UP_TO = 12
"""Different values up to which each is named; drawn ones beyond that are put into bins, and so many at most."""
LISTED_UP_TO = 40
"""Different values of a list up to which each is a level of its own."""
IN_A_BIN = 5
"""Flights that a bin should have at least, on average."""
WIDE = 30.0
"""Largest by median from which a scale is logarithmic."""
ROUND = (1.0, 2.0, 5.0)
"""What is written of each decade of a logarithmic axis."""
LABEL = 24
"""Characters of a name."""
IN_A_ROW = 24
"""Characters of all names that have room below an axis."""
Mask = npt.NDArray[np.bool_]


class Flights(NamedTuple):
    """A study's flights that came to an end, as columns."""

    study: Study
    parameters: Mapping[str, Array]
    """(N,) values of those that vary; of one that is no number, the place of its value among `levels`."""
    metrics: Mapping[str, Array]
    """(N,), NaN where a flight has none."""
    levels: Mapping[str, Sequence[str]] = MappingProxyType({})
    """The values of parameters that are no numbers, in words."""

    @property
    def by_chance(self) -> bool:
        """Whether chance is in the flights, by seeds or draws: else shares of them are the design's, and sure."""
        drawn = any(map(self.draws, self.study.parameters))
        return self.study.seeds.count > 1 or self.study.design in DRAWN or drawn

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
    for name in columns_of(study):
        values = [row.get(name) for row in ended]
        if not all(_is_number(value) for value in values):
            words = [str(value) for value in values]
            levels[name] = list(dict.fromkeys(words))
            values = [levels[name].index(word) for word in words]
        column = np.array(values, dtype=np.float64)
        if np.unique(column).size > 1:
            parameters[name] = column
    metrics = {name: np.array([row[name] for row in ended], dtype=np.float64) for name in study.measured}
    known = {name: values for name, values in metrics.items() if np.isfinite(values).any()}
    return Flights(study, parameters, known, levels)


def edges_of(flights: Flights, name: str, most: int) -> Array:
    """Return the borders of a parameter's levels, halfway between; of bins of as many each where they are drawn."""
    levels: Array = np.unique(flights.parameters[name])
    listed = isinstance(flights.study.parameters.get(name), LISTED)
    if flights.draws(name) or levels.size > (LISTED_UP_TO if listed else LEVELS_UP_TO):
        bins = int(np.clip(most, 2, LEVELS_UP_TO))
        return np.quantile(levels, np.linspace(0.0, 1.0, bins + 1))
    if levels.size == 1:
        return np.array([levels[0] - 0.5, levels[0] + 0.5])
    between = (levels[1:] + levels[:-1]) / 2.0
    return np.concatenate(([levels[0] - (between[0] - levels[0])], between, [levels[-1] + levels[-1] - between[-1]]))


def cells_of(values: Array, edges: Array) -> npt.NDArray[np.intp]:
    """Return the cell between edges in which each value lies."""
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def tick(flights: Flights, axis: Axis, name: str, *, below: bool) -> None:
    """Name a parameter at its axis, and its levels where there are few: upright below an axis with no room for them."""
    axis.set_label_text(name if len(name) <= LABEL or "." not in name else ".\n".join(name.rsplit(".", 1)))
    if isinstance(flights.study.parameters.get(name), LogUniform):
        (axis.axes.set_xscale if below else axis.axes.set_yscale)("log")
        axis.set_major_locator(LogLocator(subs=ROUND))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    levels = np.unique(flights.parameters[name])
    if levels.size <= LEVELS_UP_TO and not flights.draws(name):
        words = words_of(flights, name)
        axis.set_ticks(levels, labels=words, rotation=90 if below and is_crowded(words) else 0)


def words_of(flights: Flights, name: str) -> list[str]:
    """Return a parameter's values in words that aren't long."""
    levels: list[float] = np.unique(flights.parameters[name]).tolist()
    return [textwrap.shorten(flights.word(name, level), LABEL, placeholder=" …") for level in levels]


def is_crowded(words: Sequence[str]) -> bool:
    """Whether words have no room below an axis."""
    return max(map(len, words)) * len(words) > IN_A_ROW


def scale(axes: Axes, values: Array, which: str) -> None:
    """Make a scale logarithmic where a few values are far beyond the others."""
    if is_wide(values):
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")


def is_wide(values: Array) -> bool:
    """Whether the largest of some values is far beyond the others."""
    return bool(values.size and values.min() > 0.0 and values.max() > WIDE * np.median(values))


def _is_number(value: Any) -> bool:  # noqa: ANN401 - whatever a study has
    return isinstance(value, int | float) and not isinstance(value, bool)
