"""The leader's path over hills: as written, but lifted where it would be too near to the ground."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import overload

import numpy as np

from formation_scenario.arrays import Array
from formation_scenario.ground import Ground, ground_of
from formation_scenario.lift import STEP_M, Bounds, Lift, blend, least_lift, sample_places
from formation_scenario.model import Scenario
from formation_scenario.path import PathPoint, PathPoints, SplinePath

LEADER_SHARE = 0.7
"""Share of the climb limit that the lifted path uses; followers and disturbances need the rest."""
FOLLOWER_SHARE = 0.85
"""Share of the climb limit that the path and a follower's own lift use together."""


class LiftedPath(SplinePath):
    """A path with a lift. It begins at the height that is written; the straight run-in before it is level."""

    def __init__(self, waypoints_m: Sequence[Sequence[float]] | Array, lift: Lift) -> None:
        """Take the waypoints as for `SplinePath`, and the lift from 0 to the path's length."""
        super().__init__(waypoints_m)
        self.lift = lift
        self._control_m: list[float] = lift.control_m.tolist()

    @overload
    def at(self, s: float) -> PathPoint: ...
    @overload
    def at(self, s: Array) -> PathPoints: ...
    def at(self, s: float | Array) -> PathPoint | PathPoints:
        """Return the lifted path at an arc length in m, or at an array of them."""
        if isinstance(s, np.ndarray):
            return self._raised(s, super().at(s))
        point = super().at(s)
        steps = min(max(s, 0.0), self.length_m) / STEP_M
        index = min(int(steps), len(self._control_m) - 4)
        lift_m, slope, curvature = blend(self._control_m[index : index + 4], steps - index)
        if s < 0.0 or s > self.length_m:
            return point._replace(height_m=point.height_m + lift_m)
        return point._replace(
            height_m=point.height_m + lift_m,
            slope=point.slope + slope,
            slope_rate_1pm=point.slope_rate_1pm + curvature,
        )

    def _raised(self, s: Array, points: PathPoints) -> PathPoints:
        inside = np.clip(s, 0.0, self.length_m)
        lift_m, slope, curvature = self.lift.at(inside)
        on_path = s == inside
        return points._replace(
            height_m=points.height_m + lift_m,
            slope=points.slope + np.where(on_path, slope, 0.0),
            slope_rate_1pm=points.slope_rate_1pm + np.where(on_path, curvature, 0.0),
        )


def leader_path(scenario: Scenario, ground: Ground | None = None) -> SplinePath:
    """Return the path that the leader flies: lifted where the scenario has terrain, as written otherwise.

    Raises:
        ElevationError: no ground was given, and the elevation file can't be read.
    """
    waypoints, terrain = scenario.path.waypoints_m, scenario.terrain
    path = SplinePath(waypoints)
    if terrain is None:
        return path
    ground = ground_of(scenario) if ground is None else ground
    places = sample_places(0.0, max(1, int(np.ceil(path.length_m / STEP_M))))
    points = path.at(places)
    needed = ground.height(points.north_m, points.east_m) + terrain.clearance_m - points.height_m
    lift = least_lift(0.0, needed, points.slope, rise_bounds(scenario, LEADER_SHARE), np.zeros(3))
    return LiftedPath(waypoints, lift)


def rise_bounds(scenario: Scenario, share: float) -> Bounds:
    """Return bounds of a path that every vehicle can follow with a share of its climb limit, in a tailwind.

    The climb rate may change by its limit within twice the sum of the height's time constants in (7).
    """
    models = [vehicle.model for vehicle in scenario.vehicles]
    climb_mps = min(model.climb_max_mps for model in models)
    lag_s = max(model.tau_ha_s + model.tau_hb_s for model in models)
    wind = scenario.wind.velocity_mps
    speed_mps = scenario.path.speed_mps + hypot(wind[0], wind[1])
    return Bounds(share * climb_mps / speed_mps, climb_mps / (2.0 * lag_s) / speed_mps**2)
