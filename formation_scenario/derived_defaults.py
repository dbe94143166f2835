"""Fills in derived defaults, and what other files hold, in the plain scenario before it is typed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from formation_scenario.brought_keys import with_brought_defaults
from formation_scenario.fields import (
    MAX_NAME_LENGTH,
    MAX_SYSTEM_ID,
    whole,
)
from formation_scenario.formation import Formation
from formation_scenario.gains import CLEAN, NOISE, gain_set
from formation_scenario.model import Scenario
from formation_scenario.navigation import GRADES, InertialNavigation, InertialSensorKeys
from formation_scenario.plain_defaults import each_changed, filled, usable
from formation_scenario.registry import Registry
from formation_scenario.shipped_aircraft import SUFFIXES
from formation_scenario.signing import NOT_SIGNED
from formation_scenario.source import Key, Plain, Source
from formation_scenario.vehicle_files import MODELS, PARAMETERS, models_of, with_models
from formation_scenario.vehicles import BASE_PORT

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
KEY_FILE = "key_file"
FILES = {
    "links": ("trace_file", "trace.file", KEY_FILE),
    "terrain": ("file",),
    "vehicles": (*MODELS, PARAMETERS, KEY_FILE),
    "path": ("file",),
}
"""Groups of keys that name files, and the keys that do, or `group.key`; models are names of shipped files too."""
OTHER_WAYPOINTS = ("waypoints_deg", "file")
"""Keys of a path that take the place of `waypoints_m`."""


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
    data |= _with_absolute_files(data, source.directory)
    to: dict[Key, Plain] = {"to_s": usable(data.get("duration_s"), DURATION_S)}
    data["expect"] = each_changed(data.get("expect", []), lambda expectation: filled(expectation, to))
    return Source(source.file, with_brought_defaults(data), source.positions)


def standalone(source: Source, registry: Registry | None = None) -> Source:
    """Return a scenario that can be read from anywhere: with its vehicles' models, and with absolute paths.

    Raises:
        ScenarioError: no such vehicle file, or one with values that aren't allowed.
    """
    whole = with_files(source, registry)
    return replace(whole, data=whole.data | _with_absolute_files(whole.data, source.directory))


def with_absolute_files(name: str, value: Plain, directory: Path) -> Plain:
    """Return the value of a dotted key with its files, relative to `directory`, as absolute paths."""
    group, *below = name.split(".")
    for inner in reversed(below):
        value = {inner: value}
    value = _with_absolute(value, FILES.get(group, ()), directory)
    for inner in below:
        value = value[inner] if isinstance(value, dict) else value
    return value


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


def with_files(source: Source, registry: Registry | None = None) -> Source:
    """Return the scenario with the contents of vehicle files and of a mission file in place of their names.

    `registry` has the aircraft of extensions; without it their names stay, for a later call.

    Raises:
        ScenarioError: no such file, or one that can't be used.
    """
    return _with_mission(with_models(source, registry))


def _hover(whole: Source) -> bool:
    """Return whether all vehicles hover by their models."""
    models = models_of(whole.data.get("vehicles"))
    return bool(models) and all(isinstance(each, dict) and each.get("hovers") is True for each in models)


def _with_mission(whole: Source) -> Source:
    """Return the scenario with waypoints in metres; readers of missions are imported for those that have one."""
    path = whole.data.get("path")
    if not isinstance(path, dict) or all(path.get(form) is None for form in OTHER_WAYPOINTS):
        return whole
    from formation_scenario.mission_path import with_mission  # noqa: PLC0415 - see above

    return with_mission(whole, whole.directory, hovering=_hover(whole))
