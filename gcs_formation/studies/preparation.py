"""From a study's file to its tasks. Every value of a parameter is tried before the first flight."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations, islice
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from formation_scenario import Problem, ScenarioError
from formation_scenario.derived_defaults import standalone, with_absolute_files
from formation_scenario.error_messages import problems_of
from formation_scenario.expectation import pointless
from formation_scenario.extensions import METRIC
from formation_scenario.fields import did_you_mean, refused
from formation_scenario.load import SCENARIO_ALONE, STUDY_ALONE
from formation_scenario.named_files import files_read
from formation_scenario.registry import Files, Registry, load_extensions
from formation_scenario.source import KeyPath, Plain, Source, dotted, plain_mapping, read_file, show
from gcs_formation.studies import (
    DRAWN,
    FIGURES,
    LISTED,
    Bisection,
    Cases,
    Parameter,
    Range,
    Study,
    Value,
    Wanted,
    levels_of,
)
from gcs_formation.studies.dataset import ROW
from gcs_formation.studies.flight import Task
from gcs_formation.studies.plan import Planned, Sample, at, count_flights, samples

MANY = 100_000
"""Number of flights beyond which a study needs --yes."""
EXTREMES = (0.5, 0.0, 1.0 - 1e-9)
"""Quantiles of a distribution that are tried: its median and its ends."""
TRIED_WITH = 3
"""Number of drawn samples with which a value is tried that doesn't work with the others' first values."""
RULES = {
    "bound": ("found no bound", "below, above or both"),
    "ends": ("found a low that isn't below high", "a high that is more than low"),
}
"""For each rule between keys: what was found, and what is allowed."""


def load_study(source: Path | Mapping[str, Any], plugins: Files | Registry = ()) -> tuple[Study, Source]:
    """Return a study and the source it was read from; paths in `set` and `parameters` are made absolute.

    `plugins`: files of extensions that its flights name, or what they register.

    Raises:
        ScenarioError: it can't be read, or has values that aren't allowed.
    """
    if isinstance(source, Mapping):
        read = Source(None, plain_mapping(source))
    else:
        read = read_file(source, "study")
        if SCENARIO_ALONE & read.data.keys() and not STUDY_ALONE & read.data.keys():
            flies = f"gcs-formation run {shlex.quote(str(source))} flies it"
            raise refused("", "found a scenario", f"a study of it (`base`); {flies}", str(source))
        read.data.setdefault("name", source.stem)
    try:
        study = Study.model_validate(read.data).with_registered(load_extensions(plugins))
    except ValidationError as error:
        raise ScenarioError(_problems(error, read)) from error
    if (study.random is None) == (not study.base):
        found = "found `random` beside it" if study.random else "not found"
        raise ScenarioError([read.problem(("base",), found, "a scenario's file or its keys, or `random` instead")])
    if wrong := [
        *_unknown_metrics(study, read),
        *_conflicting_keys(study, read),
        *_replaced(study, read),
        *_unmet_conditions(study, read),
        *_impossible_bounds(study, read),
    ]:
        raise ScenarioError(wrong)
    home = Path(read.file).parent if read.file else Path()
    return study.model_copy(update=_with_absolute_files(study, home)), read


def _unmet_conditions(study: Study, read: Source) -> Iterator[Problem]:
    """Yield `where` conditions of expectations that no flight meets."""
    known, names = study.levels, [*study.parameters, *([study.bisect.parameter] if study.bisect else [])]
    for i, wanted in enumerate(study.expect):
        for name, value in wanted.where.items():
            if name not in names:
                allowed = f"a parameter of the study: {', '.join(names)}{did_you_mean(name, names)}"
                yield read.problem(("expect", i, "where"), f"found '{name}'", allowed)
            elif name in known and value not in known[name]:
                found, allowed = f"found {name} = {value}", f"one that is flown: {', '.join(map(str, known[name]))}"
                yield read.problem(("expect", i, "where"), found, allowed)


def _unknown_metrics(study: Study, read: Source) -> Iterator[Problem]:
    """Yield unknown figures."""
    known = [*FIGURES, *study.registered.names(METRIC)]
    named: list[tuple[KeyPath, str]] = [(("metrics", i), name) for i, name in enumerate(study.metrics)]
    named += [(("expect", i, "metric"), each.metric) for i, each in enumerate(study.expect)]
    named += [(("bisect", "metric"), study.bisect.metric)] if study.bisect else []
    for path, name in named:
        if name not in known:
            yield read.problem(path, f"found {show(name)}", f"{', '.join(known)}{did_you_mean(name, known)}")


def _impossible_bounds(study: Study, read: Source) -> Iterator[Problem]:
    """Yield bounds outside a figure's possible range."""
    bounded: list[tuple[KeyPath, Wanted | Bisection]] = [(("expect", i), each) for i, each in enumerate(study.expect)]
    bounded += [(("bisect",), study.bisect)] if study.bisect else []
    for path, each in bounded:
        for name, found, allowed in pointless(each.metric, each.below, each.above):
            yield read.problem((*path, name), found, allowed)


