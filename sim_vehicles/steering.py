"""From what vehicles are to do (a heading, a course, a circle) to the model's commands, for all of them at once."""

from __future__ import annotations

import numpy as np

from sim_vehicles.config import Airframe
from sim_vehicles.dynamics import Array, Command, Parameters, State

HEADING, COURSE, CIRCLE = 0, 1, 2
LEAST_RADIUS_M = 60.0
"""WP_LOITER_RAD of an ArduPlane."""
WIDER_THAN_TIGHTEST = 1.3
CAPTURE = 2.0
"""Steepness of the approach to a circle: radians off the tangent for each radius of distance from it."""
GROUND_SPEED_LEAST_MPS = 1.0


class Steering:
    """Targets of N vehicles; vehicles write their own element, the main loop reads them all."""

    def __init__(self, airframes: list[Airframe], cruise_mps: float) -> None:
        """Start with nobody moving."""
        count = len(airframes)
        self.kind = np.zeros(count, dtype=np.int8)
        self.speed_mps: Array = np.zeros(count)
        self.direction_rad: Array = np.zeros(count)
        self.height_m: Array = np.zeros(count)
        self.lateral_mps2: Array = np.full(count, np.inf)
        self.centre_m: Array = np.zeros((2, count))
        self.radius_m: Array = np.array([loiter_radius_m(each, cruise_mps) for each in airframes])
        self.stopped = np.ones(count, dtype=np.bool_)
        """On the ground with the throttle at 0."""

    def commands(self, state: State, parameters: Parameters, drift_mps: Array) -> Command:
        """Return what the model is told this loop."""
        heading = self.direction_rad
        if self.kind.any():
            heading = np.where(self.kind == CIRCLE, self._round(state, parameters), heading)
            heading = np.where(self.kind == HEADING, heading, heading - _crab(heading, state, drift_mps))
        flying = np.clip(self.speed_mps, parameters.speed_min_mps, parameters.speed_max_mps)
        return Command(
            speed_mps=np.where(self.stopped, 0.0, flying),
            heading_rad=np.where(self.stopped, state.heading_rad, heading),
            height_m=self.height_m,
            turn_rate_rps=self.lateral_mps2 / np.maximum(state.airspeed_mps, GROUND_SPEED_LEAST_MPS),
        )

    def _round(self, state: State, parameters: Parameters) -> Array:
        """Return the courses that lead onto clockwise circles and round them."""
        north, east = state.north_m - self.centre_m[0], state.east_m - self.centre_m[1]
        distance_m = np.hypot(north, east)
        off = np.clip(CAPTURE * (distance_m / self.radius_m - 1.0), -np.pi / 2, np.pi / 2)
        tangent = np.arctan2(east, north) + np.pi / 2
        ahead = parameters.tau_psi_s * state.airspeed_mps / self.radius_m
        return tangent + off + np.where(np.abs(off) < 1.0, ahead, 0.0)


def loiter_radius_m(airframe: Airframe, cruise_mps: float) -> float:
    """Return the radius of circles: the autopilot's parameter, or wider where the turn rate asks for it."""
    return max(LEAST_RADIUS_M, WIDER_THAN_TIGHTEST * cruise_mps / airframe.turn_rate_max_rps)


def _crab(course: Array, state: State, drift_mps: Array) -> Array:
    """Return by how much the heading lies left of the course so that the drift doesn't carry the vehicle aside."""
    aside = drift_mps[1] * np.cos(course) - drift_mps[0] * np.sin(course)
    return np.arcsin(np.clip(aside / np.maximum(state.airspeed_mps, GROUND_SPEED_LEAST_MPS), -1.0, 1.0))
