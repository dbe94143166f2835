"""By how much vehicles that navigate by inertia drift until the end of a flight: the errors of the flown navigators."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache, partial
from typing import Final, NamedTuple

import numpy as np

from formation_scenario import Scenario, Vehicle
from formation_scenario.navigation import InertialNavigation, Navigation
from formation_scenario.planned_progress import planned_end_s
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import slot_schedule
from sim_vehicles.inertial.growth import growth

DRIFT_SIGMAS: Final = 3.0
"""Standard deviations of the drift that must fit into the room left."""


class Drift(NamedTuple):
    """Standard deviations by the end of a flight, m; 0 where every vehicle's are bounded."""

    after_s: float
    level_m: float
    """Of two vehicles' positions against each other, along a horizontal axis."""
    height_m: float
    """Of a height by inertia alone."""


def drift(scenario: Scenario) -> Drift | None:
    """Return how far positions drift apart and heights drift by the end of the flight; None with GNSS in all."""
    after_s = scenario.start.run_in_s + planned_end_s(scenario)
    each = [_navigation(vehicle) for vehicle in scenario.vehicles]
    adrift = [keys for keys in each if isinstance(keys, InertialNavigation) and keys.aiding != "gnss"]
    if not adrift:
        return None
    # Equal biases move all vehicles alike.
    alike = all(keys == each[0] and keys.biases == "keys" for keys in adrift) and len(adrift) == len(each)
    north_mps, east_mps = _velocity_mps(scenario)
    grows = cache(partial(growth, lat_rad=math.radians(scenario.origin.lat_deg), after_s=after_s))
    drifts_m = [grows(keys, north_mps=north_mps, east_mps=east_mps, biases=not alike).level_m for keys in adrift]
    alone = [keys for keys in adrift if keys.aiding == "none"]
    heights_m = [grows(keys, north_mps=north_mps, east_mps=east_mps).height_m for keys in alone]
    return Drift(after_s, math.hypot(*sorted(drifts_m)[-2:]), max(heights_m, default=0.0))


def drifts(scenario: Scenario, found: Drift) -> Iterator[str]:
    """Yield by how much positions drift apart and heights drift, where it exceeds the room."""
    kept_m, words = _left_between_m(scenario), f"(1 sigma) within {found.after_s:.0f} s"
    if DRIFT_SIGMAS * found.level_m > kept_m:
        yield (
            f"navigation: positions drift apart by {found.level_m:.1f} m north and east {words} by inertia without "
            f"gnss, and slots leave {kept_m:.3g} m beyond safety.separation_m; aiding: gnss holds them"
        )
    if found.height_m > 0.0 and DRIFT_SIGMAS * found.height_m > (over_m := _left_below_m(scenario)):
        yield (
            f"navigation: heights drift by {found.height_m:.1f} m {words} by inertia alone, and {over_m:.3g} m are "
            "left above ground beyond safety.clearance_m; aiding: baro or gnss holds them"
        )


def _navigation(vehicle: Vehicle) -> Navigation:
    return vehicle.true_navigation or vehicle.navigation


def _velocity_mps(scenario: Scenario) -> tuple[float, float]:
    """Return the velocity at the path's start, north and east."""
    course_rad, speed_mps = scenario.leader_path.at(0.0).course_rad, scenario.path.begin_mps
    return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)


def _left_between_m(scenario: Scenario) -> float:
    """Return by how much the distance of the nearest two slots exceeds the required separation, m."""
    first, nearest_m = 0 if scenario.leader else 1, math.inf
    for step in slot_schedule(scenario):
        places_m = step.positions_m[first:]
        away_m = np.linalg.norm(places_m[:, None] - places_m, axis=2) + np.diag(np.full(len(places_m), np.inf))
        nearest_m = min(nearest_m, float(away_m.min(initial=math.inf)))
    return nearest_m - scenario.safety.separation_m


def _left_below_m(scenario: Scenario) -> float:
    """Return by how much the path's height above ground exceeds the required clearance where it is lowest, m."""
    points = SampledPath.along(scenario.leader_path).points
    over_m = points.height_m - scenario.ground.height(points.north_m, points.east_m)
    return float(over_m.min()) - scenario.safety.clearance_m
