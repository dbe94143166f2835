"""Fills in derived defaults and vehicle files' models in the plain scenario, before it is typed.

A vehicle file has the model of one kind of aircraft: shipped by name, or written by `gcs-formation identify`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from formation_scenario.brought_keys import with_brought_defaults
from formation_scenario.error_messages import problems_of
from formation_scenario.extensions import AIRCRAFT, Registry, missing
from formation_scenario.fields import (
    MAX_NAME_LENGTH,
    MAX_SYSTEM_ID,
    Keys,
    Name,
    Number,
    ScenarioError,
    did_you_mean,
    key,
    whole,
)
from formation_scenario.formation import Formation
from formation_scenario.gains import AUTO, CLEAN, NOISE, gain_set
from formation_scenario.model import Scenario
from formation_scenario.navigation import GRADES, InertialNavigation, InertialSensorKeys
from formation_scenario.own_aircraft import with_own_aircraft
from formation_scenario.plain_defaults import each_changed, filled, usable
from formation_scenario.shipped_aircraft import SHIPPED, SHIPPED_FILES, SUFFIXES, shipped_names
from formation_scenario.signing import NOT_SIGNED
from formation_scenario.source import Key, KeyPath, Plain, Source, plain_mapping, read_file, read_text
from formation_scenario.vehicles import BASE_PORT, VehicleModel

DURATION_S: float = Scenario.model_fields["duration_s"].default
SPACING_M: float = Formation.model_fields["spacing_m"].default
GRADE: str = InertialNavigation.model_fields["grade"].default
RUN_IN_AIR_S, RUN_IN_GROUND_S = 10.0, 60.0
MAY_BE_EMPTY = (
    "origin",
    "telemetry",
    "links",
    "wind",
    "disturbances",
    "orders",
    "faults",
    "finish",
    "extensions",
    "expect",
)
"""Keys that may be left empty: `expect:` with all of its items commented out counts as absent."""
MODELS = ("model", "true_model")
PARAMETERS, KEY_FILE = "parameters", "key_file"
"""Key of a model that names a parameter file; beside an extension's aircraft, a group of its keys."""
FILES = {
    "links": ("trace_file", "trace.file", KEY_FILE),
    "terrain": ("file",),
    "vehicles": (*MODELS, PARAMETERS, KEY_FILE),
    "path": ("file",),
}
"""Groups of keys that name files, and the keys that do, or `group.key`; models are names of shipped files too."""
OTHER_WAYPOINTS = ("waypoints_deg", "file")
"""Keys of a path that take the place of `waypoints_m`."""
FAMILIES = ("arduplane", "arducopter", "px4")
"""Autopilot families with a shipped vehicle file of the same name, for vehicles without `model`."""
_FIRMWARE_OF = {"arduplane": "ardupilot", "px4": "px4"}


def resolve(source: Source) -> Source:
    """Return the scenario with `count` expanded to a list and every derived default filled in.

    Values of a wrong type are kept; typing reports them afterwards.
    """
    data = {name: value for name, value in source.data.items() if value is not None or name not in MAY_BE_EMPTY}
    data.setdefault("name", Path(source.file).stem[:MAX_NAME_LENGTH] if source.file else "scenario")
    vehicles = data.pop("vehicles", None)
    if vehicles is not None:
        data["vehicles"] = vehicles = each_changed(_counted(vehicles), _vehicle)
    in_air = _group(data, "start").get("in_air") is True
    data["start"] = filled(data.get("start"), {"run_in_s": RUN_IN_AIR_S if in_air else RUN_IN_GROUND_S})
    each = vehicles if isinstance(vehicles, list) else []
    noisy = any(_group(one, "navigation").get("source") == "noisy" for one in each)
    law = filled(data.get("law"), {"gains": NOISE if noisy else CLEAN})
    data["law"] = _law(law, str(_group(data, "formation").get("frame"))) if isinstance(law, dict) else law
    formation = filled(data.get("formation"), {})
    data["formation"] = _formation(formation) if isinstance(formation, dict) else formation
    data["safety"] = filled(data.get("safety"), {})
    data |= _with_absolute_files(data, _directory(source))
    to: dict[Key, Plain] = {"to_s": usable(data.get("duration_s"), DURATION_S)}
    data["expect"] = each_changed(data.get("expect", []), lambda expectation: filled(expectation, to))
    return Source(source.file, with_brought_defaults(data), source.places)


