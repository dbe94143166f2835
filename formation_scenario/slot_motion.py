"""Moving slots: in a rotating frame, and from one arrangement to another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.path import PathPoints
from flight_model.path_offsets import minimum_jerk
from flight_model.slot import Slot
from formation_scenario.fields import Frame

STANDING_MPS = 1e-3
"""Lower bound of speeds in divisions."""
RAMP = 0.3
"""Share of a transition's time in which its speed ramps up, and again in which it ramps down."""


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

    @cached_property
    def each(self) -> list[Slot]:
        """The N slots of arrays (N, 3) one by one."""
        positions, velocities = self.position_m.tolist(), self.velocity_mps.tolist()
        return list(map(Slot, positions, velocities, self.acceleration_mps2.tolist()))

    def standing(self, which: Mask, position_m: Array) -> SlotMotion:
        """Return these slots (N, 3), with those in the mask `which` (N,) at rest at `position_m` (N, 3)."""
        moving = ((position_m, self.position_m), (0.0, self.velocity_mps), (0.0, self.acceleration_mps2))
        return SlotMotion(*(np.where(which[:, None], still, each) for still, each in moving))

    def after(self, seconds: Array) -> SlotMotion:
        """Return slots (N, 3) a short time later, each by its own time (N,), at constant acceleration."""
        time_s, change = seconds[:, None], self.acceleration_mps2
        position_m = self.position_m + time_s * (self.velocity_mps + time_s / 2.0 * change)
        return SlotMotion(position_m, self.velocity_mps + time_s * change, change)

    def turned(self, axis_rad: Array, turn_rps: Array, bend_rps2: Array) -> SlotMotion:
        """Return slots (..., N, 3) fixed to north and east as seen along turning axes, (K,), as (K, N, 3)."""
        cos, sin, turn, bend = (each[:, None] for each in (np.cos(axis_rad), np.sin(axis_rad), turn_rps, bend_rps2))
        (x, y), (vx, vy), (ax, ay) = (
            (each[..., 0] * cos + each[..., 1] * sin, each[..., 1] * cos - each[..., 0] * sin)
            for each in (self.position_m, self.velocity_mps, self.acceleration_mps2)
        )
        up, up_mps, up_mps2 = (
            np.broadcast_to(each[..., 2], x.shape)
            for each in (self.position_m, self.velocity_mps, self.acceleration_mps2)
        )
        along_mps2 = ax + 2.0 * turn * vy + bend * y - turn**2 * x
        across_mps2 = ay - 2.0 * turn * vx - bend * x - turn**2 * y
        return SlotMotion(
            np.stack((x, y, up), axis=-1),
            np.stack((vx + turn * y, vy - turn * x, up_mps), axis=-1),
            np.stack((along_mps2, across_mps2, up_mps2), axis=-1),
        )

    @property
    def reach_m(self) -> float:
        """Horizontal distance of the farthest slot from the leader, m."""
        return float(np.hypot(self.position_m[..., 0], self.position_m[..., 1]).max(initial=0.0))

    def seen_from(self, leader: int, swing_rad: float = 0.0) -> SlotMotion:
        """Return slots (N, 3) relative to another leader, whose heading is `swing_rad` clockwise of the present."""
        cos, sin = np.cos(swing_rad), np.sin(swing_rad)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        each = (self.position_m, self.velocity_mps, self.acceleration_mps2)
        return SlotMotion(*((value - value[leader]) @ turn for value in each))


class LeaderFlight(NamedTuple):
    """The leader's flight at K points or moments: arrays (K,), and a constant speed."""

    speed_mps: float
    turn_rate_rps: Array
    turn_change_rps2: Array
    climb_mps: Array
    climb_change_mps2: Array
    course_rad: Array | float = 0.0
    """Its course over ground; any will do where slots don't move in a frame fixed to north."""

    @classmethod
    def along(cls, points: PathPoints, speed_mps: float) -> LeaderFlight:
        """Return the leader's flight at points of its path."""
        return cls(
            speed_mps,
            speed_mps * points.curvature_1pm,
            speed_mps**2 * points.curvature_rate_1pm2,
            speed_mps * points.slope,
            speed_mps**2 * points.slope_rate_1pm,
            points.course_rad,
        )