def _conflicting_keys(study: Study, read: Source) -> Iterator[Problem]:
    """Yield keys that exclude each other."""
    taken, search = {*ROW, "digest", *study.measured}, study.bisect
    for name in study.parameters:
        if name in taken:
            allowed = "another name, as a flight's row has this one"
            yield read.problem(("parameters", name), f"found '{name}'", "seeds" if name == "seed" else allowed)
    if "seed" in study.set:
        yield read.problem(("set", "seed"), "found 'seed'", "seeds: {first: …, count: …}")
    if search is not None and search.parameter in study.parameters:
        allowed = "a parameter that isn't among `parameters`"
        yield read.problem(("bisect", "parameter"), f"found '{search.parameter}'", allowed)
    if study.from_s is not None and study.to_s is not None and study.from_s >= study.to_s:
        yield read.problem(("to_s",), f"found {study.from_s:g} to {study.to_s:g} s", "a time after from_s")


def _replaced(study: Study, read: Source) -> Iterator[Problem]:
    """Yield parameters that replace keys set by `set` or by an earlier parameter, whose values would have no effect.

    Replacing a key of `set` is allowed to some cases of a parameter: flights of its other cases keep the value of
    `set`.
    """
    search, sets = study.bisect, list[tuple[str, KeyPath, set[str]]]()
    for name, each in study.parameters.items():
        own = {key for case in each.cases.values() for key in case} if isinstance(each, Cases) else {name}
        sets.append((name, ("parameters", name), own))
    if search is not None and search.parameter not in study.parameters:
        sets.append((search.parameter, ("bisect", "parameter"), {search.parameter}))
    each_case = [case for cases in study.cases.values() for case in cases.values()]
    sometimes = {key for case in each_case for key in case} - _always(study)
    sets.insert(0, ("set", ("set",), study.set.keys() - sometimes))
    for (earlier, _, before), (name, place, after) in combinations(sets, 2):
        gone = sorted(key for key in before if any(f"{key}.".startswith(f"{each}.") for each in after))
        if gone:
            found = f"found '{name}', which replaces {', '.join(gone)} of '{earlier}'"
            yield read.problem(place, found, "keys that none before it sets; what sets most of them stands first")


def _always(study: Study) -> set[str]:
    """Return the keys that a parameter or the search sets in every flight."""
    found = set(study.columns)
    for cases in study.cases.values():
        first, *others = cases.values()
        found |= {key for key in first if all(key in other for other in others)}
    return found


