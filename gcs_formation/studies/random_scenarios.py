"""Random scenarios, each made from its seed alone: shapes, paths, rates, links, wind, disturbances, faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from airlink.telemetry_faults import EFFECTS, NEEDS_AMOUNT, QUANTITIES, refusal
from formation_scenario import Scenario, ScenarioError, load_scenario
from formation_scenario.extensions import FAULT
from formation_scenario.registry import Registry
from formation_scenario.surroundings import PASSING

Keys = dict[str, Any]
Choice = TypeVar("Choice")

RUN_IN_S = 14.0
ASSEMBLY_S = 7.0
"""How long a leader in the air waits for followers; flying another holding pattern would take five minutes."""
FIRST_TROUBLE_S = 5.0
LEG_M = 600.0
MAX_DRAWS = 100
ALL_SHARE = 0.2
"""Share of faults of telemetry that are every vehicle's."""


@dataclass(frozen=True)
class Severity:
    """How severe a flight's trouble is, and the time to recover from it; the defaults are the usual severity."""

    trouble_s: float = 10.0
    """Time during which links, air and vehicles misbehave."""
    longest_spell_s: float = 5.0
    """Longest duration of outages and of passing faults."""
    calm_s: float = 20.0
    """Calm time after the trouble."""
    change_s: float = 15.0
    """Further calm time if the formation changes."""
    rejoin_s: float = 45.0
    """Further calm time if a vehicle had to leave the formation: it catches up at a few m/s more than the others."""
    rates_hz: tuple[float, ...] = (5.0, 5.0, 10.0)
    """Rates of the law and of telemetry."""
    fastest_mps: float = 22.0
    wind_mps: float = 4.0
    """Largest wind to the north and to the east."""
    ground_share: float = 0.03
    """Share of flights that begin on the ground."""
    fault_share: float = 0.35
    outage_share: float = 0.25
    telemetry_share: float = 0.0
    """Share of flights with faults of telemetry, in place of other faults."""

    @property
    def calm_from_s(self) -> float:
        """The time at which the last outage or fault is over."""
        return FIRST_TROUBLE_S + self.trouble_s + self.longest_spell_s


USUAL = Severity()
HARD = Severity(
    trouble_s=20.0,
    longest_spell_s=12.0,
    calm_s=30.0,
    change_s=30.0,
    rejoin_s=190.0,
    rates_hz=(5.0, 10.0, 20.0),
    fastest_mps=23.0,
    wind_mps=6.0,
    ground_share=0.05,
    fault_share=0.5,
    outage_share=0.4,
)
TELEMETRY = replace(USUAL, outage_share=0.0, telemetry_share=1.0)
SEVERITIES = {"usual": USUAL, "hard": HARD, "telemetry": TELEMETRY}
AMOUNTS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "position": {"offset": (2.0, 150.0), "drift": (1.0, 10.0), "noise": (1.0, 12.0), "scale": (0.3, 2.0)},
    "velocity": {"offset": (1.0, 15.0), "drift": (0.5, 3.0), "noise": (0.2, 4.0), "scale": (0.2, 2.0)},
    "height": {"offset": (2.0, 60.0), "drift": (1.0, 5.0), "noise": (0.5, 6.0), "scale": (0.3, 2.0)},
    "airspeed": {"offset": (2.0, 12.0), "drift": (0.5, 3.0), "noise": (0.5, 4.0), "scale": (0.3, 2.0)},
    "attitude": {"offset": (0.1, 3.0), "drift": (0.02, 0.5), "noise": (0.02, 0.5), "scale": (0.3, 2.0)},
    "stamps": {"offset": (0.2, 3.0), "drift": (0.02, 0.3), "noise": (0.01, 0.3), "scale": (0.8, 1.2)},
}
"""Amounts of drawn faults of telemetry, in their units."""
LATE_S = (0.2, 3.0)


def draw(seed: int, severity: Severity = USUAL, registry: Registry | None = None) -> Scenario:
    """Return the scenario of a seed and a severity: the first in a sequence of draws that can be flown.

    Faults that extensions register are drawn like ours, with the defaults of their keys.

    Raises:
        ScenarioError: none of `MAX_DRAWS` can be flown.
    """
    rng, registry = np.random.default_rng(seed), registry or Registry()
    for _ in range(MAX_DRAWS - 1):
        with suppress(ScenarioError):
            return load_scenario(_scenario(rng, seed, severity, registry), plugins=registry)
    return load_scenario(_scenario(rng, seed, severity, registry), plugins=registry)