class SlotNeeds(NamedTuple):
    """The flight that slots require, (K, N) each; `relative_heading_rad` is the heading relative to the leader's."""

    speed_mps: Array
    accel_mps2: Array
    turn_rate_rps: Array
    climb_mps: Array
    climb_change_mps2: Array
    relative_heading_rad: Array


def slot_needs(flight: LeaderFlight, slots: SlotMotion, frame: Frame) -> SlotNeeds:
    """Return the flight that slots (N, 3), or (K, N, 3) if they move, require in still air.

    A slot in the leader's frame has the velocity of a point of that rotating frame, and its derivative. One that is
    fixed to north is such a slot too, which turns back as fast as that frame turns. For the follower's frame the
    equilibrium of a steady turn is used, in which both turn at the leader's rate.
    """
    if frame == "north":
        course_rad = np.broadcast_to(flight.course_rad, flight.turn_rate_rps.shape)
        slots = slots.turned(course_rad, flight.turn_rate_rps, flight.turn_change_rps2)
    speed, turn, bend = flight.speed_mps, flight.turn_rate_rps[:, None], flight.turn_change_rps2[:, None]
    (x, y, _), (vx, vy, vz), (ax, ay, az) = (
        np.moveaxis(each, -1, 0) for each in (slots.position_m, slots.velocity_mps, slots.acceleration_mps2)
    )
    climb = flight.climb_mps[:, None] + vz, flight.climb_change_mps2[:, None] + az
    if frame != "follower_heading":
        along, across = speed - turn * y + vx, turn * x + vy
        along_change, across_change = -bend * y - turn * vy + ax, bend * x + turn * vx + ay
        total = np.maximum(np.hypot(along, across), STANDING_MPS)
        swing = (along * across_change - across * along_change) / total**2
        change = (along * along_change + across * across_change) / total
        return SlotNeeds(total, change, turn + swing, *climb, np.arctan2(across, along))
    sine = np.clip((turn * x + vy) / speed, -0.99, 0.99)
    cosine = np.sqrt(1.0 - sine**2)
    total = speed * cosine - turn * y + vx
    change = -bend * y - turn * vy + ax - sine / cosine * (bend * x + turn * vx + ay)
    return SlotNeeds(total, change, turn + (turn * vx + ay) / (speed * cosine), *climb, np.arcsin(sine))


