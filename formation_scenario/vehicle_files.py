"""Vehicle files: the model of one kind of aircraft, shipped by name or written by `gcs-formation identify`.

In the plain scenario the model takes the place of the file's name, and of a parameter file's, before it is typed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from formation_scenario.error_messages import problems_of
from formation_scenario.extensions import AIRCRAFT
from formation_scenario.fields import (
    Keys,
    Name,
    Number,
    ScenarioError,
    did_you_mean,
    key,
)
from formation_scenario.gains import AUTO
from formation_scenario.own_aircraft import with_own_aircraft
from formation_scenario.registry import Registry, missing
from formation_scenario.shipped_aircraft import SHIPPED, SHIPPED_FILES, SUFFIXES, shipped_names
from formation_scenario.source import Key, KeyPath, Plain, Source, plain_mapping, read_file, read_text
from formation_scenario.vehicles import VehicleModel

MODELS = ("model", "true_model")
PARAMETERS = "parameters"
"""Key of a model that names a parameter file; beside an extension's aircraft, a group of its keys."""
FAMILIES = ("arduplane", "arducopter", "px4")
"""Autopilot families with a shipped vehicle file of the same name, for vehicles without `model`."""
_FIRMWARE_OF = {"arduplane": "ardupilot", "px4": "px4"}


class VehicleFile(Keys):
    """What a vehicle file holds: the model of one kind of aircraft, and where it comes from."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = key("vehicle", "of the kind of aircraft", "skywalker")
    source: str = key("", "where the model comes from", "runs/steps, vehicle 2")
    model: VehicleModel = key(..., "its autopilot's time constants, its limits and its airframe")
    fit: Mapping[str, Number] = key({}, "how well it was found, written by `identify`")


def with_models(source: Source, registry: Registry | None = None) -> Source:
    """Return the scenario with vehicle files' models in place of their names.

    If any model comes from a file, has an airframe or hovers, gains are by design unless the scenario names others.

    Raises:
        ScenarioError: no such file, or one with values that aren't allowed.
    """
    vehicles, directory = source.data.get("vehicles"), source.directory
    read = _Models(directory, source, registry)
    if isinstance(vehicles, list):
        whole: Plain = [read.whole(each, ("vehicles", i)) for i, each in enumerate(vehicles)]
    else:
        whole = read.whole(vehicles, ("vehicles",))
    law, models = source.data.get("law") or {}, models_of(whole)
    changed: dict[Key, Plain] = {"vehicles": whole}
    written = (each for each in models if isinstance(each, dict))
    other = models != models_of(vehicles) or any("airframe" in each or each.get("hovers") is True for each in written)
    if other and isinstance(law, dict):
        changed["law"] = law | {"gains": law.get("gains") or AUTO}
    return Source(source.file, source.data | changed, source.positions)


class _Models:
    """Models of a scenario's vehicles by their names."""

    def __init__(self, directory: Path, source: Source, registry: Registry | None) -> None:
        self._directory, self._source, self._registry = directory, source, registry
        self._read = dict[str, Plain]()

    def whole(self, vehicle: Plain, path: KeyPath) -> Plain:
        """Return a vehicle, or a group, with its models."""
        if not isinstance(vehicle, dict):
            return vehicle
        written = {which: vehicle[which] for which in MODELS if vehicle.get(which) is not None}
        if vehicle.get("model") is None and vehicle.get("autopilot") in FAMILIES:
            written["model"] = vehicle["autopilot"]
        whole = {which: self._whole(model, (*path, which)) for which, model in written.items()}
        for which, model in written.items():
            if isinstance(model, dict) and isinstance(model.get(PARAMETERS), str):
                _refuse_other_firmware(vehicle, whole[which], self._source, (*path, which, PARAMETERS))
        return vehicle | whole

    def _whole(self, model: Plain, path: KeyPath) -> Plain:
        if isinstance(model, str):
            if self._registry is not None and self._registry.get(model, AIRCRAFT) is not None:
                model = {"aircraft": model}
            elif self._registry is None and not (model.endswith(SUFFIXES) or model in shipped_names()):
                return model
            else:
                model = self._file(model, path)
        elif isinstance(model, dict) and "aircraft" not in model and isinstance(file := model.get(PARAMETERS), str):
            model = self._of_parameters(model, file, (*path, PARAMETERS))
        return model if self._registry is None else with_own_aircraft(model, self._registry, self._source, path)

    def _of_parameters(self, model: dict[Key, Plain], file: str, path: KeyPath) -> Plain:
        name = f"{PARAMETERS}: {file}"
        if name not in self._read:
            self._read[name] = read_parameter_model(file, self._directory, self._source, path)
        return _over(self._read[name], model | {PARAMETERS: str((self._directory / file).absolute())})

    def _file(self, name: str, path: KeyPath) -> Plain:
        if name not in self._read:
            own = [] if self._registry is None else self._registry.names(AIRCRAFT)
            self._read[name] = read_model(name, self._directory, self._source, path, own)
        return self._read[name]


