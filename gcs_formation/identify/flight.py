"""The flight that a vehicle's model is identified by: straight on, with steps, ramps and doublets of all setpoints."""

from __future__ import annotations

from typing import Any

import numpy as np

from formation_scenario import Scenario, load_scenario
from formation_scenario.lifted_path import leader_path
from formation_scenario.steps import Step

REST_S, STEP_S = 8.0, 9.0
SPEED_MPS, SLOW_MPS, HEADING_DEG, HEIGHT_M = 2.0, 1.0, 15.0, 8.0
SPACING_M = 60.0
"""Followers keep at least so far away."""
LEGS = 12
"""Waypoints of the straight path."""


def steps(spare_mps: float) -> list[Step]:
    """Return the steps, one after another; no speed beyond what vehicles can spare."""
    fast, slow = min(SPEED_MPS, 0.6 * spare_mps), min(SLOW_MPS, 0.3 * spare_mps)
    each: list[dict[str, float]] = [
        {"speed_mps": fast}, {"speed_mps": -fast},
        {"speed_mps": slow, "ramp_s": 4.0}, {"speed_mps": -slow, "ramp_s": 4.0},
        {"heading_deg": HEADING_DEG}, {"heading_deg": -HEADING_DEG},
        {"heading_deg": HEADING_DEG, "ramp_s": 4.0}, {"heading_deg": -HEADING_DEG, "ramp_s": 4.0},
        {"height_m": HEIGHT_M}, {"height_m": -HEIGHT_M},
        {"height_m": HEIGHT_M, "ramp_s": 4.0}, {"height_m": -HEIGHT_M, "ramp_s": 4.0},
    ]  # fmt: skip
    found, at_s = list[Step](), REST_S
    for index, keys in enumerate(each):
        found.append(Step(at_s=at_s, for_s=STEP_S, **keys))
        # A step and the opposite one after it are a doublet.
        at_s += STEP_S + (0.0 if index % 2 == 0 else REST_S)
    return found


def identification_scenario(scenario: Scenario) -> Scenario:
    """Return the flight by which to identify the vehicles of a scenario: from its path's start straight on.

    Raises:
        ScenarioError: it can't be flown there, because of ground or fence.
    """
    path = leader_path(scenario)
    begin = path.at(0.0)
    models = [vehicle.model for vehicle in scenario.vehicles]
    speed = scenario.path.speed_mps
    spare = min(min(each.speed_max_mps - speed, speed - each.speed_min_mps) for each in models)
    flown = steps(spare)
    last_s = flown[-1].at_s + flown[-1].for_s + REST_S
    along = np.linspace(0.0, (last_s + REST_S) * (speed + SPEED_MPS), LEGS)
    north, east = np.cos(begin.course_rad), np.sin(begin.course_rad)
    data: dict[str, Any] = scenario.model_dump(by_alias=True, exclude_none=True)
    data |= {
        "name": f"{scenario.name}-identify"[:80],
        "duration_s": last_s,
        "formation": {"shape": scenario.formation.shape, "spacing_m": max(SPACING_M, scenario.formation.spacing_m)}
        if scenario.formation.shape != "custom"
        else {"shape": "custom", "slots_m": data["formation"]["slots_m"]},
        "path": {
            "speed_mps": speed,
            "waypoints_m": [
                [begin.north_m + far * north, begin.east_m + far * east, scenario.path.waypoints_m[0][2]]
                for far in along.tolist()
            ],
            "steps": [each.model_dump() for each in flown],
        },
    }
    for key in ("orders", "faults", "expect", "disturbances"):
        data.pop(key, None)
    return load_scenario(data)
