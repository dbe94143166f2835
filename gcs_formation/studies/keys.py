"""Keys of a study file, and loading them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from formation_scenario import Problem, ScenarioError
from formation_scenario.describe import problems_of
from formation_scenario.errors import did_you_mean
from formation_scenario.expectation import METRICS
from formation_scenario.fields import Allowed, Fraction, Keys, Name, NonNegative, Number, Positive
from formation_scenario.resolve import standalone, with_absolute_files
from formation_scenario.source import Plain, Source, dotted, plain_mapping, read_file
from gcs_formation.app.options import Record

MOST_VALUES = 10_000
INVARIANTS = "broken_invariants"
"""How many of the invariants of `gcs-formation stress` a flight broke."""
FIGURES = (*METRICS, INVARIANTS)
"""What can be measured of a flight of a study."""
Value: TypeAlias = Any
"""Any value that YAML has."""


def _known_figure(value: object) -> object:
    if value not in FIGURES:
        raise PydanticCustomError("metric", "unknown metric")
    return value


Metric = Annotated[
    str,
    BeforeValidator(_known_figure),
    WithJsonSchema({"type": "string", "enum": list(FIGURES)}),
    Allowed(", ".join(FIGURES), FIGURES),
]


class Range(Keys):
    """Evenly spaced values, both ends included."""

    range: Annotated[
        tuple[Number, Number, Annotated[int, Field(ge=1, le=MOST_VALUES)]], Allowed("[first, last, how many]")
    ] = Field(description="first, last, how many", examples=[[0, 500, 6]])


class Uniform(Keys):
    """A uniform distribution."""

    uniform: Annotated[tuple[Number, Number], Allowed("[least, most]")] = Field(description="least, most")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        return _rising(self, *self.uniform)


class Normal(Keys):
    """A normal distribution."""

    normal: Annotated[tuple[Number, Positive], Allowed("[mean, standard deviation > 0]")] = Field(
        description="mean, standard deviation"
    )


class LogUniform(Keys):
    """A distribution whose logarithm is uniform."""

    log_uniform: Annotated[tuple[Positive, Positive], Allowed("[least > 0, most]")] = Field(description="least, most")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        return _rising(self, *self.log_uniform)


class Cases(Keys):
    """Values that aren't numbers, or of several keys at once, by names that say what they are."""

    cases: Annotated[
        dict[str, dict[str, Any]], Field(min_length=1), Allowed("names, each with a mapping of dotted keys to values")
    ] = Field(
        description="name of each -> the scenario's keys that it sets",
        examples=[{"5 % loss": {"links.default.loss": 0.05}}],
    )


Distribution = Uniform | Normal | LogUniform
Values = Annotated[list[Any], Field(min_length=1, max_length=MOST_VALUES)]
Parameter = Annotated[
    Values | Range | Uniform | Normal | LogUniform | Cases,
    Allowed(
        f"a list of 1 to {MOST_VALUES:,} values, {{range: [first, last, how many: 1 or more]}}, "
        "{uniform: [least, most: more than that]}, {normal: [mean, sigma: more than 0]}, "
        "{log_uniform: [least: more than 0, most: more than that]} or {cases: {name: {dotted.key: value}}}"
    ),
]


class Seeds(Keys):
    """The seeds with which every sample is flown."""

    first: Annotated[int, Field(strict=True, ge=0, le=2**62)] = Field(default=1, description="the first seed")
    count: Annotated[int, Field(strict=True, ge=1, le=10**6)] = Field(
        default=1, description="how many, one after another"
    )


class Wanted(Keys):
    """A bound that a share of the flights must keep."""

    metric: Metric = Field(description="a figure of the flights")
    below: Number | None = Field(default=None, description="it must be smaller")
    above: Number | None = Field(default=None, description="it must be larger")
    share: Fraction = Field(default=1.0, description="of the flights, at least")
    confidence: Annotated[Fraction, Field(gt=0.0, lt=1.0)] = Field(
        default=0.95, description="of the interval that is stated for the share (Clopper and Pearson)"
    )
    where: dict[str, Any] = Field(default={}, description="only flights whose parameters have these values")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        return _one_bound(self, self.below, self.above)


