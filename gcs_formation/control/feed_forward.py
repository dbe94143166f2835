"""Setpoints that lead the autopilot's lags, so that no error is left while the leader turns or the slots move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formation_scenario.slot_motion import SlotMotion
from gcs_formation.arrays import Array
from gcs_formation.control.mixer import Target
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState


@dataclass(frozen=True)
class Turning:
    """How a heading changes, (N,) each."""

    rate_rps: Array
    acceleration_rps2: Array


@dataclass(frozen=True)
class LeaderMotion:
    """How the leader flies, a column for each vehicle whose slot moves with it."""

    state: FlightState
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
    model: AutopilotModel,
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


def gust_lead(target: Target, axes: Axes, gust_mps2: tuple[Array, Array], model: AutopilotModel) -> Array:
    """Return (N, 3): what `feed_forward` is led by while the wind that carries a vehicle changes.

    `gust_mps2` is its rate of change along and across the axes.
    """
    along, swing = _lead(target, axes, -gust_mps2[0], -gust_mps2[1], model)
    return np.array((along, swing, np.zeros_like(along))).T


def _lead(
    target: Target, axes: Axes, along_mps2: Array, across_mps2: Array, model: AutopilotModel
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
