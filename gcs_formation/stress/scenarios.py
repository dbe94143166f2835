"""Random scenarios, each made from its seed alone: shapes, paths, rates, links, wind, disturbances, faults."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np

from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.faults import PASSING

Keys = dict[str, Any]
Choice = TypeVar("Choice")

RUN_IN_S = 14.0
ASSEMBLY_S = 7.0
"""How long a leader in the air waits for followers; to go round again would take five minutes."""
FIRST_TROUBLE_S = 5.0
TROUBLE_S = 10.0
"""Links, air and vehicles misbehave during this time."""
LONGEST_SPELL_S = 5.0
"""Outages and faults that pass are over by then."""
CALM_S = 20.0
"""What follows trouble."""
LIGHT_TAILS: Keys = {"at_s": FIRST_TROUBLE_S + TROUBLE_S + LONGEST_SPELL_S, "distribution": "normal"}
"""Pareto's delays, now and then of seconds in which a link says nothing, are over then."""
CHANGE_S = 15.0
"""What is added to that where the formation changes."""
REJOIN_S = 45.0
"""What is added where a vehicle has had to leave the formation: it flies after the others at 6 m/s more than they."""
GROUND_SHARE = 0.03
LEG_M = 600.0
MOST_DRAWS = 100


def draw(seed: int) -> Scenario:
    """Return the scenario of a seed: of those drawn one after the other, the first that can be flown.

    Raises:
        ScenarioError: none of many could.
    """
    rng = np.random.default_rng(seed)
    for _ in range(MOST_DRAWS - 1):
        keys = _scenario(rng, seed)
        try:
            return load_scenario(keys)
        except ScenarioError:
            continue
    return load_scenario(_scenario(rng, seed))


def _scenario(rng: np.random.Generator, seed: int) -> Keys:
    count = int(rng.integers(2, 5))
    faults = _faults(rng, count)
    outages = _outages(rng, count)
    formation = _formation(rng, count)
    more_s = REJOIN_S if faults or outages else CHANGE_S if formation.get("changes") else 0.0
    duration_s = FIRST_TROUBLE_S + TROUBLE_S + CALM_S + more_s
    speed_mps = float(rng.uniform(20.0, 22.0))
    return {
        "name": f"stress-{seed}",
        "seed": seed,
        "duration_s": duration_s,
        "start": _start(rng),
        "vehicles": _vehicles(rng, count),
        "telemetry": {"rate_hz": _rate_hz(rng)},
        "formation": formation,
        "law": {"type": _one_of(rng, "fuzzy_pid", "pid"), "rate_hz": _rate_hz(rng)},
        "path": {"speed_mps": speed_mps, "waypoints_m": _waypoints(rng, (duration_s + 30.0) * speed_mps)},
        "links": {"default": _impairment(rng), "changes": [*_link_changes(rng, count), *outages, LIGHT_TAILS]},
        "wind": {"velocity_mps": _vector(rng, 4.0, 4.0, 0.0)},
        "disturbances": _disturbances(rng, count),
        "faults": faults,
        "finish": {"loiter_s": 2.0},
    }


def _vehicles(rng: np.random.Generator, count: int) -> list[Keys]:
    clocks = [
        {"offset_s": float(rng.uniform(0.0, 1000.0)), "drift_ppm": float(rng.normal(0.0, 50.0))} for _ in range(count)
    ]
    return [{"id": i + 1, "role": "follower" if i else "leader", "clock": clock} for i, clock in enumerate(clocks)]


def _start(rng: np.random.Generator) -> Keys:
    if rng.random() < GROUND_SHARE:
        return {"in_air": False}
    in_air = {"in_air": True, "run_in_s": RUN_IN_S, "timeout_s": ASSEMBLY_S}
    return {**in_air, "offset_m": _vector(rng, 8.0, 6.0, 4.0)}