class Bisection(Keys):
    """Searches the value of a parameter at which a figure crosses its bound, for every sample and seed."""

    parameter: str = Field(description="a dotted key of the scenario, whose value is a number")
    low: Number = Field(description="a value at which the bound should be kept")
    high: Number = Field(description="a value at which it should be broken")
    tolerance: Positive = Field(description="how near the two ends come to each other")
    metric: Metric = Field(description="a figure of the flights")
    below: Number | None = Field(default=None, description="it is kept while it is smaller")
    above: Number | None = Field(default=None, description="it is kept while it is larger")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        _rising(self, self.low, self.high)
        return _one_bound(self, self.below, self.above)

    @property
    def most_flights(self) -> int:
        """The flights that a search takes at most."""
        return 2 + max(0, math.ceil(math.log2((self.high - self.low) / self.tolerance)))


class Study(Keys):
    """Many flights of one scenario."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = Field(default="study", description="name of the study; the file's by default")
    base: Annotated[str | dict[str, Any], Allowed("a scenario's file, relative to the study's, or its keys")] = Field(
        default={}, description="the scenario: a file, relative to the study's, or its keys"
    )
    random: Literal["usual", "hard"] | None = Field(
        default=None,
        description="instead of `base`: every flight's scenario is drawn from its seed, as `gcs-formation stress` and "
        "`stress --hard` do",
    )
    set: dict[str, Any] = Field(default={}, description="keys of the scenario that all flights have, as --set")
    parameters: Annotated[Mapping[str, Parameter], Allowed("a mapping of dotted keys to values")] = Field(
        default={}, description="dotted keys of the scenario, or names of `cases`, and their values"
    )
    design: Literal["grid", "one_at_a_time", "random", "latin_hypercube", "sobol"] = Field(
        default="grid",
        description="grid: every combination; one_at_a_time: the first value of each, and each varied alone; "
        "random, latin_hypercube, sobol: `samples` points (scipy.stats.qmc)",
    )
    samples: Annotated[int, Field(strict=True, ge=1, le=10**7)] = Field(default=100, description="for the last three")
    seeds: Seeds = Seeds()
    metrics: Annotated[tuple[Metric, ...], Field(min_length=1)] = Field(
        default=("error_x_m.rms", "error_y_m.rms", "error_z_m.rms", "min_separation_m", "settled_at_s"),
        description="figures of each flight, as in the scenario's `expect`; of several vehicles the worst",
    )
    from_s: NonNegative | None = Field(default=None, description="metrics count from this mission time on, s")
    to_s: Positive | None = Field(default=None, description="… to this one, s; the flight's end by default")
    record: Record = Field(default="summary", description="what is kept of each flight")
    until_s: Positive | None = Field(default=None, description="end every flight at this mission time")
    bisect: Bisection | None = Field(default=None, description="search a bound's crossing instead of flying each once")
    expect: tuple[Wanted, ...] = Field(default=(), description="exit status 1 if one is broken")

    @model_validator(mode="after")
    def _window(self) -> Self:
        if self.from_s is not None and self.to_s is not None:
            _rising(self, self.from_s, self.to_s)
        return self

    @property
    def cases(self) -> dict[str, dict[str, dict[str, Any]]]:
        """What each case of a parameter sets, by the parameter's name and the case's."""
        return {name: each.cases for name, each in self.parameters.items() if isinstance(each, Cases)}

    @property
    def measured(self) -> tuple[str, ...]:
        """All figures that are taken of each flight."""
        others = [each.metric for each in self.expect] + ([self.bisect.metric] if self.bisect else [])
        return tuple(dict.fromkeys([*self.metrics, *others]))


def study_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a study file."""
    generated = Study.model_json_schema(by_alias=True)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **generated,
        "title": "Study of formation flights",
    }


def load_study(source: Path | Mapping[str, Any]) -> tuple[Study, Source]:
    """Return a study, and what it was read from; files that its keys name are as absolute paths.

    Raises:
        ScenarioError: it can't be read, or has values that aren't allowed.
    """
    if isinstance(source, Mapping):
        read = Source(None, plain_mapping(source))
    else:
        read = read_file(source)
        read.data.setdefault("name", source.stem)
    try:
        study = Study.model_validate(read.data)
    except ValidationError as error:
        raise ScenarioError(_problems(error, read)) from error
    if (study.random is None) == (not study.base):
        found = "found `random` beside it" if study.random else "not found"
        raise ScenarioError([read.problem(("base",), found, "a scenario's file or its keys, or `random` instead")])
    if wrong := list(_nowhere(study, read)):
        raise ScenarioError(wrong)
    home = Path(read.file).parent if read.file else Path()
    return study.model_copy(update=_with_absolute_files(study, home)), read


