"""Defaults that depend on other keys, filled into the plain scenario before it is typed."""

from __future__ import annotations

from pathlib import Path

from formation_scenario.fields import MAX_SYSTEM_ID
from formation_scenario.source import Key, Plain, Source
from formation_scenario.vehicles import BASE_PORT

RUN_IN_AIR_S = 10.0
RUN_IN_GROUND_S = 60.0
SPEED_GAINS: dict[Key, Plain] = {"kp": 3.0, "ki": 0.8, "kd": 6.5, "error_scale": 1.0, "rate_scale": 1.0}
HEIGHT_GAINS: dict[Key, Plain] = {"kp": 2.0, "ki": 0.4, "kd": 4.0, "error_scale": 2.0, "rate_scale": 2.0}
HEADING_GAINS: dict[str, dict[Key, Plain]] = {
    "follower_heading": {"kp": 1.0, "ki": 0.6, "kd": 0.1, "error_scale": 0.1, "rate_scale": 0.1},
    "leader_heading": {"kp": 1.2, "ki": 0.5, "kd": 1.8, "error_scale": 0.1, "rate_scale": 0.1},
}


def resolve(source: Source) -> Source:
    """Return the scenario with `count` written out as a list and every dependent default in place.

    Values of a wrong type are left as they are: typing them tells the user.
    """
    data = dict(source.data)
    data.setdefault("name", Path(source.file).stem if source.file else "scenario")
    data["vehicles"] = _vehicles(data.get("vehicles"))
    if data["vehicles"] is None:
        del data["vehicles"]
    start = _group(data, "start")
    default_run_in = RUN_IN_AIR_S if start.get("in_air") is True else RUN_IN_GROUND_S
    data["start"] = _filled(data.get("start"), {"run_in_s": default_run_in})
    data["law"] = _law(data.get("law"), _group(data, "formation").get("frame"))
    data["formation"] = _formation(data.get("formation"))
    directory = Path(source.file).parent if source.file else Path()
    if "links" in data:
        data["links"] = _with_absolute(data["links"], "trace_file", directory)
    if "terrain" in data:
        data["terrain"] = _with_absolute(data["terrain"], "file", directory)
    data["expect"] = _each(data.get("expect", []), {"to_s": data.get("duration_s", 120.0)})
    return Source(source.file, data, source.places)


def _group(data: dict[Key, Plain], key: str) -> dict[Key, Plain]:
    value = data.get(key)
    return value if isinstance(value, dict) else {}


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
    heading = HEADING_GAINS.get(frame if isinstance(frame, str) else "", HEADING_GAINS["leader_heading"])
    if law is not None and not isinstance(law, dict):
        return law
    given = law or {}
    nominal = {"speed": SPEED_GAINS, "heading": heading, "height": HEIGHT_GAINS}
    return given | {name: _filled(given.get(name), gains) for name, gains in nominal.items()}


def _with_absolute(value: Plain, name: str, directory: Path) -> Plain:
    """Return a group of keys with every file under `name` as an absolute path: the resolved scenario finds it too."""
    if isinstance(value, list):
        return [_with_absolute(item, name, directory) for item in value]
    if not isinstance(value, dict):
        return value
    group = {key: _with_absolute(item, name, directory) for key, item in value.items()}
    file = group.get(name)
    return group | {name: str((directory / file).absolute())} if isinstance(file, str) else group


def _formation(formation: Plain) -> Plain:
    if not isinstance(formation, dict):
        return {} if formation is None else formation
    spacing = formation.get("spacing_m", 30.0)
    changes = formation.get("changes", [])
    if isinstance(changes, list):
        changes = [_filled(each, {"spacing_m": spacing}) if _has_shape(each) else each for each in changes]
    resolved: dict[Key, Plain] = {"changes": changes}
    return formation | resolved


def _has_shape(change: Plain) -> bool:
    return isinstance(change, dict) and change.get("shape") is not None


def _vehicles(vehicles: Plain) -> Plain:
    if isinstance(vehicles, dict):
        vehicles = _counted(vehicles)
    if not isinstance(vehicles, list):
        return vehicles
    return [
        _filled(vehicle, {"endpoint": _default_endpoint(vehicle.get("network"))})
        if isinstance(vehicle, dict)
        else vehicle
        for vehicle in vehicles
    ]


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
