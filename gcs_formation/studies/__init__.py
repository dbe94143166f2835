"""Keys of a study file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from formation_scenario.expectation import METRICS
from formation_scenario.fields import WHOLE, Allowed, Fraction, Keys, Name, NonNegative, Number, Open, Positive, key
from formation_scenario.registry import Registry
from gcs_formation.app.run_options import Record

MAX_VALUES = 10_000
INVARIANTS = "broken_invariants"
"""Number of invariants of `gcs-formation stress` that a flight broke."""
FIGURES = (*METRICS, INVARIANTS)
"""Figures that can be measured of a study's flight."""
Value: TypeAlias = Any
"""Any value that YAML has."""


Metric = Annotated[str, Open(", ".join(FIGURES), FIGURES)]


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] >= ends[1]:
        raise PydanticCustomError("empty", "empty range")
    return ends


Rising = AfterValidator(_rising)


class Range(Keys):
    """Evenly spaced values, both ends included."""

    range: Annotated[
        tuple[Number, Number, Annotated[int, Field(ge=1, le=MAX_VALUES)]], Allowed("[first, last, how many]")
    ] = key(..., "first, last, how many", [0, 500, 6])


class Uniform(Keys):
    """A uniform distribution."""

    uniform: Annotated[tuple[Number, Number], Rising, Allowed("[least, most]")] = key(..., "least, most")


class Normal(Keys):
    """A normal distribution."""

    normal: Annotated[tuple[Number, Positive], Allowed("[mean, standard deviation > 0]")] = key(
        ..., "mean, standard deviation"
    )


class LogUniform(Keys):
    """A distribution whose logarithm is uniform."""

    log_uniform: Annotated[tuple[Positive, Positive], Rising, Allowed("[least > 0, most]")] = key(..., "least, most")


class Cases(Keys):
    """Values that aren't numbers, or of several keys at once, by names that say what they are."""

    cases: Annotated[
        dict[str, dict[str, Any]], Field(min_length=1), Allowed("names, each with a mapping of dotted keys to values")
    ] = key(..., "name of each -> the scenario's keys that it sets", {"5 % loss": {"links.default.loss": 0.05}})


Values = Annotated[list[Any], Field(min_length=1, max_length=MAX_VALUES)]
Parameter = Annotated[
    Values | Range | Uniform | Normal | LogUniform | Cases,
    Allowed(
        f"a list of 1 to {MAX_VALUES:,} values, {{range: [first, last, how many: 1 or more]}}, "
        "{uniform: [least, most: more than that]}, {normal: [mean, sigma: more than 0]}, "
        "{log_uniform: [least: more than 0, most: more than that]} or {cases: {name: {dotted.key: value}}}"
    ),
]


class Seeds(Keys):
    """The seeds with which every sample is flown."""

    first: Annotated[int, Field(strict=True, ge=0, le=2**62), WHOLE, Allowed("a whole number from 0 to 2^62")] = key(
        1, "the first seed"
    )
    count: Annotated[int, Field(strict=True, ge=1, le=10**6), WHOLE] = key(1, "how many, one after another")


class Wanted(Keys):
    """A bound that a share of the flights must keep."""

    metric: Metric = key(..., "a figure of the flights")
    below: Number | None = key(None, "it must be smaller")
    above: Number | None = key(None, "it must be larger")
    share: Annotated[Fraction, Field(gt=0.0), Allowed("a number > 0 and <= 1")] = key(1.0, "of the flights, at least")
    confidence: Annotated[Fraction, Field(gt=0.0, lt=1.0), Allowed("a number > 0 and < 1")] = key(
        0.95, "of the interval that is stated for the share (docs/studies.md)"
    )
    where: dict[str, Any] = key({}, "only flights whose parameters have these values")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        return _one_bound(self, self.below, self.above)


class Bisection(Keys):
    """Searches the value of a parameter at which a figure crosses its bound, for every sample and seed."""

    parameter: str = key(..., "a dotted key of the scenario, whose value is a number")
    low: Number = key(..., "a value at which the bound should be kept")
    high: Number = key(..., "a value at which it should be broken")
    tolerance: Positive = key(..., "how near the two ends come to each other")
    metric: Metric = key(..., "a figure of the flights")
    below: Number | None = key(None, "it is kept while it is smaller")
    above: Number | None = key(None, "it is kept while it is larger")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if not self.low < self.high:
            raise PydanticCustomError("ends", "low isn't below high")
        return _one_bound(self, self.below, self.above)

    @property
    def max_flights(self) -> int:
        """The flights that a search takes at most."""
        return 2 + max(0, math.ceil(math.log2((self.high - self.low) / self.tolerance)))


DRAWN = ("random", "latin_hypercube", "sobol")
"""Designs that draw `samples` points."""


