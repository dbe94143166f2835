"""When a flight is over: at the path's end, and at `duration_s` at the latest."""

from __future__ import annotations

import math

import numpy as np

from formation_scenario.model import Scenario

POINTS = 1000
"""Of the path, at which the speed over the ground is taken."""
SLACK_S = 1.0
"""By how much a flight may end later than planned: the leader gains and loses metres in bends and gusts."""


def path_end_s(scenario: Scenario) -> float:
    """Return the mission time at which the leader is at the path's end, s: at its airspeed, in the scenario's wind.

    Infinite where the wind blows it back.

    Raises:
        PathError: no path leads through the waypoints.
    """
    path = scenario.path.written
    at_m = np.linspace(0.0, path.length_m, POINTS)
    course_rad = path.at(at_m).course_rad
    north_mps, east_mps, _ = scenario.wind.velocity_mps
    along_mps = north_mps * np.cos(course_rad) + east_mps * np.sin(course_rad)
    aside_mps = east_mps * np.cos(course_rad) - north_mps * np.sin(course_rad)
    speed_mps = np.sqrt(np.maximum(scenario.path.speed_mps**2 - aside_mps**2, 0.0)) + along_mps
    return math.inf if speed_mps.min() <= 0.0 else float(np.trapezoid(1.0 / speed_mps, at_m))


def planned_end_s(scenario: Scenario) -> float:
    """Return the mission time at which a flight is over, s, as planned; with orders, that may slow it, `duration_s`."""
    return scenario.duration_s if scenario.orders else min(scenario.duration_s, path_end_s(scenario))


def latest_end_s(scenario: Scenario) -> float:
    """Return the latest mission time, s, at which a flight may be over.

    Whatever may hold the leader up, or let one behind it take over, leaves `duration_s`.

    Raises:
        PathError: no path leads through the waypoints.
    """
    led_by_others = any(change.leader is not None for change in scenario.formation.changes)
    ways = [way for change in scenario.links.changes for way in (change, change.uplink, change.downlink)]
    cut_off = any(way is not None and way.outage for way in ways)
    if led_by_others or cut_off or scenario.faults or scenario.disturbances:
        return scenario.duration_s
    return min(scenario.duration_s, planned_end_s(scenario) + SLACK_S)
