"""Slots that move in a rotating frame, and the flight that keeps vehicles in them."""

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
    """Position and motion of slots, (..., N, 3) each: forward, right and up of the leader, in its frame."""

    position_m: Array
    velocity_mps: Array
    acceleration_mps2: Array

    @classmethod
    def at_rest(cls, position_m: Array) -> SlotMotion:
        """Return slots at rest."""
        return cls(position_m, np.zeros_like(position_m), np.zeros_like(position_m))

    def take(self, which: npt.NDArray[np.intp]) -> SlotMotion:
        """Return the slots at `which`, repeated as often as named."""
        return SlotMotion(
            self.position_m[..., which, :], self.velocity_mps[..., which, :], self.acceleration_mps2[..., which, :]
        )

    def standing(self, which: Mask, place_m: Array) -> SlotMotion:
        """Return these slots (N, 3), with those in the mask `which` (N,) at rest at `place_m` (N, 3)."""
        still = which[:, None]
        velocity, acceleration = (np.where(still, 0.0, each) for each in (self.velocity_mps, self.acceleration_mps2))
        return SlotMotion(np.where(still, place_m, self.position_m), velocity, acceleration)

    def after(self, seconds: Array) -> SlotMotion:
        """Return slots (N, 3) a short time later, each by its own time (N,), at constant acceleration."""
        time_s, change = seconds[:, None], self.acceleration_mps2
        position_m = self.position_m + time_s * (self.velocity_mps + time_s / 2.0 * change)
        return SlotMotion(position_m, self.velocity_mps + time_s * change, change)

    @property
    def reach_m(self) -> float:
        """Horizontal distance of the farthest slot from the leader, m."""
        return float(np.hypot(self.position_m[..., 0], self.position_m[..., 1]).max(initial=0.0))

    def seen_from(self, leader: int, swing_rad: float = 0.0) -> SlotMotion:
        """Return slots (N, 3) relative to another leader, which heads `swing_rad` clockwise of the present one."""
        cos, sin = np.cos(swing_rad), np.sin(swing_rad)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        each = (self.position_m, self.velocity_mps, self.acceleration_mps2)
        return SlotMotion(*((value - value[leader]) @ turn for value in each))


class Course(NamedTuple):
    """The leader's flight at K points or moments: arrays (K,), and a constant speed."""

    speed_mps: float
    turn_rate_rps: Array
    turn_change_rps2: Array
    climb_mps: Array
    climb_change_mps2: Array

    @classmethod
    def along(cls, points: PathPoints, speed_mps: float) -> Course:
        """Return the leader's flight at points of its path."""
        return cls(
            speed_mps,
            speed_mps * points.curvature_1pm,
            speed_mps**2 * points.curvature_rate_1pm2,
            speed_mps * points.slope,
            speed_mps**2 * points.slope_rate_1pm,
        )


class SlotNeeds(NamedTuple):
    """The flight that slots require, (K, N) each; `aside_rad` is the heading relative to the leader's."""

    speed_mps: Array
    accel_mps2: Array
    turn_rate_rps: Array
    climb_mps: Array
    climb_change_mps2: Array
    aside_rad: Array


def slot_needs(course: Course, slots: SlotMotion, frame: Frame) -> SlotNeeds:
    """Return the flight that slots (N, 3), or (K, N, 3) if they move, require in still air.

    A slot in the leader's frame has the velocity of a point of that rotating frame, and its derivative. For the
    follower's frame the equilibrium of a steady turn is used, in which both turn at the leader's rate.
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
