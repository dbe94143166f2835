"""Setpoints that lead the autopilot's lags, and how slots turn that trail the leader."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.mixer import Target
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates

CRAB_RADPS = 0.65
"""How fast a heading crabs against a gust: a slot 30 m aside is swung no faster than speed can follow."""


@dataclass(frozen=True)
class Turning:
    """How a heading changes, (N,) each."""

    rate_rps: Array
    acceleration_rps2: Array


@dataclass(frozen=True)
class LeaderMotion:
    """How the leader flies, a column for each vehicle whose slot moves with it."""

    state: FlightStates
    turning: Turning
    acceleration_mps2: Array
    """Of its airspeed."""
    climb_change_mps2: Array


@dataclass(frozen=True)
class Axes:
    """The axes along which slots lie."""

    heading_rad: Array
    turning: Turning


def feed_forward(
    target: Target,
    leader: LeaderMotion,
    axes: Axes,
    slots: SlotMotion,
    model: AutopilotModels,
) -> Array:
    """Return (N, 3): speed, heading and height setpoints that hold `target` (errata item 29).

    The speed and heading that the slot needs change with three things: the leader's velocity; the axes' turn rate, in
    proportion to the slot's offset; and the slot's own acceleration (the derivative of a velocity in a turning frame).
    """
    turn, bend = axes.turning.rate_rps, axes.turning.acceleration_rps2
    (x, y, z), (forth, aside, up) = slots.position_m.T, slots.velocity_mps.T
    ahead, across, rising = slots.acceleration_mps2.T
    led_along, led_across = _led(leader, axes)
    along_change = led_along + ahead - bend * y - turn * aside
    across_change = led_across + across + bend * x + turn * forth
    along, swing = _lead(target, axes, along_change, across_change, model)
    speed, heading = target.speed_mps + along, target.heading_rad + model.tau_psi_s * turn + swing
    height = leader.state.height_m + z + (model.tau_ha_s + model.tau_hb_s) * (leader.state.climb_mps + up)
    height = height + model.tau_ha_s * model.tau_hb_s * (leader.climb_change_mps2 + rising)
    return np.array((speed, heading, height)).T


def gust_lead(target: Target, axes: Axes, gust_mps2: tuple[Array, Array], model: AutopilotModels) -> Array:
    """Return (N, 3): what `feed_forward` is led by while the wind that carries a vehicle changes.

    `gust_mps2` is its rate of change along and across the axes.
    """
    along, swing = _lead(target, axes, -gust_mps2[0], -gust_mps2[1], model)
    return np.array((along, swing, np.zeros_like(along))).T


def _lead(
    target: Target, axes: Axes, along_mps2: Array, across_mps2: Array, model: AutopilotModels
) -> tuple[Array, Array]:
    """Return by how much speed and heading setpoints lead an acceleration of the slot along and across the axes."""
    angle = target.heading_rad - axes.heading_rad
    cos, sin = np.cos(angle), np.sin(angle)
    speed = model.tau_v_s * (cos * along_mps2 + sin * across_mps2)
    return speed, model.tau_psi_s * (cos * across_mps2 - sin * along_mps2) / target.speed_mps


def _led(leader: LeaderMotion, axes: Axes) -> tuple[Array, Array]:
    """Return the leader's acceleration along and across the axes, in their turning frame."""
    off = leader.state.heading_rad - axes.heading_rad
    cos, sin = np.cos(off), np.sin(off)
    swing_mps2 = leader.state.airspeed_mps * (leader.turning.rate_rps - axes.turning.rate_rps)
    return leader.acceleration_mps2 * cos - swing_mps2 * sin, leader.acceleration_mps2 * sin + swing_mps2 * cos


class Crab(NamedTuple):
    """The angle by which headings crab to the right, (F,) each, and how it changes."""

    angle_rad: Array
    rate_rps: Array
    acceleration_rps2: Array


class TrailingSlots:
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
