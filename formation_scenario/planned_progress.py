"""When the leader is planned to be where on its path, and when the flight ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from flight_model.arrays import Array
from flight_model.stops.timetable import Timetable
from formation_scenario.model import Scenario
from formation_scenario.orders import Order, read_order
from formation_scenario.wind_triangle import over_ground_mps

POINTS = 1000
"""Number of points of the path at which the ground speed is evaluated."""
SLACK_S = 1.0
"""Allowance for a late end: in bends and gusts the leader's progress differs from the plan by metres."""


def path_end_s(scenario: Scenario) -> float:
    """Return the mission time at which the leader reaches the path's end, s: at its airspeed, in the scenario's wind.

    It is infinite if the wind blows the leader back. Multirotors fly the speed over ground in any wind.

    Raises:
        PathError: no path leads through the waypoints.
    """
    return float(_progress(scenario)[1][-1])


def planned_m(scenario: Scenario, mission_s: Array, speeds_mps: Sequence[tuple[float, float]] = ()) -> Array:
    """Return the leader's planned distances along its path at mission times, m.

    `speeds_mps`: rising mission times at which another speed was ordered, and this speed.
    """
    at_m, times_s = _progress(scenario)
    found, plan = np.interp(mission_s, times_s, at_m), partial(np.interp, xp=times_s, fp=at_m)
    for since_s, speed_mps in speeds_mps:
        here_m = float(plan(since_s))
        if speed_mps > 0.0:
            _, times_s = _progress(scenario.at_speed(speed_mps))
            plan = partial(np.interp, xp=times_s + (since_s - float(np.interp(here_m, at_m, times_s))), fp=at_m)
        else:
            plan = partial(np.interp, xp=np.array([since_s]), fp=np.array([here_m]))
        found = np.where(mission_s >= since_s, plan(mission_s), found)
    return found


def _progress(scenario: Scenario) -> tuple[Array, Array]:
    """Return distances along the path, m, and when the leader is there, s; infinite if the wind blows it back."""
    speeds, path = scenario.speeds, scenario.written_path
    if isinstance(speeds, Timetable):
        return speeds.progress()
    at_m = np.linspace(0.0, path.length_m, POINTS)
    speed_mps = over_ground_mps(scenario, path.at(at_m).course_rad, speeds.at_each(at_m))
    if speed_mps.min() <= 0.0:
        return at_m, np.where(at_m > 0.0, math.inf, 0.0)
    took_s = np.diff(at_m) * (1.0 / speed_mps[1:] + 1.0 / speed_mps[:-1]) / 2.0
    return at_m, np.concatenate((np.zeros(1), np.cumsum(took_s)))


def planned_end_s(scenario: Scenario) -> float:
    """Return the planned mission time of the flight's end, s; with orders that may slow it, `duration_s`."""
    slowed = any(_may_slow(read_order(each.order)) for _, each in scenario.timed_orders)
    return scenario.duration_s if slowed else min(scenario.duration_s, path_end_s(scenario))


def _may_slow(order: Order) -> bool:
    led_by_another = order.change is not None and order.change.leader is not None
    return led_by_another or order.speed_mps is not None or order.heading_rad is not None


def planned_times_s(scenario: Scenario) -> dict[str, list[float]]:
    """Return the mission times, s, of all that a scenario plans, by the keys of its lists."""
    return {
        "formation.changes": [each.at_s for each in scenario.formation.changes],
        "path.steps": [each.at_s for each in scenario.path.steps],
        "links.changes": [each.at_s for each in scenario.links.changes],
        "disturbances": [each.at_s for each in scenario.disturbances],
        "orders": [each.at_s for _, each in scenario.timed_orders],
        "faults": [each.at_s for each in scenario.faults],
    }


def latest_end_s(scenario: Scenario) -> float:
    """Return the latest mission time, s, at which a flight may end.

    If anything may delay the leader, or let a vehicle behind it take over, this is `duration_s`.

    Raises:
        PathError: no path leads through the waypoints.
    """
    led_by_others = any(change.leader is not None for change in scenario.formation.changes)
    patches = [patch for change in scenario.links.changes for patch in (change, change.uplink, change.downlink)]
    cut_off = any(patch is not None and patch.outage for patch in patches)
    if led_by_others or cut_off or scenario.faults or scenario.disturbances:
        return scenario.duration_s
    return min(scenario.duration_s, planned_end_s(scenario) + SLACK_S)
