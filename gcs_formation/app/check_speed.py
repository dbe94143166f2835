"""What `check` says of speeds: how much vehicles have left to close on their slots with."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from flight_model.path import PathPoints
from formation_scenario import Scenario
from formation_scenario.demands import SampledPath
from formation_scenario.environment import DrydenTurbulence
from formation_scenario.orders import parse_order
from formation_scenario.slot_assignment import SlotStep, columns, slot_schedule
from formation_scenario.slot_motion import Course, SlotMotion, slot_needs

SIGMAS = 2.0
"""Standard deviations of the difference of two vehicles' gusts along the path that should be left of a speed."""
LIGHT_MPS = 3.0
"""Wind 6 m above ground in whose turbulence every formation should keep its slots."""
PLENTY = (math.inf, "")


def little_left(scenario: Scenario) -> Iterator[str]:
    """Yield which speeds leave some fixed wing too little to hold its slot against gusts, faster or slower.

    What hovers holds its velocity over ground by itself.
    """
    if scenario.hovers:
        return
    points, steps = SampledPath.along(scenario.leader_path).points, slot_schedule(scenario)
    wanted_mps = gusts_mps(scenario)
    orders = {f"orders.{i}": parse_order(order.order).speed_mps for i, order in enumerate(scenario.orders)}
    for key, speed in {"path.speed_mps": scenario.path.speed_mps, **orders}.items():
        if speed is None or not all(
            each.model.speed_min_mps <= speed <= each.model.speed_max_mps for each in scenario.vehicles
        ):
            continue
        sides = zip(*(_left(scenario, points, step, speed) for step in steps), strict=True)
        for left_mps, found in (min((found for each in side for found in each), default=PLENTY) for side in sides):
            if left_mps < wanted_mps:
                left = f"{left_mps:.2g} m/s is left" if left_mps > 0.0 else "nothing is left"
                yield f"{key}: found {speed:g}; {found}: {left}, {wanted_mps:.2g} should be to hold it against gusts"


def gusts_mps(scenario: Scenario) -> float:
    """Return which difference of airspeed along the path gusts ask for, m/s: those of the scenario, or light ones."""
    height_m = np.array([min(height_m for _, _, height_m in scenario.path.waypoints_m)])
    found = [_dryden_mps(DrydenTurbulence(at_s=0.0, kind="dryden", wind_6m_mps=LIGHT_MPS), height_m)]
    for each in scenario.disturbances:
        if isinstance(each, DrydenTurbulence):
            found.append(_dryden_mps(each, height_m))
        elif each.vehicles != "all":
            found.append(math.hypot(*each.velocity_mps[:2]))
    return max(found)


def _dryden_mps(keys: DrydenTurbulence, height_m: Array) -> float:
    return SIGMAS * math.sqrt(2.0) * float(keys.scales(height_m)[0][0, 0])


def _left(
    scenario: Scenario, points: PathPoints, step: SlotStep, speed_mps: float
) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
    """Return what each follower has left below its slot's least speed and above its highest, m/s, in words too.

    With the wind behind it a leader turns faster than in still air.
    """
    course, windy = Course.along(points, speed_mps), 1.0 + math.hypot(*scenario.wind.velocity_mps[:2]) / speed_mps
    course = course._replace(turn_rate_rps=windy * course.turn_rate_rps)
    needs_mps = slot_needs(course, SlotMotion.at_rest(step.places_m), scenario.formation.frame).speed_mps
    below, above = list[tuple[float, str]](), list[tuple[float, str]]()
    for column, vehicle in enumerate(columns(scenario)):
        if vehicle is None or column == step.arrangement.leader:
            continue
        whose = f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape} is flown at"
        least_mps, most_mps = float(needs_mps[:, column].min()), float(needs_mps[:, column].max())
        slowest_mps, fastest_mps = vehicle.model.soon_mps(speed_mps)
        below.append((least_mps - slowest_mps, f"{whose} {least_mps:.3g} m/s, and {slowest_mps:.3g} is its least"))
        above.append((fastest_mps - most_mps, f"{whose} {most_mps:.3g} m/s, and {fastest_mps:.3g} is its most"))
    return below, above
