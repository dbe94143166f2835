"""Models of aircraft that extensions register, in place of their names."""

from __future__ import annotations

from pydantic import ValidationError

from formation_scenario.error_messages import problems_of
from formation_scenario.extension_keys import own_keys
from formation_scenario.extensions import AIRCRAFT, Registered
from formation_scenario.fields import Problem, ScenarioError, did_you_mean, refused
from formation_scenario.registry import HOW, Registry, missing
from formation_scenario.source import Key, KeyPath, Plain, Source, kind, plain_mapping, show
from formation_scenario.vehicles import VehicleModel


def with_own_aircraft(model: Plain, registry: Registry, at: Source, path: KeyPath) -> Plain:
    """Return a model with the keys of the aircraft that it names; its own come first.

    Args:
        model: as written, or the contents of a vehicle file.
        registry: what extensions register.
        at: the scenario, for the position of problems in its file.
        path: the model's.

    Raises:
        ScenarioError: no such aircraft, keys that it doesn't have, or a model that isn't allowed.
    """
    name = model.get("aircraft") if isinstance(model, dict) else None
    if not isinstance(model, dict) or not isinstance(name, str):
        return model
    entry, known = registry.get(name, AIRCRAFT), registry.names(AIRCRAFT)
    if entry is None:
        near = did_you_mean(name, known) or f"; an aircraft of one's own: {HOW}"
        allowed = f"{', '.join(known) or 'none'}{near}{missing(name, at.home)}"
        raise ScenarioError([at.problem((*path, "aircraft"), f"found {show(name)}", allowed)])
    problems = list[Problem]()
    parameters = own_keys(entry, model.get("parameters"), (*path, "parameters"), at, problems)
    if problems or not isinstance(parameters, dict):
        raise ScenarioError(problems)
    return _model(entry, parameters) | model | {"parameters": parameters}


def _model(entry: Registered, parameters: dict[Key, Plain]) -> dict[Key, Plain]:
    """Return the model that an aircraft says.

    Raises:
        ScenarioError: it raised an error, or its model isn't allowed.
    """
    keys = {str(name): value for name, value in parameters.items()}
    returned = entry.call(lambda: entry.instance(keys).model(), lambda why: refused(f"{entry}", why))
    if not isinstance(returned, dict):
        raise refused(f"{entry}", f"found {kind(returned)} ({entry.where})", "a mapping of the keys of `model`")
    source = Source(entry.where, plain_mapping(returned))
    try:
        VehicleModel.model_validate(source.data)
    except ValidationError as error:
        raise ScenarioError(problems_of(error, VehicleModel, source)) from error
    return source.data
