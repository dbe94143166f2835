"""Whether a vehicle is where the scenario flies, before the first command."""

from __future__ import annotations

import math

import numpy as np

from formation_scenario.fields import distinct_texts
from gcs_formation.mission.gate import AsFound
from gcs_formation.vehicle.checks import Finding

HOME_OFF_M = 30.0
"""Largest height of a home above or below the scenario's ground, m: the sum of both heights' errors above sea level.
Tuned: m; 15 to 60; shown by `pytest tests/gcs_formation/features/preflight`."""
FAR_M = 10_000.0
"""How much farther from the path's start a vehicle may be than the path's farthest waypoint, m. Tuned: m; 2000 to 50
000; shown by `pytest tests/gcs_formation/features/preflight`."""


def findings(found: AsFound) -> list[Finding]:
    """Return the findings on a vehicle's position: far from the path, or a home that isn't on the scenario's ground.

    A vehicle that flies may have its home elsewhere: this is only a warning.
    """
    seen, scenario = found.seen.motion, found.scenario
    if seen is None:
        return []
    points_m = np.array(scenario.path.waypoints_m)[:, :2]
    away_m = math.hypot(seen.north_m - points_m[0, 0], seen.east_m - points_m[0, 1])
    max_m = float(np.hypot(*(points_m - points_m[0]).T).max()) + FAR_M
    if away_m > max_m:
        away, maximum = f"{away_m / 1000.0:.1f}", f"{max_m / 1000.0:.1f}"
        if away == maximum:
            away, maximum = distinct_texts(away_m / 1000.0, max_m / 1000.0)
        away_words = f"place: found {away} km from the path's start; allowed: up to {maximum} km"
        return [Finding(f"{away_words}. Set origin.lat_deg and lon_deg to the field's", refuses=True)]
    home_m, above_sea_m = seen.height_m - seen.above_home_m, scenario.origin.alt_m
    ground_m = float(scenario.ground.height(np.array([seen.north_m]), np.array([seen.east_m]))[0])
    if not abs(home_m - ground_m) > HOME_OFF_M:
        return []
    home = f"home: found {home_m + above_sea_m:.0f} m above sea level, where the scenario's ground is at"
    allowed = f"{ground_m + above_sea_m:.0f} m; allowed: {HOME_OFF_M:g} m off"
    mends = f"Set origin.alt_m, now {above_sea_m:g}, to the field's"
    return [Finding(f"{home} {allowed}. {mends}", refuses=not found.flies)]
