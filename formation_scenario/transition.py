"""Slots that move from one arrangement to another, all at once: straight, smooth, some of them lifted meanwhile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from formation_scenario.minimum_jerk import minimum_jerk
from formation_scenario.slot_motion import Array, SlotMotion

RAMP = 0.3
"""Share of a transition's time in which its speed ramps up, and again in which it ramps down."""


@dataclass(frozen=True)
class Transition:
    """N slots that move to `goal_m`, and are at rest there once the transition is over."""

    at_s: float
    duration_s: float
    start: SlotMotion
    goal_m: Array
    lift_m: Array
    """(N,) by how much each is lifted meanwhile."""
    rise_s: float
    """Duration of the rise, and again of the descent at the end."""

    @classmethod
    def standing(cls, slots_m: Array) -> Transition:
        """Return a transition that is over, with slots (N, 3) at rest."""
        return cls(-np.inf, 1.0, SlotMotion.at_rest(slots_m), slots_m, np.zeros(len(slots_m)), 0.0)

    def at(self, time_s: float) -> SlotMotion:
        """Return the slots (N, 3) at a time."""
        if time_s >= self.at_s + self.duration_s:
            return self._over
        sample = self.sample(np.array([max(time_s - self.at_s, 0.0)]))
        return SlotMotion(sample.position_m[0], sample.velocity_mps[0], sample.acceleration_mps2[0])

    @cached_property
    def _over(self) -> SlotMotion:
        """The slots (N, 3) once it's over."""
        return SlotMotion.at_rest(self.goal_m)

    def seen_from(self, leader: int, swing_rad: float = 0.0) -> Transition:
        """Return the same transition relative to another leader, which heads `swing_rad` clockwise of the present one.

        This is exact, as the slots are linear in start, goals and lifts at every moment.
        """
        return replace(
            self,
            start=self.start.seen_from(leader, swing_rad),
            goal_m=self._over.seen_from(leader, swing_rad).position_m,
            lift_m=self.lift_m - self.lift_m[leader],
        )

    def sample(self, elapsed_s: Array) -> SlotMotion:
        """Return the slots (K, N, 3) at moments (K,) since the beginning.

        The motion that slots have at the start is brought to rest during the first half; superposed on it, they cover
        the remaining distance to their goals.
        """
        left_m, *coming = self._braking(elapsed_s)
        share, rate, change = _share(elapsed_s, self.duration_s)
        way_m = self.goal_m - self.start.position_m - left_m
        position, velocity, acceleration = (
            each[..., None] * way_m + from_before
            for each, from_before in zip((share, rate, change), coming, strict=True)
        )
        if self.lift_m.any():
            for into, each in zip((position, velocity, acceleration), self._lifted(elapsed_s), strict=True):
                into[..., 2] += each * self.lift_m
        return SlotMotion(self.start.position_m + position, velocity, acceleration)

    def _braking(self, elapsed_s: Array) -> tuple[Array, Array, Array, Array]:
        """Return the displacement (N, 3) in which the initial motion comes to rest, and its course over time.

        The course is displacement, velocity and acceleration (K, N, 3), of the quartic that comes to rest with the
        least jerk.
        """
        t = self.duration_s / 2
        v, a = self.start.velocity_mps * t, self.start.acceleration_mps2 * t**2
        u = np.clip(elapsed_s / t, 0.0, 1.0)[:, None, None]
        c3, c4 = -v - 2 * a / 3, v / 2 + a / 4
        place = u * (v + u * (a / 2 + u * (c3 + u * c4)))
        velocity = v + u * (a + u * (3 * c3 + u * 4 * c4))
        return v / 2 + a / 12, place, velocity / t, (a + u * (6 * c3 + u * 12 * c4)) * (u < 1.0) / t**2

    def _lifted(self, elapsed_s: Array) -> tuple[Array, Array, Array]:
        """Return the share of the lift (K, 1) and its first two derivatives: up at the start, down at the end."""
        up = _smooth_step(elapsed_s[:, None], self.rise_s)
        down = _smooth_step(elapsed_s[:, None] - (self.duration_s - self.rise_s), self.rise_s)
        return up[0] - down[0], up[1] - down[1], up[2] - down[2]


def _share(elapsed_s: Array, duration_s: float) -> tuple[Array, Array, Array]:
    """Return the share of the way covered after `elapsed_s` (K,), (K, 1), and its first two derivatives by time.

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
