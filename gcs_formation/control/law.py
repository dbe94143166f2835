"""The formation law: linear mixer, fuzzy scheduler and PID for all followers and all three channels at once.

Equations (13) and (14) as corrected: integrators start at trim, the leader's motion is fed forward, the mixed error's
references are the slot's own speed and heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs_formation.arrays import Array, Mask, wrap
from gcs_formation.control import envelope, pid
from gcs_formation.control.fuzzy import FuzzyGainScheduler
from gcs_formation.control.mixer import (
    Mixer,
    SlotFrame,
    SlotMotion,
    Target,
    formation_error,
    mix,
    slot_target,
)
from gcs_formation.control.pid import Gains, PidState
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Setpoints

CHANNELS = 3
"""Speed, heading, height."""


@dataclass(frozen=True)
class LawParameters:
    """The law's constants; arrays are (3,) over the channels speed, heading, height."""

    mixer: Mixer
    frame: SlotFrame
    nominal: Gains
    base: float
    """k_0 as a share of the nominal gain."""
    span: float
    """Delta k_max as a share of the nominal gain: the scheduler only adds (errata item 29e)."""
    error_scale: Array
    rate_scale: Array
    scheduler: FuzzyGainScheduler | None
    """None for the plain PID: gains stay nominal."""
    derivative_filter_s: float
    anti_windup_s: float


@dataclass(frozen=True)
class Situation:
    """What the law acts on: a column for each follower, all states at the instants when the setpoints will act."""

    leader: FlightState
    leader_turn_rate_rps: Array
    leader_turn_acceleration_rps2: Array
    follower: FlightState
    slots: SlotMotion
    model: AutopilotModel


@dataclass(frozen=True)
class Decision:
    """What the law decided, and why: (F,) setpoints, (F, 3) errors, mixed errors and the gains' factors (F, 3, 3)."""

    setpoints: Setpoints
    error_m: Array
    mixed: Array
    gains: Gains


class FormationLaw:
    """The law of F followers, with what it remembers between ticks."""

    def __init__(self, parameters: LawParameters, followers: int) -> None:
        """Start at rest."""
        self._parameters = parameters
        self._state = PidState.at_rest((followers, CHANNELS))

    def decide(self, situation: Situation, active: Mask, dt_s: float) -> Decision:
        """Return this tick's setpoints; followers that aren't `active` (F,) are kept at rest."""
        parameters, state = self._parameters, self._state
        follower = situation.follower
        error_m = formation_error(situation.leader, follower, situation.slots.position_m, parameters.frame)
        target = slot_target(
            situation.leader, follower, situation.leader_turn_rate_rps, situation.slots, parameters.frame
        )
        mixed = mix(parameters.mixer, target, follower, error_m)
        rate = pid.filter_rate(state, mixed, parameters.derivative_filter_s, dt_s)
        gains = scheduled_gains(parameters, mixed, rate)
        output = pid.unlimited(state, gains, mixed, rate)
        forward = feed_forward(target, situation)
        wanted = Setpoints(*(forward + output).T)
        limited = envelope.limit(wanted, forward[:, 1], follower, situation.model)
        excess = _difference(limited, wanted)
        following = pid.integrate(state, gains, mixed, rate, excess, parameters.anti_windup_s, dt_s)
        self._state = _where(active, following, PidState.at_rest(mixed.shape))
        return Decision(limited, error_m, mixed, gains)


def scheduled_gains(parameters: LawParameters, mixed: Array, rate: Array) -> Gains:
    """Return k_0 + F Delta k_max, (F, 3) each, from the normalised mixed errors and their rates (14)."""
    nominal = parameters.nominal
    if parameters.scheduler is None:
        return Gains(
            *(np.broadcast_to(k, mixed.shape) for k in (nominal.proportional, nominal.integral, nominal.derivative))
        )
    factors = parameters.scheduler.infer(mixed / parameters.error_scale, rate / parameters.rate_scale)
    share = parameters.base + parameters.span * factors
    return Gains(
        share[..., 0] * nominal.proportional,
        share[..., 1] * nominal.integral,
        share[..., 2] * nominal.derivative,
    )


def feed_forward(target: Target, situation: Situation) -> Array:
    """Return (F, 3): the setpoints that lead the autopilot's lags so that the slot is kept without any error (29).

    Speed and heading that the slot needs change with the leader's turn rate, in proportion to the slot's place.
    """
    model, leader, slots = situation.model, situation.leader, situation.slots
    turn, bend = situation.leader_turn_rate_rps, situation.leader_turn_acceleration_rps2
    x_rc, y_rc = -slots.position_m[:, 0], -slots.position_m[:, 1]
    speed = target.speed_mps + model.tau_v_s * bend * y_rc
    heading = target.heading_rad + model.tau_psi_s * (turn - bend * x_rc / leader.airspeed_mps)
    climb = leader.climb_mps + slots.velocity_mps[:, 2]
    height = leader.height_m + slots.position_m[:, 2] + (model.tau_ha_s + model.tau_hb_s) * climb
    return np.stack((speed, heading, height), axis=1)


def _difference(limited: Setpoints, wanted: Setpoints) -> Array:
    return np.stack(
        (
            limited.speed_mps - wanted.speed_mps,
            wrap(limited.heading_rad - wanted.heading_rad),
            limited.height_m - wanted.height_m,
        ),
        axis=1,
    )


def _where(active: Mask, moving: PidState, rest: PidState) -> PidState:
    keep = active[:, None]
    return PidState(
        np.where(keep, moving.integral, rest.integral),
        np.where(keep, moving.rate, rest.rate),
        np.where(keep, moving.error, rest.error),
    )
