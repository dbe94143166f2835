"""Setpoints that lead the autopilot's lags, and how slots turn that trail the leader."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot import AutopilotModel, FlightState, within
from flight_model.slot import Slot, Triple
from gcs_formation.control.mixer import Target

CRAB_RADPS: Final = 0.65
"""How fast a heading crabs against a gust: a slot 30 m aside is swung no faster than speed can follow."""


@mypyc_attr(acyclic=True, free_list_len=1)
class LeaderMotion:
    """How the leader flies."""

    __slots__ = ("acceleration_mps2", "bend_rps2", "climb_change_mps2", "state", "turn_rps")

    def __init__(
        self,
        state: FlightState,
        turn_rps: float,
        bend_rps2: float,
        acceleration_mps2: float,
        climb_change_mps2: float,
    ) -> None:
        """Take its state, its heading's first two derivatives, and the changes of its airspeed and its climb."""
        self.state = state
        self.turn_rps = turn_rps
        self.bend_rps2 = bend_rps2
        self.acceleration_mps2 = acceleration_mps2
        self.climb_change_mps2 = climb_change_mps2


def feed_forward(
    target: Target,
    leader: LeaderMotion,
    axis_rad: float,
    turn_rps: float,
    bend_rps2: float,
    slot: Slot,
    model: AutopilotModel,
    updraught_mps: float,
) -> Triple:
    """Return the speed, heading and height setpoints that hold `target` (errata item 29).

    The speed and heading that the slot needs change with three things: the leader's velocity; the axes' turn rate, in
    proportion to the slot's offset; and the slot's own acceleration (the derivative of a velocity in a turning frame).

    Args:
        target: how the slot moves through the air.
        leader: how the leader flies.
        axis_rad: heading of the axes along which the slot lies.
        turn_rps: rate of that heading.
        bend_rps2: rate of that rate.
        slot: offset from the leader along the axes.
        model: of the vehicle that is to hold it.
        updraught_mps: what carries that vehicle up.
    """
    off_rad = leader.state.heading_rad - axis_rad
    cos, sin = math.cos(off_rad), math.sin(off_rad)
    swing_mps2 = leader.state.airspeed_mps * (leader.turn_rps - turn_rps)
    along_mps2 = leader.acceleration_mps2 * cos - swing_mps2 * sin
    along_mps2 += slot.forward_mps2 - bend_rps2 * slot.right_m - turn_rps * slot.right_mps
    across_mps2 = leader.acceleration_mps2 * sin + swing_mps2 * cos
    across_mps2 += slot.right_mps2 + bend_rps2 * slot.forward_m + turn_rps * slot.forward_mps
    speed_mps, heading_rad = lead(target, axis_rad, along_mps2, across_mps2, model)
    height_m = lead_height(leader, slot, model, updraught_mps)
    return target.speed_mps + speed_mps, target.heading_rad + model.tau_psi_s * turn_rps + heading_rad, height_m


def lead_height(leader: LeaderMotion, slot: Slot, model: AutopilotModel, updraught_mps: float) -> float:
    """Return the height setpoint that holds a slot: the slot's own, led by (7) as far as the air doesn't do it."""
    height_m = leader.state.height_m + slot.up_m
    height_m += (model.tau_ha_s + model.tau_hb_s) * (leader.state.climb_mps + slot.up_mps - updraught_mps)
    return height_m + model.tau_ha_s * model.tau_hb_s * (leader.climb_change_mps2 + slot.up_mps2)


def lead(
    target: Target, axis_rad: float, along_mps2: float, across_mps2: float, model: AutopilotModel
) -> tuple[float, float]:
    """Return by how much speed and heading setpoints lead an acceleration of the slot along and across the axes."""
    angle_rad = target.heading_rad - axis_rad
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return (
        model.tau_v_s * (cos * along_mps2 + sin * across_mps2),
        model.tau_psi_s * (cos * across_mps2 - sin * along_mps2) / target.speed_mps,
    )


class TrailingSlot:
    """The turning of the axes of a slot in its follower's own frame, with the state kept between ticks.

    Equation (8) with the errors held at zero leaves the follower's heading no choice (the zero dynamics, errata item
    23): x_rc psi_2' = v sin(psi_1 - psi_2) + the slot's velocity sideways. The slot's heading follows the leader's with
    a lag of x_rc / v, which changes as the slot moves.
    """

    __slots__ = ("_crab_rad", "_off_rad")

    def __init__(self) -> None:
        """Start with a slot that has finished turning."""
        self._off_rad = math.nan
        self._crab_rad = math.nan

    def turning(self, leader: LeaderMotion, slot: Slot, dt_s: float) -> tuple[float, float]:
        """Return the axes' turn rate until the next tick, `dt_s` later, and how it changes."""
        speed, turn, x_rc = leader.state.airspeed_mps, leader.turn_rps, -slot.forward_m
        # The angle that it comes to, and how that changes.
        due_rad = math.asin(within((slot.right_mps - x_rc * turn) / speed, -1.0, 1.0))
        due_rps = (slot.right_mps2 - x_rc * leader.bend_rps2 + slot.forward_mps * turn) / speed
        off_rad = due_rad if math.isnan(self._off_rad) else self._off_rad
        # A share of the way until the next tick, and the lag that makes it so: never less than a tick.
        lag_s = -dt_s / math.expm1(-dt_s * speed / max(x_rc, speed * dt_s))
        rate_rps = (due_rad - off_rad) / lag_s
        self._off_rad = off_rad + dt_s * rate_rps
        return turn + rate_rps, leader.bend_rps2 + (due_rps - rate_rps * (1.0 - slot.forward_mps / speed)) / lag_s

    def crab(self, drift_mps: float, gust_mps2: float, speed_mps: float, dt_s: float) -> Triple:
        """Return the angle by which a follower crabs to the right, and its first two derivatives.

        The air carries it to the right, relative to the leader. The heading goes by a lag of 1/`CRAB_RADPS`; so it's
        known how the slot swings, and speed can go with it.
        """
        due_rad, due_rps = -drift_mps / speed_mps, -gust_mps2 / speed_mps
        angle_rad = due_rad if math.isnan(self._crab_rad) else self._crab_rad
        rate_rps = CRAB_RADPS * (due_rad - angle_rad)
        self._crab_rad = angle_rad + dt_s * rate_rps
        return angle_rad, rate_rps, CRAB_RADPS * (due_rps - rate_rps)

    def forget(self) -> None:
        """Start again."""
        self._off_rad = self._crab_rad = math.nan
