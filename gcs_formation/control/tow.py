"""How slots turn that are defined along the followers' own axes: as if towed by the leader."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from formation_scenario.slot_motion import SlotMotion
from gcs_formation.arrays import Array, Mask
from gcs_formation.control.feed_forward import LeaderMotion, Turning

CRAB_RADPS = 0.65
"""How fast a heading crabs against a gust: a slot 30 m aside is swung no faster than speed can follow."""


class Crab(NamedTuple):
    """The angle by which headings crab to the right, (F,) each, and how it changes."""

    angle_rad: Array
    rate_rps: Array
    acceleration_rps2: Array


class Tow:
    """The turning of the axes of slots in the followers' own frames, with the state kept between ticks.

    Equation (8) with the errors held at zero leaves the follower's heading no choice (the zero dynamics, errata item
    23): x_rc psi_2' = v sin(psi_1 - psi_2) + the slot's velocity sideways. The slot's heading follows the leader's with
    a lag of x_rc / v, which changes as the slot moves.
    """

    def __init__(self, followers: int) -> None:
        """Start with slots that have finished turning."""
        self._off_rad = np.full(followers, np.nan)
        self._crab_rad = np.full(followers, np.nan)

    def turning(self, leader: LeaderMotion, slots: SlotMotion, dt_s: float) -> Turning:
        """Return how the axes turn until the next tick, `dt_s` later."""
        speed, turn, bend = leader.state.airspeed_mps, leader.turning.rate_rps, leader.turning.acceleration_rps2
        x_rc, forth = -slots.position_m[:, 0], slots.velocity_mps[:, 0]
        # The angle that it comes to, and how that changes.
        due_rad = np.arcsin(np.clip((slots.velocity_mps[:, 1] - x_rc * turn) / speed, -1.0, 1.0))
        due_rps = (slots.acceleration_mps2[:, 1] - x_rc * bend + forth * turn) / speed
        off_rad = np.where(np.isnan(self._off_rad), due_rad, self._off_rad)
        # A share of the way until the next tick, and the lag that makes it so: never less than a tick.
        share = -np.expm1(-dt_s * speed / np.maximum(x_rc, speed * dt_s))
        lag_s = dt_s / share
        rate_rps = (due_rad - off_rad) / lag_s
        self._off_rad = off_rad + dt_s * rate_rps
        return Turning(turn + rate_rps, bend + (due_rps - rate_rps * (1.0 - forth / speed)) / lag_s)

    def crab(self, drift_mps: Array, gust_mps2: Array, speed_mps: Array, dt_s: float) -> Crab:
        """Return how followers crab that the air carries to the right, relative to the leader, and how that changes.

        The heading goes by a lag of 1/`CRAB_RADPS`; so it's known how the slots swing, and speed can go with them.
        """
        due_rad, due_rps = -drift_mps / speed_mps, -gust_mps2 / speed_mps
        angle_rad = np.where(np.isnan(self._crab_rad), due_rad, self._crab_rad)
        rate_rps = CRAB_RADPS * (due_rad - angle_rad)
        self._crab_rad = angle_rad + dt_s * rate_rps
        return Crab(angle_rad, rate_rps, CRAB_RADPS * (due_rps - rate_rps))

    def forget(self, which: Mask) -> None:
        """Start again for some followers."""
        self._off_rad[which] = self._crab_rad[which] = np.nan
