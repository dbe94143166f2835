"""Setpoints that lead the autopilot's lags, so that a slot is kept without any error while the leader turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs_formation.arrays import Array
from gcs_formation.control.mixer import SlotMotion, Target
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState


@dataclass(frozen=True)
class LeaderMotion:
    """How the leader flies, a column for each vehicle whose slot moves with it."""

    state: FlightState
    turn_rate_rps: Array
    turn_acceleration_rps2: Array


def feed_forward(
    target: Target, leader: LeaderMotion, slots: SlotMotion, gust_mps2: tuple[Array, Array], model: AutopilotModel
) -> Array:
    """Return (N, 3): speed, heading and height setpoints that hold `target` (errata item 29).

    Speed and heading that the slot needs change with the leader's turn rate, in proportion to the slot's place, and
    with what carries the vehicle away: `gust_mps2` is that velocity's rate of change along and across the slots' axes.
    """
    turn, bend = leader.turn_rate_rps, leader.turn_acceleration_rps2
    x_rc, y_rc = -slots.position_m[:, 0], -slots.position_m[:, 1]
    along_mps2, across_mps2 = gust_mps2
    speed = target.speed_mps + model.tau_v_s * (bend * y_rc - along_mps2)
    heading = target.heading_rad + model.tau_psi_s * (turn - (bend * x_rc + across_mps2) / leader.state.airspeed_mps)
    climb = leader.state.climb_mps + slots.velocity_mps[:, 2]
    height = leader.state.height_m + slots.position_m[:, 2] + (model.tau_ha_s + model.tau_hb_s) * climb
    return np.stack((speed, heading, height), axis=1)