def standalone(source: Source, registry: Registry | None = None) -> Source:
    """Return a scenario that can be read from anywhere: with its vehicles' models, and with absolute paths.

    Raises:
        ScenarioError: no such vehicle file, or one with values that aren't allowed.
    """
    whole = with_files(source, registry)
    return replace(whole, data=whole.data | _with_absolute_files(whole.data, _directory(source)))


def with_absolute_files(name: str, value: Plain, directory: Path) -> Plain:
    """Return the value of a dotted key with its files, relative to `directory`, as absolute paths."""
    group, *below = name.split(".")
    for inner in reversed(below):
        value = {inner: value}
    value = _with_absolute(value, FILES.get(group, ()), directory)
    for inner in below:
        value = value[inner] if isinstance(value, dict) else value
    return value


def _directory(source: Source) -> Path:
    """Return the directory of a scenario's file, to which the files that it names are relative."""
    return Path(source.file).parent if source.file else Path()


def _with_absolute_files(data: Mapping[Key, Plain], directory: Path) -> dict[Key, Plain]:
    """Return the groups with files as absolute paths, so that run.yaml finds them as well."""
    return {group: _with_absolute(data[group], names, directory) for group, names in FILES.items() if group in data}


def _with_absolute(value: Plain, names: tuple[str, ...], directory: Path) -> Plain:
    """Return a value with every file that a key of `names` in it has as an absolute path."""
    if isinstance(value, list):
        return [_with_absolute(item, names, directory) for item in value]
    if not isinstance(value, dict):
        return value
    group = {inner: _with_absolute(item, names, directory) for inner, item in value.items()}
    for name in names:
        outer, _, inner = name.partition(".")
        inside = group.get(outer)
        file = inside.get(inner) if inner and isinstance(inside, dict) else inside
        named = name in MODELS and isinstance(file, str) and not file.endswith(SUFFIXES)
        if isinstance(file, str) and not named and (name, file) != (KEY_FILE, NOT_SIGNED):
            absolute = str((directory / file).absolute())
            group[outer] = {**inside, inner: absolute} if isinstance(inside, dict) else absolute
    return group


def _group(value: Plain, name: str) -> dict[Key, Plain]:
    """Return the mapping under a name; empty if there is none."""
    inner = value.get(name) if isinstance(value, dict) else None
    return inner if isinstance(inner, dict) else {}


def _law(law: dict[Key, Plain], frame: str) -> Plain:
    groups, filters = gain_set(str(law["gains"]), frame)
    return filled(law | {name: filled(law.get(name), group) for name, group in groups.items()}, filters)


def _formation(formation: dict[Key, Plain]) -> Plain:
    spacing: dict[Key, Plain] = {"spacing_m": formation.get("spacing_m", SPACING_M)}
    changes = formation.get("changes", [])
    return formation | {
        "changes": each_changed(changes, lambda each: each if each.get("shape") is None else filled(each, spacing))
    }


def _vehicle(vehicle: dict[Key, Plain]) -> Plain:
    known, navigation = dict(vehicle), _group(vehicle, "navigation")
    if navigation.get("source") == "ins":
        of_grade = GRADES.get(str(navigation.get("grade", GRADE)), ())
        sensors = dict[Key, Plain](zip(InertialSensorKeys.model_fields, of_grade, strict=False))
        known["navigation"] = navigation | {"sensors": filled(navigation.get("sensors"), sensors)}
    differs, network = vehicle.get("true_model"), whole(vehicle.get("network"))
    if isinstance(differs, dict):
        known["true_model"] = _group(vehicle, "model") | differs
    number = network if isinstance(network, int) and not isinstance(network, bool) else 1
    return filled(known, {"endpoint": f"udpin:127.0.0.1:{BASE_PORT + number - 1}"})