def _formation(rng: np.random.Generator, count: int) -> Keys:
    """Return a shape; in the follower's own frame one whose slots aren't far aside, where that frame swings them."""
    if rng.random() < 0.25:
        spacing_m = float(rng.uniform(20.0, 35.0))
        return {
            "shape": _one_of(rng, "follower", "diamond", "triangle"),
            "spacing_m": spacing_m,
            "frame": "follower_heading",
        }
    shapes = ("follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle")
    changes: list[Keys] = []
    if rng.random() < 0.4:
        changes.append({"at_s": _trouble_at(rng), "shape": _one_of(rng, *shapes)})
    if rng.random() < 0.2:
        changes.append({"at_s": _trouble_at(rng) + TROUBLE_S, "leader": _vehicle(rng, count)})
    return {
        "shape": _one_of(rng, *shapes),
        "spacing_m": float(rng.uniform(25.0, 60.0)),
        "frame": "leader_heading",
        "changes": changes,
    }


def _waypoints(rng: np.random.Generator, length_m: float) -> list[list[float]]:
    """Return waypoints of a path that bends and climbs gently."""
    places, course = [[0.0, 0.0, float(rng.uniform(100.0, 300.0))]], float(rng.uniform(-math.pi, math.pi))
    for _ in range(math.ceil(length_m / LEG_M)):
        north, east, height = places[-1]
        course += float(rng.uniform(-0.35, 0.35))
        north, east = north + LEG_M * math.cos(course), east + LEG_M * math.sin(course)
        places.append([north, east, float(np.clip(height + rng.uniform(-20.0, 20.0), 60.0, 400.0))])
    return places


def _impairment(rng: np.random.Generator) -> Keys:
    keys: Keys = {"delay_ms": float(rng.uniform(0.0, 300.0)) if rng.random() < 0.8 else 0.0}
    if rng.random() < 0.6:
        keys["jitter_ms"] = float(rng.uniform(0.0, 40.0))
        keys["distribution"] = _one_of(rng, "normal", "uniform", "pareto")
        keys["reorder"] = bool(rng.random() < 0.5)
    if rng.random() < 0.6:
        keys["loss"] = float(rng.uniform(0.0, 0.1))
        if rng.random() < 0.3:
            keys["mean_burst"] = float(rng.uniform(1.5, 5.0))
    if rng.random() < 0.3:
        keys["duplicate"] = float(rng.uniform(0.0, 0.2))
    return keys


def _link_changes(rng: np.random.Generator, count: int) -> list[Keys]:
    return [
        {"at_s": _trouble_at(rng), "vehicles": [_vehicle(rng, count)], **_impairment(rng)}
        for _ in range(int(rng.integers(0, 3)))
    ]


def _outages(rng: np.random.Generator, count: int) -> list[Keys]:
    if rng.random() > 0.25:
        return []
    begins_s, vehicle = _trouble_at(rng), _vehicle(rng, count)
    ends_s = begins_s + float(rng.uniform(0.5, LONGEST_SPELL_S))
    return [{"at_s": at_s, "vehicles": [vehicle], "outage": at_s == begins_s} for at_s in (begins_s, ends_s)]


def _disturbances(rng: np.random.Generator, count: int) -> list[Keys]:
    several = [i for i in range(1, count + 1) if rng.random() < 0.6]
    if not several:
        return []
    return [{"at_s": _trouble_at(rng), "vehicles": several, "velocity_mps": _vector(rng, 0.8, 0.8, 0.3)}]


def _faults(rng: np.random.Generator, count: int) -> list[Keys]:
    """Return one fault of one vehicle, the leader among them, or none."""
    if rng.random() > 0.35:
        return []
    kind, at_s = _one_of(rng, "crash", "restart", "freeze", "ignore", "pilot"), _trouble_at(rng)
    ends: Keys = {"until_s": at_s + float(rng.uniform(2.0, LONGEST_SPELL_S))} if kind in PASSING else {}
    return [{"at_s": at_s, "vehicles": [_vehicle(rng, count)], "kind": kind, **ends}]


def _rate_hz(rng: np.random.Generator) -> float:
    return _one_of(rng, 5.0, 5.0, 10.0)


def _trouble_at(rng: np.random.Generator) -> float:
    return FIRST_TROUBLE_S + float(rng.uniform(0.0, TROUBLE_S))


def _vehicle(rng: np.random.Generator, count: int) -> int:
    return int(rng.integers(1, count + 1))


def _vector(rng: np.random.Generator, *most: float) -> list[float]:
    return [float(rng.uniform(-each, each)) for each in most]


def _one_of(rng: np.random.Generator, *choices: Choice) -> Choice:
    return choices[int(rng.integers(len(choices)))]
