"""Route tracking: heading and height along a route, and projection onto it."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from mypy_extensions import mypyc_attr

from flight_model.autopilot_model import AutopilotModel, crab_rad, rotated, squared, within
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.path import Route
from flight_model.path_offsets import Rise
from flight_model.slot import LEADS_FROM_MPS

MIN_MPS: Final = 1.0
"""Lower bound of a speed along a route that is divided by: a vehicle that can hover may have none."""
NEWTON_STEPS: Final = 3
NEAR_ENOUGH_M: Final = 1e-9
NEAREST_STEP_M: Final = 10.0
TAKEOVER_INTERCEPT_MAX_RAD: Final = math.radians(30.0)
"""Largest angle to the path at which a route onto it continues a vehicle's own course."""


@mypyc_attr(acyclic=True, free_list_len=1)
class RouteHeading:
    """Heading, turn rate and climb of a vehicle on a route, corrected for wind."""

    def __init__(
        self, heading_rad: float, turn_rps: float, bend_rps2: float, climb_mps: float, along_mps: float
    ) -> None:
        """Take the heading and its first two derivatives, the climb, and the velocity over ground along the route."""
        self.heading_rad = heading_rad
        self.turn_rps = turn_rps
        self.bend_rps2 = bend_rps2
        self.climb_mps = climb_mps
        self.along_mps = along_mps


def route_heading(point: PathPoint, state: FlightState) -> RouteHeading:
    """Return the heading along the route at a vehicle's nearest point, its rates, and the climb there."""
    along_mps, _ = _along_and_across(state, point.course_rad)
    return RouteHeading(
        point.course_rad - crab_rad(state, point.course_rad),
        point.curvature_1pm * along_mps,
        point.curvature_rate_1pm2 * squared(along_mps),
        point.slope * along_mps,
        along_mps,
    )


def project(route: Route, north_m: float, east_m: float, near_m: float) -> float:
    """Return the distance along the route of the point nearest to a position, by Newton's method from `near_m`."""
    distance_m = near_m
    for _ in range(NEWTON_STEPS):
        point = route.at(distance_m)
        along_m, right_m = rotated(point.course_rad, north_m - point.north_m, east_m - point.east_m)
        step_m = along_m / max(1.0 - point.curvature_1pm * right_m, 0.2)
        distance_m += step_m
        if abs(step_m) < NEAR_ENOUGH_M:
            break
    return distance_m


def nearest(route: Route, north_m: float, east_m: float, from_m: float, to_m: float) -> float:
    """Return the distance along the route of the point nearest to a position, of those between two distances."""
    steps = max(1, math.ceil((to_m - from_m) / NEAREST_STEP_M))
    candidates = [from_m + (to_m - from_m) * step / steps for step in range(steps + 1)]

    def away_m(distance_m: float) -> float:
        point = route.at(distance_m)
        return math.hypot(north_m - point.north_m, east_m - point.east_m)

    return min(max(project(route, north_m, east_m, min(candidates, key=away_m)), from_m), to_m)


def height_setpoint_m(point: PathPoint, state: FlightState, model: AutopilotModel) -> float:
    """Return the height setpoint that keeps a vehicle on its route, whose nearest point is `point`.

    The route's climb is fed forward through both time constants of (7), and the updraught, which (7) climbs with, is
    taken off.
    """
    along_mps, _ = _along_and_across(state, point.course_rad)
    rise_mps = point.slope * along_mps - state.updraught_mps
    height_m = point.height_m + (model.tau_ha_s + model.tau_hb_s) * rise_mps
    return height_m + model.tau_ha_s * model.tau_hb_s * point.slope_rate_1pm * squared(along_mps)


def _along_and_across(state: FlightState, course_rad: float) -> tuple[float, float]:
    """Return the velocity over ground along a course and to its right."""
    north_mps, east_mps = state.ground_mps()
    return rotated(course_rad, north_mps, east_mps)


class Abreast(NamedTuple):
    """The position of a vehicle that takes the lead, off a point of the path; its route onto the path begins there."""

    point: PathPoint
    right_m: float
    up_m: float

    def rise(self, state: FlightState, commanded_m: float, model: AutopilotModel, speed_mps: float) -> Rise:
        """Return the differences of a vehicle's height, slope and slope rate from the path's.

        It flies at `speed_mps` along the path and follows the height setpoint `commanded_m`; NaN where there is none.
        """
        climb_mps, tau_a_s, tau_b_s = state.climb_mps, model.tau_ha_s, model.tau_hb_s
        max_mps2 = model.climb_max_mps / (2.0 * (tau_a_s + tau_b_s))
        to_climb_m = 0.0 if math.isnan(commanded_m) else commanded_m - state.height_m
        change_mps2 = (to_climb_m - (tau_a_s + tau_b_s) * climb_mps) / (tau_a_s * tau_b_s)
        change_mps2 = min(max(change_mps2, -max_mps2), max_mps2)
        # Per metre of the path: on the inside of a bend, the vehicle covers less distance than the path.
        along_mps = max(speed_mps, MIN_MPS) / (1.0 - self.point.curvature_1pm * self.right_m)
        slope = climb_mps / along_mps - self.point.slope
        return Rise(self.up_m, slope, change_mps2 / along_mps**2 - self.point.slope_rate_1pm)

    def lateral_slope(self, state: FlightState) -> float:
        """Return a vehicle's motion to the right per metre of the path; 0 if it is slower than `LEADS_FROM_MPS`."""
        north_mps, east_mps = state.ground_mps()
        if math.hypot(north_mps, east_mps) < LEADS_FROM_MPS:
            return 0.0
        off_rad = math.remainder(math.atan2(east_mps, north_mps) - self.point.course_rad, math.tau)
        along = 1.0 - self.point.curvature_1pm * self.right_m
        return along * math.tan(within(off_rad, -TAKEOVER_INTERCEPT_MAX_RAD, TAKEOVER_INTERCEPT_MAX_RAD))


def course_or_heading(state: FlightState) -> float:
    """Return the course over ground, or the heading of a vehicle that hovers, whose velocity is noise."""
    north_mps, east_mps = state.ground_mps()
    if math.hypot(north_mps, east_mps) < LEADS_FROM_MPS:
        return state.heading_rad
    return math.atan2(east_mps, north_mps)
