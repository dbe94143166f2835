"""What `check` says about the path: how its legs are joined, how far it is from them, and from the fence."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from flight_model.legs.deviation import deviation
from flight_model.legs.path import LegsPath
from flight_model.stops.timetable import Timetable
from formation_scenario import Scenario
from formation_scenario.fence_distances import FenceDistance, fence_distances

FAR_M = 20.0
"""Distance of a spline from its legs, and outside its waypoints' heights, beyond which `check` warns."""
WIDER_M = 0.5
LISTED = 20
"""Number of slots whose distance to the fence is listed in words."""


def path_figures(scenario: Scenario) -> dict[str, Any]:
    """Return the path's greatest distance from its legs and outside its waypoints' heights, and each slot's fence."""
    figures: dict[str, Any] = {"length_m": scenario.leader_path.length_m}
    figures |= deviation(scenario.written_path, scenario.path.waypoints_m)._asdict()
    if slots := fence_distances(scenario):
        figures["fence"] = [
            {name: value for name, value in each._asdict().items() if value not in (math.inf, "")} for each in slots
        ]
    return figures


def path_text(scenario: Scenario) -> Iterator[str]:
    """Yield the same in words, and how waypoints are passed."""
    path, off = scenario.written_path, deviation(scenario.written_path, scenario.path.waypoints_m)
    kinds = _joints(path) if isinstance(path, LegsPath) else "one curve through all waypoints"
    yield f"path of {path.length_m:.0f} m: {kinds}"
    yield (
        f"at most {off.off_legs_m:.1f} m from its legs (at {off.off_legs_at_m:.0f} m), "
        f"{off.outside_heights_m:.1f} m outside its waypoints' heights"
    )
    yield from _timetable_text(scenario)
    yield from _fence_text(fence_distances(scenario))


def _timetable_text(scenario: Scenario) -> Iterator[str]:
    """Yield how slowly vehicles that hover pass corners, and for how long they stop."""
    planned = scenario.speeds
    if isinstance(planned, Timetable) and planned.passages:
        found = list[str]()
        corners_mps = [speed_mps for each, speed_mps in planned.flown if not each.stops]
        if corners_mps:
            found.append(f"its slowest corner is flown at {min(corners_mps):.3g} m/s")
        if planned.stops:
            held_s = sum(each.hold_s for each in planned.stops)
            turning_s = sum(each.turn_s for each in planned.stops)
            found.append(f"its stops last {sum(each.pause_s for each in planned.stops):.0f} s in all")
            found.append(f"of which it hovers for {held_s:.0f} s and turns for {turning_s:.0f} s")
        yield f"{', '.join(found)}; it ends after {planned.end_s:.0f} s"


def _fence_text(slots: list[FenceDistance]) -> Iterator[str]:
    for each in slots[:LISTED]:
        found = list[str]()
        if each.least_m != math.inf:
            where = f"at {each.at_m:.0f} m of the path (north {each.north_m:.0f}, east {each.east_m:.0f})"
            found.append(f"{each.least_m:.0f} m from {each.area} {where}")
        if each.height_m != math.inf:
            found.append(f"{each.height_m:.1f} m from the fence's heights")
        if found:
            yield f"{each.who}: at least {', '.join(found)}"
    if len(slots) > LISTED:
        yield f"{len(slots) - LISTED} more slots: farther from the fence"


def not_flown(scenario: Scenario) -> Iterator[str]:
    """Yield a warning of each thing in a mission file that isn't flown."""
    for text in scenario.path.not_flown:
        yield f"path: {text}"


def widened_circles(scenario: Scenario) -> Iterator[str]:
    """Yield a warning of each waypoint whose circles are wider than asked for."""
    path = scenario.written_path
    if not isinstance(path, LegsPath):
        return
    for each in scenario.path.circles:
        flown_m, asked_m = path.circle_radii_m.get(each.waypoint, 0.0), abs(each.radius_m)
        if asked_m and flown_m > asked_m + WIDER_M:
            where = f"path: circles at waypoint {each.waypoint}"
            yield f"{where} have a radius of {flown_m:.0f} m, not {asked_m:.0f}: so all slots can fly them"


def short_legs(scenario: Scenario) -> Iterator[str]:
    """Yield a warning of each leg that is too short for its planned speed."""
    for leg, reached_mps in scenario.short_legs.items():
        planned = f"path.speed_mps.{leg}: {scenario.path.legs_mps[leg]:g} m/s"
        where = "at most" if scenario.hovers else "at its end"
        yield f"{planned} isn't reached on so short a leg; {where} {reached_mps:.3g} m/s is flown"


def far_from_legs(scenario: Scenario) -> Iterator[str]:
    """Yield a warning of a spline that is farther than `FAR_M` from its legs, or outside its waypoints' heights."""
    if scenario.path.kind != "spline":
        return
    off = deviation(scenario.written_path, scenario.path.waypoints_m)
    for distance_m, at_m, what in (
        (off.off_legs_m, off.off_legs_at_m, "from the straight legs between its waypoints"),
        (off.outside_heights_m, off.outside_heights_at_m, "outside the heights of the waypoints around"),
    ):
        if distance_m > FAR_M:
            yield f"path: the curve is {distance_m:.0f} m {what}, at {at_m:.0f} m; path.kind: legs keeps to them"


def _joints(path: LegsPath) -> str:
    words = {
        "turn": "turns inside a waypoint",
        "over": "turns after a waypoint",
        "overshoot": "turns that overshoot a leg",
        "detour": "detours outside",
        "circle": "circled around",
        "stop": "stops",
    }
    counts = {kind: sum(each.kind == kind for each in path.passed) for kind in words}
    counted = ", ".join(f"{count} {words[kind]}" for kind, count in counts.items() if count)
    radius = f", of {path.tightest_m:.0f} m radius or more" if counted and math.isfinite(path.tightest_m) else ""
    return f"straight legs, {counted or 'no turns'}{radius}"
