"""Loads a scenario from a file or a mapping, and writes it as YAML."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from flight_model.legs.detour import Detours
from flight_model.legs.turn import TurnLimits
from flight_model.path import PathError
from formation_scenario.derived_defaults import resolve, standalone, with_files
from formation_scenario.error_messages import problems_of
from formation_scenario.expectation import METRICS, WINDOWED
from formation_scenario.expectation_rules import expectations
from formation_scenario.extension_keys import with_extension_keys
from formation_scenario.feasibility import check
from formation_scenario.fields import MAX_NUMBER, Problem, ScenarioError, refused
from formation_scenario.gains import AUTO, designed
from formation_scenario.model import Scenario
from formation_scenario.overrides import OPTION, apply_overrides
from formation_scenario.planned_progress import path_end_s
from formation_scenario.registry import Files, Registry, load_extensions
from formation_scenario.rules import inconsistencies
from formation_scenario.run_in import run_in_inside_fence_s
from formation_scenario.source import (
    Dumper,
    Key,
    Plain,
    Source,
    plain_mapping,
    read_file,
)
from formation_scenario.vehicle_rules import key_files
from formation_scenario.vehicles import VehicleGroup
from formation_scenario.violations import Violation, reported

ONE_VEHICLE: dict[Key, Plain] = {"id": 1, "role": "leader"}

SCENARIO_ALONE, STUDY_ALONE = {"vehicles", "path"}, {"base", "random", "parameters"}
"""Keys of every scenario that no study has, and of studies that no scenario has."""


class UnflyableError(ScenarioError):
    """A scenario whose keys are right and that can't be flown: with it, as written and typed, and what can't be."""

    def __init__(
        self, problems: Sequence[Problem], source: Source, scenario: Scenario, violations: list[Violation]
    ) -> None:
        super().__init__(problems)
        self.source, self.scenario, self.violations = source, scenario, violations


def load_scenario(
    source: str | Path | Mapping[Any, Any] | Scenario,
    overrides: Sequence[str] = (),
    option: str = OPTION,
    *,
    flown: bool = False,
    plugins: Files | Registry = (),
) -> Scenario:
    """Return a scenario, validated, with every default filled in.

    Args:
        source: a YAML file, the mapping that it would hold, or a scenario.
        overrides: `dotted.key=value` settings, the values in YAML.
        option: prefix of overrides in messages; "" if they aren't a command's options.
        flown: whether it has been flown already, so that feasibility and expectations aren't checked.
        plugins: files whose extensions it may use, beside those of installed packages; a scenario has its own already.

    Raises:
        ScenarioError: the scenario can't be read, has values that aren't allowed, contradicts itself or can't be
            flown (UnflyableError).
    """
    registry = source.registered if isinstance(source, Scenario) and not plugins else load_extensions(plugins)
    read = with_files(apply_overrides(_read(source), overrides, option), registry)
    scenario, resolved = to_the_paths_end(read, registry)
    found = inconsistencies(scenario)
    if scenario.law.gains == AUTO and not found:
        scenario = designed(scenario, read.data.get("law"))
    violations = [] if found or flown else check(scenario)
    found += [] if flown else [*expectations(scenario), *key_files(scenario)]
    problems = [resolved.problem(*each) for each in (*reported(violations), *((*one, "") for one in found))]
    if violations:
        raise UnflyableError(problems, read, scenario, violations)
    if problems:
        raise ScenarioError(problems)
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML; loading it gives an equal scenario."""
    return yaml.dump(
        _plain(scenario), Dumper=Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def _read(source: str | Path | Mapping[Any, Any] | Scenario) -> Source:
    if isinstance(source, Scenario):
        return Source(None, _plain(source))
    if isinstance(source, Mapping):
        return Source(None, plain_mapping(source))
    if not isinstance(source, str | Path):
        raise refused("", f"found {source!r}", "a file, a mapping of its keys, or a Scenario", "scenario")
    read = read_file(Path(source))
    if STUDY_ALONE & read.data.keys() and not SCENARIO_ALONE & read.data.keys():
        flies = f"gcs-formation study {shlex.quote(str(source))} --out DIR flies it"
        raise refused("", "found a study", f"a scenario (`vehicles`, `path`); {flies}", str(source))
    return read


def _plain(scenario: Scenario) -> dict[Key, Plain]:
    dumped = scenario.model_dump(by_alias=True, exclude_none=True)
    for group, name in ((dumped, "extensions"), (dumped["law"], "parameters")):
        if not group[name]:
            del group[name]  # so that the keys of a scenario without extensions are the same as ever
    for entry in dumped["expect"]:
        if entry["metric"] in METRICS and entry["metric"] not in WINDOWED and entry["to_s"] == scenario.duration_s:
            del entry["to_s"]  # so that it follows duration_s when that is changed
    return plain_mapping(dumped)


def read_scenario(source: str | Path | Mapping[Any, Any], overrides: Sequence[str], registry: Registry) -> Source:
    """Return a scenario's keys as written, with the files that they name read, and with overrides.

    Raises:
        ScenarioError: a file that can't be read, or an override that doesn't fit.
    """
    return standalone(apply_overrides(_read(source), overrides, OPTION), registry)


def to_the_paths_end(
    source: Source, registry: Registry, detours: dict[TurnLimits, Detours] | None = None
) -> tuple[Scenario, Source]:
    """Return the typed scenario, with what follows from its path where the source doesn't give it.

    Its run-in stays inside the fence, and it ends with its path, to a millisecond.

    `detours`: those that were found for scenarios like it, to which its path adds its own.

    Raises:
        ScenarioError: values that aren't allowed.
    """
    scenario, resolved = _typed(source, registry)
    scenario = scenario if detours is None else scenario.sharing(detours)
    return _to_the_paths_end(*_inside_the_fence(source, scenario, resolved))


def _inside_the_fence(source: Source, scenario: Scenario, resolved: Source) -> tuple[Source, Scenario, Source]:
    """Return a source and its scenario with a run-in that stays inside the fence, if the source gives no `run_in_s`."""
    start = source.data.get("start")
    start = start if isinstance(start, dict) else {}
    if start.get("run_in_s") is not None:
        return source, scenario, resolved
    try:
        longest_s = run_in_inside_fence_s(scenario, scenario.written_path)
    except (PathError, OverflowError):
        return source, scenario, resolved
    if longest_s is None:
        return source, scenario, resolved
    shorter = replace(source, data=source.data | {"start": start | {"run_in_s": longest_s}})
    return shorter, *_on_same_path(shorter, scenario)


def _to_the_paths_end(source: Source, scenario: Scenario, resolved: Source) -> tuple[Scenario, Source]:
    """Return a scenario that ends with its path, to a millisecond, if the source gives no `duration_s`."""
    if source.data.get("duration_s") is not None:
        return scenario, resolved
    try:
        end_s = math.floor(1e3 * path_end_s(scenario) + 1e-6) / 1e3
    except (PathError, OverflowError):  # no such path, or a wind that blows the leader back: the checks say so
        return scenario, resolved
    if not 0.0 < end_s <= MAX_NUMBER:
        return scenario, resolved
    return _on_same_path(replace(source, data=source.data | {"duration_s": end_s}), scenario)


def _on_same_path(source: Source, scenario: Scenario) -> tuple[Scenario, Source]:
    """Return a source typed again that differs from a scenario's in what its path doesn't depend on."""
    typed, resolved = _typed(source, scenario.registered)
    return typed.sharing(scenario.detours).with_path_of(scenario), resolved


def _typed(source: Source, registry: Registry) -> tuple[Scenario, Source]:
    problems, group = list[Problem](), source.data.get("vehicles")
    try:
        if isinstance(group, dict):
            VehicleGroup.model_validate(group)
    except ValidationError as error:
        problems = problems_of(error, VehicleGroup, source, ("vehicles",))
        # Check the rest as well, with a valid list in place of the group.
        source = replace(source, data=source.data | {"vehicles": [dict(ONE_VEHICLE)]})
    (resolved, found), scenario = with_extension_keys(resolve(source), registry), None
    problems += found
    try:
        scenario = Scenario.model_validate(resolved.data).with_registered(registry)
    except ValidationError as error:
        problems += problems_of(error, Scenario, resolved)
    if problems or scenario is None:
        raise ScenarioError(list(dict.fromkeys(problems)))
    return scenario, resolved