class Study(Keys):
    """Many flights of one scenario."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = key("study", "name of the study; the file's by default")
    base: Annotated[str | dict[str, Any], Allowed("a scenario's file, relative to the study's, or its keys")] = key(
        {}, "the scenario: a file, relative to the study's, or its keys"
    )
    random: Literal["usual", "hard", "telemetry"] | None = key(
        None,
        "instead of `base`: every flight's scenario is drawn from its seed, as `gcs-formation stress` and "
        "`stress --hard` do",
    )
    set: dict[str, Any] = key({}, "keys of the scenario that all flights have, as --set")
    parameters: Annotated[Mapping[str, Parameter], Allowed("a mapping of dotted keys to values")] = key(
        {}, "dotted keys of the scenario, or names of `cases`, and their values"
    )
    design: Literal["grid", "one_at_a_time", "random", "latin_hypercube", "sobol"] = key(
        "grid",
        "grid: every combination; one_at_a_time: the first value of each, and each varied alone; "
        "random, latin_hypercube, sobol: `samples` points (scipy.stats.qmc)",
    )
    samples: Annotated[int, Field(strict=True, ge=1, le=10**7), WHOLE] = key(
        100, "for the last three; a grid goes without"
    )
    seeds: Seeds = Seeds()
    metrics: Annotated[tuple[Metric, ...], Field(min_length=1), Allowed("a list of 1 or more figures")] = key(
        ("error_x_m.rms", "error_y_m.rms", "error_z_m.rms", "min_separation_m", "settled_at_s"),
        "figures of each flight, as in the scenario's `expect`; of several vehicles the worst",
    )
    from_s: NonNegative | None = key(None, "metrics count from this mission time on, s")
    to_s: Positive | None = key(None, "… to this one, s; the flight's end by default")
    record: Record = key("summary", "what is kept of each flight")
    until_s: Positive | None = key(None, "end every flight at this mission time")
    bisect: Bisection | None = key(None, "search a bound's crossing instead of flying each once")
    expect: tuple[Wanted, ...] = key((), "exit status 1 if one is broken")
    _registered: Registry = PrivateAttr(default_factory=Registry)
    _files: tuple[Path, ...] = PrivateAttr(default=())

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that its flights read, as absolute paths: delays, terrain, aircraft, missions."""
        return self._files

    def with_files(self, files: Iterable[Path]) -> Self:
        """Return the study with the files that its flights were found to read."""
        copied = self.model_copy()
        copied._files = tuple(sorted(each for each in files if each.is_file()))
        return copied

    @property
    def registered(self) -> Registry:
        """What the extensions that it was loaded with register, for its flights."""
        return self._registered

    def with_registered(self, registry: Registry) -> Self:
        """Return the study with other extensions."""
        copied = self.model_copy()
        copied._registered = registry
        return copied

    @property
    def cases(self) -> dict[str, dict[str, dict[str, Any]]]:
        """The keys that each case sets, by the parameter's name and the case's name."""
        return {name: each.cases for name, each in self.parameters.items() if isinstance(each, Cases)}

    @property
    def windowed(self) -> bool:
        """Whether metrics are measured over a part of the flights only."""
        return self.from_s is not None or self.to_s is not None

    @property
    def measured(self) -> tuple[str, ...]:
        """All figures that are measured of each flight."""
        others = [each.metric for each in self.expect] + ([self.bisect.metric] if self.bisect else [])
        return tuple(dict.fromkeys([*self.metrics, *others]))

    @property
    def columns(self) -> list[str]:
        """The names of the parameters' columns."""
        return list(dict.fromkeys([*self.parameters, *([self.bisect.parameter] if self.bisect else [])]))

    @property
    def levels(self) -> dict[str, Sequence[Value]]:
        """The values of parameters that list them; parameters with distributions are left out."""
        found = {name: levels_of(each) for name, each in self.parameters.items()}
        return {name: levels for name, levels in found.items() if levels is not None}

    @property
    def flights_of_a_sample(self) -> int:
        """How many numbers of flights each sample takes: its seeds, and for each the steps of a search."""
        return self.seeds.count * (self.bisect.max_flights if self.bisect else 1)

    @property
    def draws(self) -> bool:
        """Whether parameters' values or scenarios are drawn, so that flights of a single seed are random too."""
        drawn = self.levels.keys() != self.parameters.keys()
        return drawn or self.design in DRAWN or self.random is not None


def study_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a study file."""
    generated = {**Study.model_json_schema(by_alias=True), "title": "Study of formation flights"}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **generated}


LISTED = (list, Range, Cases)
"""Types of parameters whose values are listed, not drawn."""


def levels_of(parameter: Parameter) -> Sequence[Value] | None:
    """Return a parameter's values; None for a distribution."""
    match parameter:
        case Range(range=(first, last, count)):
            levels: list[float] = np.linspace(first, last, count).tolist()
            whole = all(level.is_integer() for level in levels)  # whole numbers, for keys that count something
            return [int(level) for level in levels] if whole else levels
        case Cases(cases=cases):
            return list(cases)
        case list():
            return parameter
        case _:
            return None


def _one_bound(made: Any, below: float | None, above: float | None) -> Any:  # noqa: ANN401 - any of the groups
    if below is None and above is None:
        raise PydanticCustomError("bound", "no bound")
    return made