@dataclass(frozen=True)
class Transition:
    """N slots that move to `goal_m` and are at rest there when the transition is over."""

    at_s: float
    duration_s: float
    start: SlotMotion
    goal_m: Array
    height_offset_m: Array
    """(N,) height by which each is raised meanwhile."""
    rise_s: float
    """Duration of the rise, and again of the descent at the end."""
    separation_m: Array | None = None
    """(N, N) least distance of each two on their paths, as planned; infinite if not planned."""

    @classmethod
    def standing(cls, slots_m: Array) -> Transition:
        """Return a transition that is over, with slots (N, 3) at rest."""
        return cls(-np.inf, 1.0, SlotMotion.at_rest(slots_m), slots_m, np.zeros(len(slots_m)), 0.0)

    def over(self, time_s: float) -> bool:
        """Return whether all slots are at rest at their goals at a time."""
        return time_s >= self.at_s + self.duration_s

    def at(self, time_s: float) -> SlotMotion:
        """Return the slots (N, 3) at a time."""
        if self.over(time_s):
            return self._over
        sample = self.sample(np.array([max(time_s - self.at_s, 0.0)]))
        return SlotMotion(sample.position_m[0], sample.velocity_mps[0], sample.acceleration_mps2[0])

    @cached_property
    def _over(self) -> SlotMotion:
        """The slots (N, 3) after the transition."""
        return SlotMotion.at_rest(self.goal_m)

    def seen_from(self, leader: int, swing_rad: float = 0.0) -> Transition:
        """Return the transition relative to another leader, whose heading is `swing_rad` clockwise of the present.

        This is exact, because slots are linear in start, goals and height offsets at every moment.
        """
        return replace(
            self,
            start=self.start.seen_from(leader, swing_rad),
            goal_m=self._over.seen_from(leader, swing_rad).position_m,
            height_offset_m=self.height_offset_m - self.height_offset_m[leader],
        )

    def sample(self, elapsed_s: Array) -> SlotMotion:
        """Return the slots (K, N, 3) at moments (K,) since the beginning.

        The slots' initial motion is brought to rest during the first half; superposed on it, they cover the remaining
        distance to their goals.
        """
        left_m, *coming = self._braking(elapsed_s)
        share, rate, change = _share(elapsed_s, self.duration_s)
        displacement_m = self.goal_m - self.start.position_m - left_m
        position, velocity, acceleration = (
            each[..., None] * displacement_m + from_before
            for each, from_before in zip((share, rate, change), coming, strict=True)
        )
        if self.height_offset_m.any():
            for into, each in zip((position, velocity, acceleration), self._height_offset(elapsed_s), strict=True):
                into[..., 2] += each * self.height_offset_m
        return SlotMotion(self.start.position_m + position, velocity, acceleration)

    def _braking(self, elapsed_s: Array) -> tuple[Array, Array, Array, Array]:
        """Return the displacement (N, 3) in which the initial motion comes to rest, and its development over time.

        The development is displacement, velocity and acceleration (K, N, 3), of the quartic that comes to rest with the
        least jerk.
        """
        t = self.duration_s / 2
        v, a = self.start.velocity_mps * t, self.start.acceleration_mps2 * t**2
        u = np.clip(elapsed_s / t, 0.0, 1.0)[:, None, None]
        c3, c4 = -v - 2 * a / 3, v / 2 + a / 4
        position = u * (v + u * (a / 2 + u * (c3 + u * c4)))
        velocity = v + u * (a + u * (3 * c3 + u * 4 * c4))
        return v / 2 + a / 12, position, velocity / t, (a + u * (6 * c3 + u * 12 * c4)) * (u < 1.0) / t**2

    def _height_offset(self, elapsed_s: Array) -> tuple[Array, Array, Array]:
        """Return the share of the height offset (K, 1) and its first two derivatives: up at first, down at the end."""
        up = _smooth_step(elapsed_s[:, None], self.rise_s)
        down = _smooth_step(elapsed_s[:, None] - (self.duration_s - self.rise_s), self.rise_s)
        return up[0] - down[0], up[1] - down[1], up[2] - down[2]


def _share(elapsed_s: Array, duration_s: float) -> tuple[Array, Array, Array]:
    """Return the share of the path covered after `elapsed_s` (K,), (K, 1), and its first two derivatives by time.

    The speed rises and falls over `RAMP` of the time, as a minimum-jerk step, and is constant between.
    """
    u = np.clip(elapsed_s / duration_s, 0.0, 1.0)[:, None]
    near_end = np.minimum(u, 1.0 - u)
    w = np.minimum(near_end / RAMP, 1.0)
    risen, rise, _ = minimum_jerk(w)
    ramped = w**4 * (2.5 - 3 * w + w**2) * RAMP / (1 - RAMP)
    covered = ramped + np.maximum(near_end - RAMP, 0.0) / (1 - RAMP)
    change = rise / RAMP / (1 - RAMP) * np.sign(0.5 - u)
    return np.where(u <= 0.5, covered, 1.0 - covered), risen / (1 - RAMP) / duration_s, change / duration_s**2


def _smooth_step(elapsed_s: Array, duration_s: float) -> tuple[Array, Array, Array]:
    """Return a minimum-jerk step from 0 to 1 over `duration_s`, and its first two derivatives by time."""
    share, rate, change = minimum_jerk(np.clip(elapsed_s / duration_s, 0.0, 1.0))
    return share, rate / duration_s, change / duration_s**2