def _with_absolute_files(study: Study, home: Path) -> dict[str, Any]:
    """Return `set` and `parameters` with file names, which are relative to the study's file, as absolute paths."""

    def whole(keys: Mapping[str, Any]) -> dict[str, Any]:
        return {name: with_absolute_files(name, value, home) for name, value in keys.items()}

    def anywhere(name: str, each: Parameter) -> Parameter:
        if isinstance(each, Cases):
            return Cases(cases={case: whole(keys) for case, keys in each.cases.items()})
        return [with_absolute_files(name, value, home) for value in each] if isinstance(each, list) else each

    return {"set": whole(study.set), "parameters": {name: anywhere(name, p) for name, p in study.parameters.items()}}


def _problems(error: ValidationError, read: Source) -> list[Problem]:
    """Return the problems; for a parameter's value what is allowed, not what each type of value lacks."""
    unbounded = {each["loc"]: RULES[each["type"]] for each in error.errors() if each["type"] in RULES}
    bounds = [read.problem(path, found, allowed) for path, (found, allowed) in unbounded.items()]
    keys = {dotted(path) for path in unbounded}
    others = problems_of(error, Study, read)
    return bounds + [each for each in others if each.allowed and each.key not in keys]


def base_keys(study: Study, read: Source) -> dict[Any, Plain]:
    """Return the keys of the study's scenario, with the content of other files that it names.

    Raises:
        ScenarioError: its file, or one that it names, can't be read.
    """
    if isinstance(study.base, str):
        home = Path(read.file).parent if read.file else Path()
        try:
            scenario = read_file(home / study.base)
        except ScenarioError as error:
            raise ScenarioError([_of_base(problem, read) for problem in error.problems]) from error
        found = standalone(scenario).data
        return {"name": Path(study.base).stem} | found
    return standalone(Source(read.file, plain_mapping(study.base))).data


def _of_base(problem: Problem, read: Source) -> Problem:
    """Return a problem of the scenario's file; if it has no line there, with its location in the study's file."""
    if problem.line is not None:
        return problem
    return read.problem(("base",), f"{problem.file}: {problem.found}", problem.allowed or "a scenario's file")


def prepare(
    source: Path | Mapping[str, Any], *, many: bool = True, plugins: Files | Registry = ()
) -> tuple[Study, dict[Any, Plain]]:
    """Return a study and its scenario's keys, after trying the values of all parameters.

    Tried are all values of a list, all cases and the ends of a range, each with the first values of the others; for a
    distribution, whether any of it can be flown. `many`: more than `MANY` flights are allowed;
    `plugins`: files of extensions that the study names.

    Raises:
        ScenarioError: the study is wrong, a value of it can't be flown, or there are too many flights.
    """
    study, read = load_study(source, plugins)
    if not many and (count := count_flights(study)) > MANY:
        found, allowed = f"found {count:,} flights", f"up to {MANY:,}, or --yes if that many are meant"
        raise ScenarioError([Problem(read.file, None, None, "", found, allowed)])
    base = base_keys(study, read)
    trial = _Trial(study, base, read)
    with files_read() as files:
        if (wrong := trial.first_wrong()) is not None:
            raise wrong
        problems = list(_windows_after_the_end(study, read, trial))
        problems += [problem for each in trial.wrong_values() for problem in each.problems]
    if problems:
        raise ScenarioError(problems)
    return study.with_files(files), base


def refly_task(planned: Planned, study: Study, base: Mapping[Any, Plain], out: Path) -> Task:
    """Return a flight of a study as a task that keeps its whole record in `out`."""
    return Task(planned, study.model_copy(update={"record": "full"}), base, str(out))