def _nowhere(study: Study, read: Source) -> Iterator[Problem]:
    """Yield what an expectation asks of flights that there are none of."""
    known = {name: levels for name, each in study.parameters.items() if (levels := levels_of(each))}
    searched = [study.bisect.parameter] if study.bisect else []
    for i, wanted in enumerate(study.expect):
        for name, value in wanted.where.items():
            names = [*study.parameters, *searched]
            if name not in names:
                allowed = f"a parameter of the study: {', '.join(names)}{did_you_mean(name, names)}"
                yield read.problem(("expect", i, "where"), f"found '{name}'", allowed)
            elif name in known and value not in known[name]:
                found, allowed = f"found {name} = {value}", f"one that is flown: {', '.join(map(str, known[name]))}"
                yield read.problem(("expect", i, "where"), found, allowed)


LISTED = (list, Range, Cases)
"""The kinds of parameters that have levels, which aren't drawn."""


def levels_of(parameter: Parameter) -> Sequence[Value] | None:
    """Return a parameter's values, None for a distribution."""
    match parameter:
        case Range(range=(first, last, count)):
            levels: list[float] = np.linspace(first, last, count).tolist()
            whole = all(level.is_integer() for level in levels)  # for keys that count something
            return [int(level) for level in levels] if whole else levels
        case Cases(cases=cases):
            return list(cases)
        case list():
            return parameter
        case _:
            return None


def _with_absolute_files(study: Study, home: Path) -> dict[str, Any]:
    """Return `set` and `parameters` with the files that they name, relative to the study's own, as absolute paths."""

    def whole(keys: Mapping[str, Any]) -> dict[str, Any]:
        return {name: with_absolute_files(name, value, home) for name, value in keys.items()}

    def anywhere(name: str, each: Parameter) -> Parameter:
        if isinstance(each, Cases):
            return Cases(cases={case: whole(keys) for case, keys in each.cases.items()})
        return [with_absolute_files(name, value, home) for value in each] if isinstance(each, list) else each

    return {"set": whole(study.set), "parameters": {name: anywhere(name, p) for name, p in study.parameters.items()}}


def _problems(error: ValidationError, read: Source) -> list[Problem]:
    """Return what is wrong; of a parameter's value what is allowed, not what each kind of value lacks."""
    unbounded = [each["loc"] for each in error.errors() if each["type"] == "bound"]
    bounds = [read.problem(path, "found no bound", "below, above or both") for path in unbounded]
    keys = {dotted(path) for path in unbounded}
    others = problems_of(error, Study, read)
    return bounds + [each for each in others if each.allowed and each.key not in keys]


def base_keys(study: Study, read: Source) -> dict[Any, Plain]:
    """Return the keys of the study's scenario, with what they name in other files, relative to where they stand.

    Raises:
        ScenarioError: its file, or one that it names, can't be read.
    """
    if isinstance(study.base, str):
        home = Path(read.file).parent if read.file else Path()
        found = standalone(read_file(home / study.base)).data
        return {"name": Path(study.base).stem} | found
    return standalone(Source(read.file, plain_mapping(study.base))).data


def _rising(made: Any, low: float, high: float) -> Any:  # noqa: ANN401 - any of the groups
    if low >= high:
        raise PydanticCustomError("empty", "empty range")
    return made


def _one_bound(made: Any, below: float | None, above: float | None) -> Any:  # noqa: ANN401 - any of the groups
    if below is None and above is None:
        raise PydanticCustomError("bound", "no bound")
    return made


__all__ = [
    "INVARIANTS",
    "LISTED",
    "Bisection",
    "Cases",
    "Distribution",
    "Parameter",
    "Range",
    "Record",
    "Study",
    "Value",
    "Wanted",
    "base_keys",
    "levels_of",
    "load_study",
]
