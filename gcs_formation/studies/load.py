"""Reading a study file: its keys, what they say together, and the scenario that it names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from formation_scenario import Problem, ScenarioError
from formation_scenario.describe import problems_of
from formation_scenario.errors import did_you_mean
from formation_scenario.resolve import standalone, with_absolute_files
from formation_scenario.source import Plain, Source, dotted, plain_mapping, read_file
from gcs_formation.studies.keys import Cases, Parameter, Study, levels_of

COLUMNS = ("flight", "seed", "exit", "wall_s", "cpu_s", "version", "words")
"""Of flights.parquet, beside parameters and metrics."""
DRAWN = ("random", "latin_hypercube", "sobol")
"""Designs of so many samples."""


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
    if wrong := [*_together(study, read), *_nowhere(study, read)]:
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


def _together(study: Study, read: Source) -> Iterator[Problem]:
    """Yield keys that can't be beside each other."""
    taken, search = {*COLUMNS, *study.measured}, study.bisect
    for name in study.parameters:
        if name in taken:
            allowed = "another name, as the table has a column of this one"
            yield read.problem(("parameters", name), f"found '{name}'", "seeds" if name == "seed" else allowed)
    if "seed" in study.set:
        yield read.problem(("set", "seed"), "found 'seed'", "seeds: {first: …, count: …}")
    if search is not None and search.parameter in study.parameters:
        allowed = "a parameter that isn't among `parameters`"
        yield read.problem(("bisect", "parameter"), f"found '{search.parameter}'", allowed)
    if "samples" in read.data and study.design not in DRAWN:
        yield read.problem(("samples",), f"found {study.samples} for design: {study.design}", f"for {', '.join(DRAWN)}")
    if study.from_s is not None and study.to_s is not None and study.from_s >= study.to_s:
        yield read.problem(("to_s",), f"found {study.from_s:g} to {study.to_s:g} s", "a time after from_s")


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