class _Trial:
    """Resolves scenarios of a study without flying them, and places their problems in the study's file."""

    def __init__(self, study: Study, base: Mapping[Any, Plain], read: Source) -> None:
        self._study, self._base, self._read = study, base, read
        self._usual: Sample = {}
        search = [study.bisect] if study.bisect else []
        self._tried = {**study.parameters, **{each.parameter: [each.low, each.high] for each in search}}

    def first_wrong(self) -> ScenarioError | None:
        """Return the error with the first value of every parameter; None if there is none.

        Drawn parameters keep the scenario's own value; if that doesn't work, they get their median.
        """
        self._usual = {name: at(each, 0.0) for name, each in self._tried.items() if isinstance(each, LISTED)}
        drawn = {name: at(each, EXTREMES[0]) for name, each in self._tried.items() if name not in self._usual}
        if (wrong := self._wrong({})) is None:
            return None
        self._usual |= drawn
        return self._wrong({}) if drawn else wrong

    @property
    def end_s(self) -> float:
        """The latest end of the flights, for the parameters' first values."""
        planned = Planned(0, self._study.seeds.first, self._usual)
        duration_s = Task(planned, self._study, self._base).scenario().duration_s
        return min(duration_s, self._study.until_s or duration_s)

    def wrong_values(self) -> Iterator[ScenarioError]:
        """Yield, for each parameter, the error of its first value that can't be flown."""
        for name, parameter in self._tried.items():
            if isinstance(parameter, LISTED):
                problems = (self._wrong_level(name, value) for value in _distinct(parameter))
                yield from islice(filter(None, problems), 1)
            else:
                tried = [self._wrong({name: at(parameter, share)}) for share in EXTREMES]
                yield from [each for each in tried[:1] if each is not None and all(tried)]

    def _wrong_level(self, name: str, value: Value) -> ScenarioError | None:
        """Return why a value can be flown neither with the others' first values nor in the samples that have it."""
        wrong = self._wrong({name: value})
        if wrong is None or self._study.design not in DRAWN:
            return wrong
        drawn = islice((sample for sample in samples(self._study) if sample.get(name) == value), TRIED_WITH)
        return wrong if all(self._wrong(sample) for sample in drawn) else None

    def _wrong(self, sample: Sample) -> ScenarioError | None:
        """Return why flights with these values can't be flown; other parameters have their first values."""
        planned = Planned(0, self._study.seeds.first, {**self._usual, **sample})
        try:
            Task(planned, self._study, self._base).scenario()
        except ScenarioError as error:
            return ScenarioError([self._located(problem, sample) for problem in error.problems])
        return None

    def _located(self, problem: Problem, tried: Sample) -> Problem:
        """Return a scenario's problem with the location in the study's file of what set the wrong key.

        A problem in a key that the study doesn't set is attributed to the value that was tried.
        """
        study = self._study
        set_by: dict[str, KeyPath] = {name: ("set", name) for name in study.set}
        set_by |= dict.fromkeys(self._tried, ("bisect", "parameter"))
        set_by |= {name: ("parameters", name) for name in study.parameters}
        for name, cases in study.cases.items():
            case = {**self._usual, **tried}[name]
            set_by |= dict.fromkeys(cases[case], ("parameters", name, "cases", case))
        name = (problem.file or "").partition("=")[0]
        if name in set_by:
            return replace(problem, **self._read.position(set_by[name])._asdict())
        if not tried:
            return problem
        place = self._read.position(set_by[next(iter(tried))])
        with_it = ", ".join(f"{name} = {value}" for name, value in tried.items())
        return replace(problem, **place._asdict(), found=f"{problem.found} (with {with_it})")


def _windows_after_the_end(study: Study, read: Source, trial: _Trial) -> Iterator[Problem]:
    """Yield `from_s` and `to_s` beyond the end of the flights."""
    if study.random is not None or "duration_s" in study.parameters:
        return
    end_s = trial.end_s
    for name, allowed in (("from_s", "less than"), ("to_s", "up to")):
        found_s = getattr(study, name)
        if found_s is not None and (found_s > end_s or (name == "from_s" and found_s == end_s)):
            yield read.problem((name,), f"found {found_s:g} s", f"{allowed} {end_s:g} s, where flights end")


def _distinct(parameter: Parameter) -> list[Value]:
    """Return the distinct values of a list, or the ends of a range; values between the ends work if the ends do."""
    levels = levels_of(parameter) or []
    ends = [levels[0], levels[-1]] if isinstance(parameter, Range) else levels
    return list({repr(value): value for value in ends}.values())
