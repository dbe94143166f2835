"""Beginning and end of a flight: initial states of emulated vehicles, and the time at the path's end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from flight_model.arrays import Array, offset_points
from flight_model.stops.timetable import Timetable
from formation_scenario.model import Scenario
from formation_scenario.orders import Order, read_order
from formation_scenario.slot_assignment import slot_table
from formation_scenario.slot_frame import axis_rad

POINTS = 1000
"""Number of points of the path at which the ground speed is evaluated."""
SLACK_S = 1.0
"""Allowance for a late end: in bends and gusts the leader's progress differs from the plan by metres."""


@dataclass(frozen=True, slots=True)
class StartState:
    """State of a vehicle at boot: NED from the origin, height upwards, heading clockwise from north."""

    north_m: float
    east_m: float
    height_m: float = 0.0
    heading_rad: float = 0.0
    airspeed_mps: float = 0.0
    in_air: bool = False


def start_states(scenario: Scenario) -> list[StartState]:
    """Return each vehicle's start state, in the scenario's order.

    The leader starts `run_in_s` before the path's start, followers at their slots. In the air each follower is
    `start.offset_m` from its slot, and higher where the terrain's clearance requires it. On the ground they stand in a
    row if the scenario says so; otherwise those nearer to others than `safety.separation_m` are placed farther back.
    """
    leader = scenario.written_path.at(-scenario.run_in_m)
    in_air, slots, places = scenario.start.in_air, slot_table(scenario), np.zeros((len(scenario.vehicles), 3))
    slots = slots + np.array(scenario.start.offset_m) if in_air else _on_ground(scenario, slots)
    places[[vehicle.role == "follower" for vehicle in scenario.vehicles]] = slots
    in_row = not in_air and scenario.start.row_m is not None
    axis = leader.course_rad if in_row else axis_rad(scenario.formation.frame, leader.course_rad, leader.course_rad)
    north_m, east_m = offset_points(leader.north_m, leader.east_m, axis, places[:, 0], places[:, 1])
    height_m = leader.height_m + places[:, 2] if in_air else np.zeros_like(north_m)
    if in_air and scenario.terrain is not None:
        height_m = np.fmax(height_m, scenario.ground.height(north_m, east_m) + scenario.terrain.clearance_m)
    speed_mps = scenario.path.begin_mps if in_air else 0.0
    each = zip(north_m.tolist(), east_m.tolist(), height_m.tolist(), strict=True)
    return [StartState(*place, leader.course_rad, speed_mps, in_air) for place in each]


def _on_ground(scenario: Scenario, slots: Array) -> Array:
    if scenario.start.row_m is None:
        return _spread(slots, scenario.safety.separation_m)
    lateral_m = scenario.start.row_m * np.arange(1.0, len(slots) + 1.0)
    return np.column_stack((np.zeros(len(slots)), lateral_m, np.zeros(len(slots))))


def _spread(slots: Array, separation_m: float) -> Array:
    """Return slots moved so that they are at least `separation_m` apart horizontally, and from the leader.

    A follower that is too near to an earlier one moves straight back, in steps of twice the separation.
    """
    taken = [np.zeros(2)]
    step = np.array([2.0 * separation_m, 0.0])
    for slot in slots[:, :2]:
        place = slot.copy()
        while min(np.hypot(*(place - other)) for other in taken) < separation_m * (1.0 - 1e-9):
            place = place - step
        taken.append(place)
    return np.column_stack((np.array(taken[1:]).reshape(-1, 2), slots[:, 2]))


def wind_mps(scenario: Scenario, course_rad: Array) -> tuple[Array, Array]:
    """Return the wind that carries the leader, along courses and to their right, m/s."""
    north_mps, east_mps = scenario.drift_mps
    cos, sin = np.cos(course_rad), np.sin(course_rad)
    return north_mps * cos + east_mps * sin, east_mps * cos - north_mps * sin


def over_ground_mps(scenario: Scenario, course_rad: Array, airspeed_mps: float | Array) -> Array:
    """Return the leader's ground speed along courses at airspeeds, m/s, with the crab angle that the wind requires."""
    along_mps, crosswind_mps = wind_mps(scenario, course_rad)
    return np.sqrt(np.maximum(airspeed_mps**2 - crosswind_mps**2, 0.0)) + along_mps


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
    ways = [way for change in scenario.links.changes for way in (change, change.uplink, change.downlink)]
    cut_off = any(way is not None and way.outage for way in ways)
    if led_by_others or cut_off or scenario.faults or scenario.disturbances:
        return scenario.duration_s
    return min(scenario.duration_s, planned_end_s(scenario) + SLACK_S)
