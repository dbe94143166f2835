"""The flight that identifies vehicles: steps, doublets and ramps along a straight line."""

from __future__ import annotations

from typing import Any

import numpy as np

from formation_scenario import Scenario, load_scenario
from formation_scenario.formation import Step

REST_S, HELD_S = 8.0, 9.0
SPEED_MPS, SLOW_MPS, HEADING_DEG, HEIGHT_M = 2.0, 1.0, 15.0, 8.0
SPACING_S = 3.0
"""Followers stay at least this flight time away: farther slots swing with the leader's steps of heading, faster than
any vehicle follows."""
LEGS = 12
"""Number of waypoints of the straight path."""


def steps(spare_mps: float) -> list[Step]:
    """Return the steps, one after another, within the vehicles' spare speed."""
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
        found.append(Step(at_s=at_s, for_s=HELD_S, **keys))
        # Each step and the opposite one after it form a doublet.
        at_s += HELD_S + (0.0 if index % 2 == 0 else REST_S)
    return found


def identification_scenario(scenario: Scenario) -> Scenario:
    """Return a flight that identifies the vehicles of a scenario: steps along a straight line from its path's start.

    Raises:
        ScenarioError: it can't be flown there, because of ground or fence.
    """
    path = scenario.leader_path
    begin = path.at(0.0)
    models = [vehicle.model for vehicle in scenario.vehicles]
    speed = scenario.path.begin_mps
    spare = min(min(each.speed_max_mps - speed, speed - each.speed_min_mps) for each in models)
    flown, spacing_m = steps(spare), max(SPACING_S * speed, scenario.formation.spacing_m)
    last_s = flown[-1].at_s + flown[-1].for_s + REST_S
    along = np.linspace(0.0, (last_s + REST_S) * (speed + SPEED_MPS), LEGS)
    north, east = np.cos(begin.course_rad), np.sin(begin.course_rad)
    data: dict[str, Any] = scenario.model_dump(by_alias=True, exclude_none=True)
    data |= {
        "name": f"{scenario.name}-identify"[:80],
        "duration_s": last_s,
        "formation": {"shape": scenario.formation.shape, "spacing_m": spacing_m}
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
    return load_scenario(data, plugins=scenario.registered)