def _scenario(rng: np.random.Generator, seed: int, severity: Severity, registry: Registry) -> Keys:
    count = int(rng.integers(2, 5))
    faults = _faults(rng, severity, count, registry)
    outages = _outages(rng, severity, count, faults)
    formation = _formation(rng, severity, count)
    more_s = severity.rejoin_s if faults or outages else severity.change_s if formation.get("changes") else 0.0
    duration_s = FIRST_TROUBLE_S + severity.trouble_s + severity.calm_s + more_s
    speed_mps = float(rng.uniform(20.0, severity.fastest_mps))
    kinds = [f"-{name}" for name, each in SEVERITIES.items() if each is severity and each is not USUAL]
    return {
        "name": f"stress{''.join(kinds)}-{seed}",
        "seed": seed,
        "duration_s": duration_s,
        "start": _start(rng, severity),
        "vehicles": _vehicles(rng, count),
        "telemetry": {"rate_hz": _one_of(rng, *severity.rates_hz)},
        "formation": formation,
        "law": {"type": _one_of(rng, "fuzzy_pid", "pid"), "rate_hz": _one_of(rng, *severity.rates_hz)},
        "path": {"speed_mps": speed_mps, "waypoints_m": _waypoints(rng, (duration_s + 30.0) * speed_mps)},
        "links": {"default": _impairment(rng), "changes": _link_changes(rng, severity, count, outages)},
        "wind": {"velocity_mps": _vector(rng, severity.wind_mps, severity.wind_mps, 0.0)},
        "disturbances": _disturbances(rng, severity, count),
        "faults": faults,
        "finish": {"loiter_s": 2.0},
    }


def _vehicles(rng: np.random.Generator, count: int) -> list[Keys]:
    clocks = (
        {"offset_s": float(rng.uniform(0.0, 1000.0)), "drift_ppm": float(rng.normal(0.0, 50.0))} for _ in range(count)
    )
    return [{"id": i + 1, "role": "follower" if i else "leader", "clock": clock} for i, clock in enumerate(clocks)]


def _start(rng: np.random.Generator, severity: Severity) -> Keys:
    if rng.random() < severity.ground_share:
        return {"in_air": False}
    return {"in_air": True, "run_in_s": RUN_IN_S, "timeout_s": ASSEMBLY_S, "offset_m": _vector(rng, 8.0, 6.0, 4.0)}


def _formation(rng: np.random.Generator, severity: Severity, count: int) -> Keys:
    """Return a formation. In the follower's own frame slots aren't far to the side, because they swing with heading."""
    if rng.random() < 0.25:
        spacing = {"spacing_m": float(rng.uniform(20.0, 35.0)), "frame": "follower_heading"}
        return {"shape": _one_of(rng, "follower", "diamond", "triangle"), **spacing}
    shapes = ("follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle")
    changes: list[Keys] = []
    if rng.random() < 0.4:
        changes.append({"at_s": _trouble_at(rng, severity), "shape": _one_of(rng, *shapes)})
    if rng.random() < 0.2:
        changes.append({"at_s": _trouble_at(rng, severity) + severity.trouble_s, "leader": _vehicle(rng, count)})
    shape, spacing_m = _one_of(rng, *shapes), float(rng.uniform(25.0, 60.0))
    return {"shape": shape, "spacing_m": spacing_m, "frame": "leader_heading", "changes": changes}


def _waypoints(rng: np.random.Generator, length_m: float) -> list[list[float]]:
    waypoints, course = [[0.0, 0.0, float(rng.uniform(100.0, 300.0))]], float(rng.uniform(-math.pi, math.pi))
    for _ in range(math.ceil(length_m / LEG_M)):
        north, east, height = waypoints[-1]
        course += float(rng.uniform(-0.35, 0.35))
        north, east = north + LEG_M * math.cos(course), east + LEG_M * math.sin(course)
        waypoints.append([north, east, float(np.clip(height + rng.uniform(-20.0, 20.0), 60.0, 400.0))])
    return waypoints


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


def _link_changes(rng: np.random.Generator, severity: Severity, count: int, outages: list[Keys]) -> list[Keys]:
    """Return changes of single links, the outages, and the end of all Pareto-distributed delays after the trouble.

    Pareto-distributed delays are sometimes seconds long, and the link is silent meanwhile.
    """
    changes = [
        {"at_s": _trouble_at(rng, severity), "vehicles": [_vehicle(rng, count)], **_impairment(rng)}
        for _ in range(int(rng.integers(0, 3)))
    ]
    return [*changes, *outages, {"at_s": severity.calm_from_s, "distribution": "normal"}]


