"""Loads a scenario from a file or a mapping, and writes it as YAML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from formation_scenario.describe import problems_of
from formation_scenario.errors import Problem, ScenarioError
from formation_scenario.feasibility import check
from formation_scenario.gains import AUTO, designed
from formation_scenario.model import Scenario
from formation_scenario.overrides import OPTION, apply_overrides
from formation_scenario.resolve import resolve
from formation_scenario.rules import inconsistencies
from formation_scenario.source import Dumper, Key, Plain, Source, plain_mapping, read_file
from formation_scenario.vehicle_file import with_models
from formation_scenario.vehicles import VehicleGroup

ONE_VEHICLE: dict[Key, Plain] = {"id": 1, "role": "leader"}


def load_scenario(
    source: str | Path | Mapping[Any, Any] | Scenario, overrides: Sequence[str] = (), option: str = OPTION
) -> Scenario:
    """Return a scenario, validated, with every default filled in.

    Args:
        source: a YAML file, the mapping that it would hold, or a scenario.
        overrides: `dotted.key=value` settings, the values in YAML.
        option: what stands before an override in messages; "" where it was no command's option.

    Raises:
        ScenarioError: the scenario can't be read, has values that aren't allowed, contradicts itself or can't be flown.
    """
    read = with_models(apply_overrides(_read(source), overrides, option))
    scenario, resolved = _typed(read)
    if scenario.law.gains == AUTO:
        scenario = designed(scenario, read.data.get("law"))
    problems = inconsistencies(scenario, resolved) or check(scenario, resolved)
    if problems:
        raise ScenarioError(problems)
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML; loading it gives an equal scenario."""
    return yaml.dump(
        _plain(scenario),
        Dumper=Dumper,
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=None,
        width=110,
    )


def _read(source: str | Path | Mapping[Any, Any] | Scenario) -> Source:
    if isinstance(source, Scenario):
        return Source(None, _plain(source))
    return Source(None, plain_mapping(source)) if isinstance(source, Mapping) else read_file(Path(source))


def _plain(scenario: Scenario) -> dict[Key, Plain]:
    return plain_mapping(scenario.model_dump(by_alias=True, exclude_none=True))


def _typed(source: Source) -> tuple[Scenario, Source]:
    problems = _group_problems(source)
    if problems:
        # Check the rest as well, with a valid list in place of the group.
        data = dict(source.data)
        data["vehicles"] = [dict(ONE_VEHICLE)]
        source = Source(source.file, data, source.places)
    resolved = resolve(source)
    try:
        scenario = Scenario.model_validate(resolved.data)
    except ValidationError as error:
        scenario = None
        problems = [*problems, *problems_of(error, Scenario, resolved)]
    if problems or scenario is None:
        raise ScenarioError(list(dict.fromkeys(problems)))
    return scenario, resolved


def _group_problems(source: Source) -> list[Problem]:
    group = source.data.get("vehicles")
    if not isinstance(group, dict):
        return []
    try:
        VehicleGroup.model_validate(group)
    except ValidationError as error:
        return problems_of(error, VehicleGroup, source, ("vehicles",))
    return []
