"""Fills defaults that depend on other keys into the plain scenario, before it is typed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from formation_scenario.fields import MAX_NUMBER, MAX_SYSTEM_ID
from formation_scenario.formation import Formation
from formation_scenario.gains import CLEAN, NOISE, filters, gain_groups
from formation_scenario.model import Safety, Scenario
from formation_scenario.navigation import GRADES, InertialNavigation, InertialSensorKeys
from formation_scenario.source import Key, Plain, Source
from formation_scenario.vehicle_file import MODELS, SUFFIXES, with_models
from formation_scenario.vehicles import BASE_PORT

DURATION_S: float = Scenario.model_fields["duration_s"].default
SEPARATION_M: float = Safety.model_fields["separation_m"].default
SPACING_M: float = Formation.model_fields["spacing_m"].default
GRADE: str = InertialNavigation.model_fields["grade"].default
RUN_IN_AIR_S, RUN_IN_GROUND_S = 10.0, 60.0
BUFFER_M = 5.0
"""By how much the distance that the separation rule keeps exceeds the least that is allowed."""
FILES = {"links": "trace_file", "terrain": "file"}
"""Groups of keys that name files, and by which key; beside them models of `vehicles`."""
MAY_BE_EMPTY = ("origin", "telemetry", "links", "wind", "disturbances", "orders", "faults", "finish", "expect")
"""Keys that may be left empty: `expect:` with all of its items commented out is as good as absent."""


def resolve(source: Source) -> Source:
    """Return the scenario with `count` written out as a list and every dependent default in place.

    Values of a wrong type are left as they are; typing reports them afterwards.
    """
    data = {key: value for key, value in source.data.items() if value is not None or key not in MAY_BE_EMPTY}
    data.setdefault("name", Path(source.file).stem if source.file else "scenario")
    data["vehicles"] = _vehicles(data.get("vehicles"))
    if data["vehicles"] is None:
        del data["vehicles"]
    start = _group(data, "start")
    default_run_in = RUN_IN_AIR_S if start.get("in_air") is True else RUN_IN_GROUND_S
    data["start"] = _filled(data.get("start"), {"run_in_s": default_run_in})
    gains = NOISE if _any_noisy(data.get("vehicles")) else CLEAN
    data["law"] = _law(_filled(data.get("law"), {"gains": gains}), _group(data, "formation").get("frame"))
    data["formation"] = _formation(data.get("formation"))
    data["safety"] = _safety(data.get("safety"))
    data |= _with_absolute_files(data, source)
    data["expect"] = _each(data.get("expect", []), {"to_s": _usable(data.get("duration_s"), DURATION_S)})
    return Source(source.file, data, source.places)


def standalone(source: Source) -> Source:
    """Return a scenario that can be read from anywhere: with its vehicles' models, and its files as absolute paths.

    Raises:
        ScenarioError: no such vehicle file, or one with values that aren't allowed.
    """
    whole = with_models(source)
    return replace(whole, data=whole.data | _with_absolute_files(whole.data, source))


def with_absolute_files(name: str, value: Plain, directory: Path) -> Plain:
    """Return the value of a dotted key with the files that it names, relative to `directory`, as absolute paths."""
    group, *below = name.split(".")
    for key in reversed(below):
        value = {key: value}
    for names in (FILES.get(group), *(MODELS if group == "vehicles" else ())):
        value = value if names is None else _with_absolute(value, names, directory)
    for key in below:
        value = value[key] if isinstance(value, dict) else value
    return value


def _with_absolute_files(data: dict[Key, Plain], source: Source) -> dict[Key, Plain]:
    """Return the groups that name files, relative to the scenario's own, with absolute paths."""
    directory = Path(source.file).parent if source.file else Path()
    return {key: _with_absolute(data[key], name, directory) for key, name in FILES.items() if key in data}


def _group(data: dict[Key, Plain], key: str) -> dict[Key, Plain]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