def _refuse_other_firmware(vehicle: dict[Key, Plain], model: Plain, source: Source, path: KeyPath) -> None:
    """Refuse parameters of another autopilot than the one that a vehicle names."""
    named, of = vehicle.get("autopilot"), _FIRMWARE_OF.get(str(vehicle.get("autopilot")))
    firmware = model.get("firmware", "ardupilot") if isinstance(model, dict) else of
    if of is not None and firmware != of:
        raise ScenarioError([source.problem(path, f"found a file of {firmware} for an {named}", f"one of {of}")])


def _over(base: Plain, given: dict[Key, Plain]) -> Plain:
    """Return a mapping with the given keys in place of its own, in groups below too; null keys are left out."""
    if not isinstance(base, dict):
        return given
    own = {key: value for key, value in given.items() if value is not None or key not in base}
    return base | {key: _over(base.get(key), value) if isinstance(value, dict) else value for key, value in own.items()}


def models_of(vehicles: Plain) -> list[Plain]:
    """Return each vehicle's model for the station, as written."""
    each = vehicles if isinstance(vehicles, list) else [vehicles]
    return [one.get("model") for one in each if isinstance(one, dict)]


def read_model(name: str, directory: Path, at: Source, path: KeyPath, own: Sequence[str] = ()) -> dict[Key, Plain]:
    """Return the model in a vehicle file, or in a shipped one, as written there; with a parameter file's that it names.

    Args:
        name: a shipped name, or a file relative to `directory`.
        directory: directory of the scenario.
        at: the scenario, for the position of problems in its file.
        path: the key that names the file.
        own: names of aircraft that extensions register, for messages.

    Raises:
        ScenarioError: no such file, or one with values that aren't allowed.
    """
    source = _read(name, directory, at, path, own)
    try:
        VehicleFile.model_validate(source.data)
    except ValidationError as error:
        raise ScenarioError(problems_of(error, VehicleFile, source)) from error
    model = source.data["model"]
    if isinstance(model, dict) and "aircraft" not in model and isinstance(file := model.get(PARAMETERS), str):
        directory = source.directory
        of_parameters = read_parameter_model(file, directory, source, ("model", PARAMETERS))
        model = _over(of_parameters, model | {PARAMETERS: str((directory / file).absolute())})
    return plain_mapping(model) if isinstance(model, dict) else {}


def read_parameter_model(file: str, directory: Path, at: Source, path: KeyPath) -> dict[Key, Plain]:
    """Return the model of the aircraft that a parameter file is of; arguments as of `read_model`.

    Raises:
        ScenarioError: no such file, or one that isn't a fixed wing's, or has a line or a value that isn't allowed.
    """
    from formation_scenario.parameter_files import ParameterFileError, of_file  # noqa: PLC0415 - few scenarios name one

    try:
        return dict(of_file(directory / file, shipped_models()).model)
    except ParameterFileError as error:
        found, _, allowed = str(error).partition("; allowed: ")
        raise ScenarioError([at.problem(path, found, allowed or "a parameter file that can be read")]) from error


def shipped_models() -> dict[str, dict[Key, Plain]]:
    """Return the models in the shipped vehicle files, as written there, by name."""
    return {name: read_model(name, Path(), Source(None, {}), ()) for name in shipped_names()}


def _read(name: str, directory: Path, at: Source, path: KeyPath, own: Sequence[str]) -> Source:
    if not name.endswith(SUFFIXES):
        names = shipped_names()
        if name not in names:
            near = f"{did_you_mean(name, [*names, *own])}{missing(name, at.home)}"
            others = f"; an extension's: {', '.join(own)}" if own else ""
            allowed = f"a vehicle file (*.yaml), or one that is shipped: {', '.join(names)}{others}{near}"
            raise ScenarioError([at.problem(path, f"found '{name}'", allowed)])
        file = f"{name}{SUFFIXES[0]}"
        return read_text((SHIPPED_FILES / file).read_text(encoding="utf-8"), f"{SHIPPED}/{file}")
    try:
        return read_file(directory / name, "vehicle")
    except ScenarioError as error:
        if any(each.line is not None for each in error.problems):
            raise
        problems_found = "; ".join(each.found for each in error.problems)
        found = f"found '{directory / name}': {problems_found}"
        raise ScenarioError([at.problem(path, found, "a vehicle file that can be read")]) from error
