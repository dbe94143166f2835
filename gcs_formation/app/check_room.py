"""What `check` says about room: speed left to hold slots."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from flight_model.path import PathPoints
from formation_scenario import Scenario
from formation_scenario.orders import read_order
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import SlotStep, slot_schedule, vehicles_by_index
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.surroundings import DrydenTurbulence, OwnDisturbance

GUST_SIGMAS = 2.0
"""Gusts along the path that the remaining speed must cover: standard deviations of two vehicles' difference."""
LIGHT_MPS = 3.0
"""Wind 6 m above ground in whose turbulence every formation should hold its slots."""
PLENTY = (math.inf, "")


def little_left(scenario: Scenario) -> Iterator[str]:
    """Yield the speeds at which some fixed wing has too little speed left to hold its slot against gusts.

    Multirotors hold their velocity over ground by themselves.
    """
    if scenario.hovers:
        return
    sampled, steps = SampledPath.along(scenario.leader_path), slot_schedule(scenario)
    at_m, points = sampled.at_m, sampled.points
    wanted_mps = gusts_mps(scenario)
    orders = {f"orders.{i}": read_order(order.order).speed_mps for i, order in scenario.timed_orders}
    speeds = scenario.path.speed_mps
    legs = {f"path.speed_mps.{speeds.index(each)}": each for each in speeds} if isinstance(speeds, tuple) else {}
    legs = legs or {"path.speed_mps": scenario.path.begin_mps}
    for key, speed in {**legs, **orders}.items():
        if speed is None or not all(low <= speed <= high for low, high in map(scenario.speeds_mps, scenario.vehicles)):
            continue
        near = scenario.speeds.near(at_m, speed) if key in legs else np.ones(at_m.size, dtype=np.bool_)
        if not near.any():  # of a leg that is too short to reach its speed
            continue
        flown = points.only(near)
        sides = zip(*(_left(scenario, flown, step, speed) for step in steps), strict=True)
        for left_mps, found in (min((found for each in side for found in each), default=PLENTY) for side in sides):
            if left_mps < wanted_mps:
                left = f"{left_mps:.2g} m/s is left" if left_mps > 0.0 else "nothing is left"
                yield f"{key}: found {speed:g}; {found}: {left}, {wanted_mps:.2g} should be to hold it against gusts"


def gusts_mps(scenario: Scenario) -> float:
    """Return the difference of airspeed along the path that gusts ask for, m/s: the scenario's gusts, or light ones."""
    height_m = np.array([min(height_m for _, _, height_m in scenario.path.waypoints_m)])
    found = [_dryden_mps(DrydenTurbulence(at_s=0.0, kind="dryden", wind_6m_mps=LIGHT_MPS), height_m)]
    for each in scenario.disturbances:
        if isinstance(each, DrydenTurbulence):
            found.append(_dryden_mps(each, height_m))
        elif each.vehicles != "all" and not isinstance(each, OwnDisturbance):
            found.append(math.hypot(*each.velocity_mps[:2]))
    return max(found)


def _dryden_mps(keys: DrydenTurbulence, height_m: Array) -> float:
    return GUST_SIGMAS * math.sqrt(2.0) * float(keys.scales(height_m)[0][0, 0])


def _left(
    scenario: Scenario, points: PathPoints, step: SlotStep, speed_mps: float
) -> tuple[list[tuple[float, str]], list[tuple[float, str]]]:
    """Return each follower's speed left below its slot's slowest and above its slot's fastest, m/s, with words.

    A leader with the wind behind it turns faster than in still air.
    """
    flight, windy = LeaderFlight.along(points, speed_mps), 1.0 + scenario.wind.speed_mps / speed_mps
    flight = flight._replace(turn_rate_rps=windy * flight.turn_rate_rps)
    needs_mps = slot_needs(flight, SlotMotion.at_rest(step.positions_m), scenario.formation.frame).speed_mps
    below, above = list[tuple[float, str]](), list[tuple[float, str]]()
    for index, vehicle in enumerate(vehicles_by_index(scenario)):
        if vehicle is None or index == step.arrangement.leader:
            continue
        whose = f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape} is flown at"
        min_mps, max_mps = float(needs_mps[:, index].min()), float(needs_mps[:, index].max())
        slowest_mps, fastest_mps = vehicle.model.soon_mps(speed_mps)
        below.append((min_mps - slowest_mps, f"{whose} {min_mps:.3g} m/s, and {slowest_mps:.3g} is its least"))
        above.append((fastest_mps - max_mps, f"{whose} {max_mps:.3g} m/s, and {fastest_mps:.3g} is its most"))
    return below, above