def _outages(rng: np.random.Generator, severity: Severity, count: int, faults: list[Keys]) -> list[Keys]:
    """Return an outage of a vehicle that has no pilot fault: with both, its position couldn't be known."""
    if rng.random() > severity.outage_share:
        return []
    begins_s, vehicle = _trouble_at(rng, severity), _vehicle(rng, count)
    if any(fault["kind"] == "pilot" and vehicle in fault["vehicles"] for fault in faults):
        vehicle = vehicle % count + 1
    ends_s = begins_s + float(rng.uniform(0.5, severity.longest_spell_s))
    direction = _one_of(rng.spawn(1)[0], "both", "uplink", "downlink")
    spell: list[Keys] = [{"outage": True}, {"outage": False}]
    changes = spell if direction == "both" else [{direction: each} for each in spell]
    return [
        {"at_s": at_s, "vehicles": [vehicle], **keys} for at_s, keys in zip((begins_s, ends_s), changes, strict=True)
    ]


def _disturbances(rng: np.random.Generator, severity: Severity, count: int) -> list[Keys]:
    several = [i for i in range(1, count + 1) if rng.random() < 0.6]
    if not several:
        return []
    return [{"at_s": _trouble_at(rng, severity), "vehicles": several, "velocity_mps": _vector(rng, 0.8, 0.8, 0.3)}]


def _faults(rng: np.random.Generator, severity: Severity, count: int, registry: Registry) -> list[Keys]:
    """Return one fault of one vehicle, which may be the leader, or none."""
    if severity.telemetry_share:
        return _telemetry_faults(rng, severity, count)
    if rng.random() > severity.fault_share:
        return []
    own = {each.name: each.made.lasts for each in registry.of(FAULT) if each.works_by_defaults}
    kind, at_s = _one_of(rng, "crash", "restart", "freeze", "ignore", "pilot", *own), _trouble_at(rng, severity)
    ends: Keys = (
        {"until_s": at_s + float(rng.uniform(2.0, severity.longest_spell_s))}
        if kind in PASSING or own.get(kind)
        else {}
    )
    return [{"at_s": at_s, "vehicles": [_vehicle(rng, count)], "kind": kind, **ends}]


def _telemetry_faults(rng: np.random.Generator, severity: Severity, count: int) -> list[Keys]:
    """Return one or two faults of telemetry, which end: of one vehicle, or of all."""
    if rng.random() > severity.telemetry_share:
        return []
    return [_telemetry_fault(rng, severity, count) for _ in range(int(rng.integers(1, 3)))]


def _telemetry_fault(rng: np.random.Generator, severity: Severity, count: int) -> Keys:
    fault = telemetry_fault(rng)
    drawn: Keys = {}
    drawn["at_s"] = _trouble_at(rng, severity)
    drawn["for_s"] = float(rng.uniform(1.0, severity.longest_spell_s))
    drawn["vehicles"] = "all" if rng.random() < ALL_SHARE else [_vehicle(rng, count)]
    return drawn | fault


def telemetry_fault(rng: np.random.Generator) -> Keys:
    """Return a fault of telemetry without when and whose: quantity, effect and amount."""
    quantity = _one_of(rng, *QUANTITIES)
    amounts = AMOUNTS.get(quantity, {})
    effect = _one_of(
        rng, *(each for each in EFFECTS if refusal(quantity, each, 1.0 if each in NEEDS_AMOUNT else None) is None)
    )
    low, high = LATE_S if effect == "late" else amounts.get(effect, (0.0, 0.0))
    sign = _one_of(rng, -1.0, 1.0) if effect in ("offset", "drift") else 1.0
    amount: Keys = {"amount": sign * float(rng.uniform(low, high))} if effect in NEEDS_AMOUNT else {}
    return {"kind": "telemetry", "quantity": quantity, "effect": effect, **amount}


def _trouble_at(rng: np.random.Generator, severity: Severity) -> float:
    return FIRST_TROUBLE_S + float(rng.uniform(0.0, severity.trouble_s))


def _vehicle(rng: np.random.Generator, count: int) -> int:
    return int(rng.integers(1, count + 1))


def _vector(rng: np.random.Generator, *limits: float) -> list[float]:
    return [float(rng.uniform(-each, each)) for each in limits]


def _one_of(rng: np.random.Generator, *choices: Choice) -> Choice:
    return choices[int(rng.integers(len(choices)))]
