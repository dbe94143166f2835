"""Slots that move in a turning frame, and the flight that keeps them occupied."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formation_scenario.arrays import Array, Mask
from formation_scenario.formation import Frame
from formation_scenario.path import PathPoints


@dataclass(frozen=True)
class SlotMotion:
    """Where slots are and how they move, (..., N, 3) each: forward, right, up of the leader, in its frame."""

    position_m: Array
    velocity_mps: Array
    acceleration_mps2: Array

    @classmethod
    def at_rest(cls, position_m: Array) -> SlotMotion:
        """Return slots that stay where they are."""
        return cls(position_m, np.zeros_like(position_m), np.zeros_like(position_m))

    def take(self, which: npt.NDArray[np.intp]) -> SlotMotion:
        """Return the slots at `which`, repeated as often as named."""
        return SlotMotion(
            self.position_m[..., which, :], self.velocity_mps[..., which, :], self.acceleration_mps2[..., which, :]
        )

    def standing(self, which: Mask, place_m: Array) -> SlotMotion:
        """Return slots (N, 3) of which those that are `which` (N,) stand at `place_m` (N, 3)."""
        still = which[:, None]
        velocity, acceleration = (np.where(still, 0.0, each) for each in (self.velocity_mps, self.acceleration_mps2))
        return SlotMotion(np.where(still, place_m, self.position_m), velocity, acceleration)

    def after(self, seconds: Array) -> SlotMotion:
        """Return slots (N, 3) a little later, each by its own time (N,): their acceleration is kept."""
        time_s, change = seconds[:, None], self.acceleration_mps2
        position_m = self.position_m + time_s * (self.velocity_mps + time_s / 2.0 * change)
        return SlotMotion(position_m, self.velocity_mps + time_s * change, change)

    @property
    def reach_m(self) -> float:
        """How far out the farthest slot is."""
        return float(np.hypot(self.position_m[..., 0], self.position_m[..., 1]).max(initial=0.0))

    def seen_from(self, leader: int, swing_rad: float = 0.0) -> SlotMotion:
        """Return slots (N, 3) as another leader sees them, its heading `swing_rad` clockwise of the last one's."""
        cos, sin = np.cos(swing_rad), np.sin(swing_rad)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        each = (self.position_m, self.velocity_mps, self.acceleration_mps2)
        return SlotMotion(*((value - value[leader]) @ turn for value in each))


class Course(NamedTuple):
    """How the leader flies, over K places or moments: (K,) each but for the speed."""

    speed_mps: float
    turn_rate_rps: Array
    turn_change_rps2: Array
    climb_mps: Array
    climb_change_mps2: Array

    @classmethod
    def along(cls, points: PathPoints, speed_mps: float) -> Course:
        """Return how a leader flies at points of its path."""
        return cls(
            speed_mps,
            speed_mps * points.curvature_1pm,
            speed_mps**2 * points.curvature_rate_1pm2,
            speed_mps * points.slope,
            speed_mps**2 * points.slope_rate_1pm,
        )


class SlotNeeds(NamedTuple):
    """What slots need, (K, N) each: airspeed, turn rate, climb, their changes, and heading off the leader's."""

    speed_mps: Array
    accel_mps2: Array
    turn_rate_rps: Array
    climb_mps: Array
    climb_change_mps2: Array
    aside_rad: Array


def slot_needs(course: Course, slots: SlotMotion, frame: Frame) -> SlotNeeds:
    """Return what slots (N, 3), or (K, N, 3) where they move, need in still air.

    In the leader's frame a slot turns with it: the velocity of a point of a turning frame, and its derivative. In the
    follower's frame the equilibrium of a steady turn is used: both turn at the leader's rate.
    """
    speed, turn, bend = course.speed_mps, course.turn_rate_rps[:, None], course.turn_change_rps2[:, None]
    (x, y, _), (vx, vy, vz), (ax, ay, az) = (
        np.moveaxis(each, -1, 0) for each in (slots.position_m, slots.velocity_mps, slots.acceleration_mps2)
    )
    climb = course.climb_mps[:, None] + vz, course.climb_change_mps2[:, None] + az
    if frame == "leader_heading":
        along, across = speed - turn * y + vx, turn * x + vy
        along_change, across_change = -bend * y - turn * vy + ax, bend * x + turn * vx + ay
        total = np.hypot(along, across)
        swing = (along * across_change - across * along_change) / total**2
        change = (along * along_change + across * across_change) / total
        return SlotNeeds(total, change, turn + swing, *climb, np.arctan2(across, along))
    sine = np.clip((turn * x + vy) / speed, -0.99, 0.99)
    cosine = np.sqrt(1.0 - sine**2)
    total = speed * cosine - turn * y + vx
    change = -bend * y - turn * vy + ax - sine / cosine * (bend * x + turn * vx + ay)
    return SlotNeeds(total, change, turn + (turn * vx + ay) / (speed * cosine), *climb, np.arcsin(sine))