def _usable(value: Plain, default: float) -> float:
    """Return a number from which another key's default is derived; `default` if it will be refused anyway."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return default
    return value if 0.0 <= value <= MAX_NUMBER else default


def _filled(value: Plain, defaults: dict[Key, Plain]) -> Plain:
    """Return a mapping with defaults for the keys that it lacks or has as null."""
    if value is None:
        return dict(defaults)
    if not isinstance(value, dict):
        return value
    return value | {key: default for key, default in defaults.items() if value.get(key) is None}


def _each(values: Plain, defaults: dict[Key, Plain]) -> Plain:
    if not isinstance(values, list):
        return values
    return [_filled(value, defaults) if isinstance(value, dict) else value for value in values]


def _law(law: Plain, frame: Plain) -> Plain:
    if not isinstance(law, dict):
        return law
    gains = str(law["gains"])
    groups = {name: _filled(law.get(name), group) for name, group in gain_groups(gains, str(frame)).items()}
    return _filled({**law, **groups}, filters(gains))


def _any_noisy(vehicles: Plain) -> bool:
    each = vehicles if isinstance(vehicles, list) else []
    return any(_group(_group({"": one}, ""), "navigation").get("source") == "noisy" for one in each)


def _with_absolute(value: Plain, name: str, directory: Path) -> Plain:
    """Return a group of keys with every file under `name` as an absolute path, so that run.yaml finds it as well."""
    if isinstance(value, list):
        return [_with_absolute(item, name, directory) for item in value]
    if not isinstance(value, dict):
        return value
    group = {key: _with_absolute(item, name, directory) for key, item in value.items()}
    file = group.get(name)
    if not isinstance(file, str) or (name in MODELS and not file.endswith(SUFFIXES)):
        return group
    return group | {name: str((directory / file).absolute())}


def _formation(formation: Plain) -> Plain:
    if not isinstance(formation, dict):
        return {} if formation is None else formation
    spacing = formation.get("spacing_m", SPACING_M)
    changes = formation.get("changes", [])
    if isinstance(changes, list):
        changes = [_filled(each, {"spacing_m": spacing}) if _has_shape(each) else each for each in changes]
    resolved: dict[Key, Plain] = {"changes": changes}
    return formation | resolved


def _has_shape(change: Plain) -> bool:
    return isinstance(change, dict) and change.get("shape") is not None


def _safety(safety: Plain) -> Plain:
    if safety is not None and not isinstance(safety, dict):
        return safety
    given = safety or {}
    kept: dict[Key, Plain] = {"distance_m": _usable(given.get("separation_m"), SEPARATION_M) + BUFFER_M}
    return given | {"avoidance": _filled(given.get("avoidance"), kept)}


def _vehicles(vehicles: Plain) -> Plain:
    if isinstance(vehicles, dict):
        vehicles = _counted(vehicles)
    if not isinstance(vehicles, list):
        return vehicles
    return [_vehicle(each) if isinstance(each, dict) else each for each in vehicles]


def _vehicle(vehicle: dict[Key, Plain]) -> Plain:
    navigation = _group(vehicle, "navigation")
    inertial = {"navigation": _with_sensors(navigation)} if navigation.get("source") == "ins" else {}
    differs = vehicle.get("true_model")
    true = dict[Key, Plain]()
    if isinstance(differs, dict):
        true["true_model"] = _group(vehicle, "model") | differs
    return _filled(vehicle | inertial | true, {"endpoint": _default_endpoint(vehicle.get("network"))})


def _with_sensors(navigation: dict[Key, Plain]) -> Plain:
    """Return the keys of inertial navigation with the sensors of its grade."""
    grade = str(navigation.get("grade", GRADE))
    sensors = dict[Key, Plain](zip(InertialSensorKeys.model_fields, GRADES.get(grade, ()), strict=False))
    return navigation | {"sensors": _filled(navigation.get("sensors"), sensors)}


def _counted(group: dict[Key, Plain]) -> Plain:
    """Return the list that a valid {count: N, ...} stands for; any other mapping as it is."""
    count = group.get("count")
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MAX_SYSTEM_ID:
        return group
    shared = {key: value for key, value in group.items() if key != "count"}
    ids: list[dict[Key, Plain]] = [{"id": number, "role": "follower"} for number in range(1, count + 1)]
    ids[0]["role"] = "leader"
    return [own | shared for own in ids]


def _default_endpoint(network: Plain) -> str:
    number = network if isinstance(network, int) and not isinstance(network, bool) else 1
    return f"udpin:127.0.0.1:{BASE_PORT + number - 1}"
