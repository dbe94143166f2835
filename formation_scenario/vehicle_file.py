"""Vehicle files: a model of one kind of aircraft, shipped by name or written by `gcs-formation identify`."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from formation_scenario.describe import problems_of
from formation_scenario.errors import ScenarioError, did_you_mean
from formation_scenario.fields import Keys, Name, Number, key
from formation_scenario.gains import AUTO
from formation_scenario.source import Key, KeyPath, Plain, Source, plain_mapping, read_file, read_text
from formation_scenario.vehicles import VehicleModel

SUFFIXES = (".yaml", ".yml")
MODELS = ("model", "true_model")
FAMILIES = ("arduplane", "arducopter", "px4")
"""Autopilot families with a shipped vehicle file of their name, for a vehicle without `model`."""
SHIPPED = "aircraft"
"""Folder of the shipped files, inside this package."""


class VehicleFile(Keys):
    """What a vehicle file holds: the model of one kind of aircraft, and where it comes from."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = key("vehicle", "of the kind of aircraft", "skywalker")
    source: str = key("", "where the model comes from", "runs/steps, vehicle 2")
    model: VehicleModel = key(..., "its autopilot's lags, its limits and its airframe")
    fit: Mapping[str, Number] = key({}, "how well it was found, written by `identify`")


def with_models(source: Source) -> Source:
    """Return the scenario with the models of vehicle files in place of the files' names.

    Vehicles that fly otherwise than by the keys' own model have gains by design, unless others are named.

    Raises:
        ScenarioError: no such file, or one with values that aren't allowed.
    """
    vehicles, directory = source.data.get("vehicles"), Path(source.file).parent if source.file else Path()
    read = dict[str, Plain]()
    if isinstance(vehicles, list):
        whole: Plain = [_whole(each, directory, source, ("vehicles", i), read) for i, each in enumerate(vehicles)]
    else:
        whole = _whole(vehicles, directory, source, ("vehicles",), read)
    law, models = source.data.get("law") or {}, _models(whole)
    changed: dict[Key, Plain] = {"vehicles": whole}
    other = models != _models(vehicles) or any(isinstance(each, dict) and _is_other(each) for each in models)
    if other and isinstance(law, dict):
        changed["law"] = law | {"gains": law.get("gains") or AUTO}
    return Source(source.file, source.data | changed, source.places)


def _whole(vehicle: Plain, directory: Path, source: Source, path: KeyPath, read: dict[str, Plain]) -> Plain:
    """Return a vehicle, or a group, with its models; `read` are those that have been read already."""
    if not isinstance(vehicle, dict):
        return vehicle
    names = {key: name for key in MODELS if isinstance(name := vehicle.get(key), str)}
    if vehicle.get("model") is None and vehicle.get("autopilot") in FAMILIES:
        names["model"] = str(vehicle["autopilot"])
    for which, name in names.items():
        if name not in read:
            read[name] = read_model(name, directory, source, (*path, which))
    return vehicle | {key: read[name] for key, name in names.items()}


def _is_other(model: dict[Key, Plain]) -> bool:
    """Return whether the gains for the keys' own model don't suit one that is written out."""
    return "airframe" in model or model.get("hovers") is True


def _models(vehicles: Plain) -> list[Plain]:
    """Return what the station believes of each vehicle, as it is written."""
    each = vehicles if isinstance(vehicles, list) else [vehicles]
    return [one.get("model") for one in each if isinstance(one, dict)]


def read_model(name: str, directory: Path, at: Source, path: KeyPath) -> dict[Key, Plain]:
    """Return the model in a vehicle file, or in a shipped one, as it is written there.

    Args:
        name: a shipped name, or a file relative to `directory`.
        directory: of the scenario.
        at: the scenario, for the place of problems.
        path: the key that names the file.

    Raises:
        ScenarioError: no such file, or one with values that aren't allowed.
    """
    source = _read(name, directory, at, path)
    try:
        VehicleFile.model_validate(source.data)
    except ValidationError as error:
        raise ScenarioError(problems_of(error, VehicleFile, source)) from error
    model = source.data["model"]
    return plain_mapping(model) if isinstance(model, dict) else {}


def shipped_names() -> list[str]:
    """Return the names of the shipped vehicle files."""
    files = resources.files("formation_scenario") / SHIPPED
    return sorted(each.name.removesuffix(SUFFIXES[0]) for each in files.iterdir() if each.name.endswith(SUFFIXES[0]))


def _read(name: str, directory: Path, at: Source, path: KeyPath) -> Source:
    if not name.endswith(SUFFIXES):
        names = shipped_names()
        if name not in names:
            allowed = f"a vehicle file (*.yaml), or one that is shipped: {', '.join(names)}{did_you_mean(name, names)}"
            raise ScenarioError([at.problem(path, f"found '{name}'", allowed)])
        file = resources.files("formation_scenario") / SHIPPED / f"{name}{SUFFIXES[0]}"
        return read_text(file.read_text(encoding="utf-8"), f"{SHIPPED}/{name}{SUFFIXES[0]}")
    try:
        return read_file(directory / name)
    except ScenarioError as error:
        if any(each.line is not None for each in error.problems):
            raise
        said = "; ".join(each.found for each in error.problems)
        found = f"found '{directory / name}': {said}"
        raise ScenarioError([at.problem(path, found, "a vehicle file that can be read")]) from error
