"""From what vehicles are to do (a heading, a course, a circle) to the model's commands, for all of them at once."""

from __future__ import annotations

import numpy as np

from formation_scenario.arrays import Array
from formation_scenario.vehicles import VehicleModel
from sim_vehicles.dynamics import Command, Parameters, State

HEADING, COURSE, CIRCLE = 0, 1, 2
CAPTURE = 2.0
"""Steepness of the approach to a circle: radians off the tangent for each radius of distance from it."""
ON_CIRCLE_RAD = 1.0
"""Less off the tangent than this, a turn leads by what the heading's lag costs."""
LEAST_SPEED_MPS = 1.0
"""In divisions by airspeed, of what stands still too."""


class Steering:
    """Targets of N vehicles; vehicles write their own element, the main loop reads them all."""

    def __init__(self, models: list[VehicleModel]) -> None:
        """Start with nobody moving."""
        count = len(models)
        self.kind = np.zeros(count, dtype=np.int8)
        self.speed_mps: Array = np.zeros(count)
        self.direction_rad: Array = np.zeros(count)
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

    def commands(self, state: State, parameters: Parameters, drift_mps: Array) -> Command:
        """Return what the model is told this loop; on the ground it stays there."""
        heading = self.direction_rad
        if self.kind.any():
            heading = np.where(self.kind == CIRCLE, self._round(state, parameters), heading)
            heading = np.where(self.kind == HEADING, heading, heading - _crab(heading, state, drift_mps))
        speed = np.minimum(np.maximum(self.speed_mps, self._speed_min_mps), self._speed_max_mps)
        height_m = self.height_m
        if self.stopped.any():
            speed = np.where(self.stopped, 0.0, speed)
            heading = np.where(self.stopped, state.heading_rad, heading)
        if not self.airborne.all():
            height_m = np.where(self.airborne, height_m, state.height_m)
        turn_rate = self.lateral_mps2 / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
        return Command(np.array((speed, heading)), np.array((self.accel_mps2, turn_rate)), height_m)

    def _round(self, state: State, parameters: Parameters) -> Array:
        """Return the courses that lead onto clockwise circles and round them."""
        north, east = state.table[:2] - self.centre_m
        off = CAPTURE * (np.hypot(north, east) / self.radius_m - 1.0)
        off = np.minimum(np.maximum(off, -np.pi / 2), np.pi / 2)
        tangent = np.arctan2(east, north) + np.pi / 2
        ahead = parameters.tau_s[1] * state.airspeed_mps / self.radius_m
        return tangent + off + np.where(np.abs(off) < ON_CIRCLE_RAD, ahead, 0.0)


def _crab(course: Array, state: State, drift_mps: Array) -> Array:
    """Return by how much the heading lies left of the course so that the drift doesn't carry the vehicle aside."""
    aside = drift_mps[1] * np.cos(course) - drift_mps[0] * np.sin(course)
    share = aside / np.maximum(state.airspeed_mps, LEAST_SPEED_MPS)
    return np.arcsin(np.minimum(np.maximum(share, -1.0), 1.0))