def _counted(vehicles: Plain) -> Plain:
    """Return the list that a valid {count: N, ...} stands for; other values unchanged."""
    count = whole(vehicles.get("count")) if isinstance(vehicles, dict) else None
    if not isinstance(vehicles, dict) or not isinstance(count, int) or isinstance(count, bool):
        return vehicles
    if not 1 <= count <= MAX_SYSTEM_ID:
        return vehicles
    shared = {name: value for name, value in vehicles.items() if name != "count"}
    roles = ("leader", *("follower",) * (count - 1))
    return [{"id": number, "role": role, **shared} for number, role in enumerate(roles, 1)]


class VehicleFile(Keys):
    """What a vehicle file holds: the model of one kind of aircraft, and where it comes from."""

    schema_: Literal[1] = Field(default=1, alias="schema", description="version of these keys")
    name: Name = key("vehicle", "of the kind of aircraft", "skywalker")
    source: str = key("", "where the model comes from", "runs/steps, vehicle 2")
    model: VehicleModel = key(..., "its autopilot's time constants, its limits and its airframe")
    fit: Mapping[str, Number] = key({}, "how well it was found, written by `identify`")


def with_files(source: Source, registry: Registry | None = None) -> Source:
    """Return the scenario with the contents of vehicle files and of a mission file in place of their names.

    `registry` has the aircraft of extensions; without it their names stay, for a later call.

    Raises:
        ScenarioError: no such file, or one that can't be used.
    """
    return _with_mission(with_models(source, registry))


def _hover(whole: Source) -> bool:
    """Return whether all vehicles hover by their models."""
    models = _models(whole.data.get("vehicles"))
    return bool(models) and all(isinstance(each, dict) and each.get("hovers") is True for each in models)


def _with_mission(whole: Source) -> Source:
    """Return the scenario with waypoints in metres; readers of missions are imported for those that have one."""
    path = whole.data.get("path")
    if not isinstance(path, dict) or all(path.get(form) is None for form in OTHER_WAYPOINTS):
        return whole
    from formation_scenario.mission_path import with_mission  # noqa: PLC0415 - see above

    return with_mission(whole, _directory(whole), hovering=_hover(whole))


def with_models(source: Source, registry: Registry | None = None) -> Source:
    """Return the scenario with vehicle files' models in place of their names.

    If any model comes from a file, has an airframe or hovers, gains are by design unless the scenario names others.

    Raises:
        ScenarioError: no such file, or one with values that aren't allowed.
    """
    vehicles, directory = source.data.get("vehicles"), _directory(source)
    read = _Models(directory, source, registry)
    if isinstance(vehicles, list):
        whole: Plain = [read.whole(each, ("vehicles", i)) for i, each in enumerate(vehicles)]
    else:
        whole = read.whole(vehicles, ("vehicles",))
    law, models = source.data.get("law") or {}, _models(whole)
    changed: dict[Key, Plain] = {"vehicles": whole}
    written = (each for each in models if isinstance(each, dict))
    other = models != _models(vehicles) or any("airframe" in each or each.get("hovers") is True for each in written)
    if other and isinstance(law, dict):
        changed["law"] = law | {"gains": law.get("gains") or AUTO}
    return Source(source.file, source.data | changed, source.places)


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


def _models(vehicles: Plain) -> list[Plain]:
    """Return each vehicle's model for the station, as written."""
    each = vehicles if isinstance(vehicles, list) else [vehicles]
    return [one.get("model") for one in each if isinstance(one, dict)]


def read_model(name: str, directory: Path, at: Source, path: KeyPath, own: Sequence[str] = ()) -> dict[Key, Plain]:
    """Return the model in a vehicle file, or in a shipped one, as written there; with a parameter file's that it names.

    Args:
        name: a shipped name, or a file relative to `directory`.
        directory: directory of the scenario.
        at: the scenario, for the place of problems.
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
        directory = _directory(source)
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
