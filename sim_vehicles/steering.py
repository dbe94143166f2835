"""Computes the model's commands from headings, courses and circles, for all vehicles at once."""

from __future__ import annotations

import numpy as np

from formation_scenario.arrays import Array
from formation_scenario.vehicles import VehicleModel
from sim_vehicles.dynamics import Command, Parameters, State

HEADING, COURSE, CIRCLE = 0, 1, 2
CAPTURE = 2.0
"""Steepness of the approach to a circle: radians off the tangent per radius of distance from it."""
ON_CIRCLE_RAD = 1.0
"""Closer to the tangent than this, the heading setpoint leads by the heading's lag in the turn."""
LEAST_SPEED_MPS = 1.0
"""Lower bound of airspeeds in divisions, for vehicles that stand still."""


class Steering:
    """Targets of N vehicles. Each vehicle writes its own elements; the main loop reads them all."""

    def __init__(self, models: list[VehicleModel]) -> None:
        """Start with all vehicles at rest."""
        count = len(models)
        self.kind = np.zeros(count, dtype=np.int8)
        self._told = np.zeros((2, count))
        self.height_m: Array = np.zeros(count)
        self.accel_mps2: Array = np.full(count, np.inf)
        self.lateral_mps2: Array = np.full(count, np.inf)
        self.centre_m: Array = np.zeros((2, count))
        self.radius_m: Array = np.ones(count)
        self.stopped = np.ones(count, dtype=np.bool_)
        """Throttle at 0."""
        self.airborne = np.zeros(count, dtype=np.bool_)
        self._speed_min_mps = np.array([each.speed_min_mps for each in models])
        self._speed_max_mps = np.array([each.speed_max_mps for each in models])

    @property
    def speed_mps(self) -> Array:
        """(N,) airspeeds; a view, not kept beside the table: in a copy of a fleet it would be another array."""
        return self._told[0]

    @property
    def direction_rad(self) -> Array:
        """(N,) headings or courses, a view likewise."""
        return self._told[1]

    def commands(self, state: State, parameters: Parameters, drift_mps: Array) -> Command:
        """Return the model's commands for this cycle; vehicles on the ground stay there."""
        air_motion = self._told.copy()
        speed, heading = air_motion
        if np.count_nonzero(self.kind):
            heading[:] = np.where(self.kind == CIRCLE, self._round(state, parameters), heading)
            heading[:] = np.where(self.kind == HEADING, heading, heading - _crab(heading, state, drift_mps))
        np.minimum(np.maximum(speed, self._speed_min_mps), self._speed_max_mps, out=speed)
        height_m = self.height_m
        if np.count_nonzero(self.stopped):
            speed[self.stopped] = 0.0
            heading[self.stopped] = state.heading_rad[self.stopped]
        if np.count_nonzero(self.airborne) < self.airborne.size:
            height_m = np.where(self.airborne, height_m, state.height_m)
        turn_rate = self.lateral_mps2 / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
        return Command(air_motion, np.array((self.accel_mps2, turn_rate)), height_m)

    def _round(self, state: State, parameters: Parameters) -> Array:
        """Return the courses (N,) that lead onto the clockwise circles and along them."""
        north, east = state.table[:2] - self.centre_m
        off = CAPTURE * (np.hypot(north, east) / self.radius_m - 1.0)
        off = np.minimum(np.maximum(off, -np.pi / 2), np.pi / 2)
        tangent = np.arctan2(east, north) + np.pi / 2
        ahead = parameters.tau_s[1] * state.airspeed_mps / self.radius_m
        return tangent + off + np.where(np.abs(off) < ON_CIRCLE_RAD, ahead, 0.0)


def _crab(course: Array, state: State, drift_mps: Array) -> Array:
    """Return the crab angle (N,): how far left of the course the heading must point to cancel the drift across it."""
    aside = drift_mps[1] * np.cos(course) - drift_mps[0] * np.sin(course)
    share = aside / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
    return np.arcsin(np.minimum(np.maximum(share, -1.0), 1.0))
