"""The formation law: linear mixer, fuzzy scheduler and PID for all followers and all three channels at once.

Equations (13) and (14) as corrected: integrators start at trim, the leader's motion is fed forward, the mixed error's
references are the slot's own speed and heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formation_scenario.formation import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.arrays import Array, Mask, or_zero, within, wrap
from gcs_formation.control import pid
from gcs_formation.control.envelope import Envelope
from gcs_formation.control.feed_forward import Axes, LeaderMotion, Turning, feed_forward
from gcs_formation.control.fuzzy import FuzzyGainScheduler
from gcs_formation.control.mixer import (
    TOW_S,
    Mixer,
    Target,
    drift,
    formation_error,
    mix,
    rotate_to,
    slot_axis,
    slot_target,
)
from gcs_formation.control.pid import Gains, PidState
from gcs_formation.control.situation import Decision, Lead, Situation
from gcs_formation.control.tow import Tow
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Indices, Setpoints
from gcs_formation.estimation.predictor import turn_rate

CHANNELS = 3
"""Speed, heading, height."""
SWING_S = 0.6
"""Time aside of the leader at which the heading's loop has half its bandwidth, in the follower's own frame."""


@dataclass(frozen=True)
class LawParameters:
    """The law's constants; arrays are (3,) over the channels speed, heading, height."""

    mixer: Mixer
    frame: Frame
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


class FormationLaw:
    """The law of all followers, with the state it keeps between ticks."""

    commands_leader = False

    def __init__(self, parameters: LawParameters, model: AutopilotModel) -> None:
        """Start at rest; `model` has (C,) columns, and is read anew at every tick: its lags are learnt in flight."""
        self._parameters = parameters
        self._models = self._leader_model = self._model = model
        self._lead_by(0)

    def _lead_by(self, leader: int) -> None:
        """Start again behind a new leader: what the integrators hold belongs to the old pair of leader and follower."""
        everyone = np.arange(self._models.tau_v_s.size, dtype=np.intp)
        self._leader = leader
        self._followers: Indices = everyone[everyone != leader]
        self._leading: Indices = np.full_like(self._followers, leader)
        self._pairs = np.concatenate((self._leading, self._followers)), np.tile(self._followers, 2)
        self._state = self._rest = PidState.at_rest((self._followers.size, CHANNELS))
        self._drift_mps = np.full((2, self._followers.size), np.nan)
        self._tow = Tow(self._followers.size) if self._parameters.frame == "follower_heading" else None

    def decide(self, situation: Situation, dt_s: float) -> Decision:
        """Return the followers' setpoints; the controllers of those that aren't active are kept at rest."""
        if situation.lead.leader != self._leader:
            self._lead_by(situation.lead.leader)
        self._leader_model, self._model = self._models.take(self._leading), self._models.take(self._followers)
        parameters, state, slots = self._parameters, self._state, situation.slots.take(self._followers)
        led, follower = self._pairwise(situation)
        leader = self._led(situation.lead, led)
        turning = leader.turning if self._tow is None else self._tow.turning(leader, slots, dt_s)
        error_m = formation_error(leader.state, follower, slots.position_m, parameters.frame)
        target = slot_target(leader.state, follower, turning.rate_rps, slots, parameters.frame)
        mixed = mix(parameters.mixer, target, follower, self._steady(error_m, target, follower, slots))
        rate = pid.filter_rate(state, mixed, parameters.derivative_filter_s, dt_s)
        gains = scheduled_gains(parameters, mixed, rate).slowed(self._bandwidth(situation, leader.state, slots))
        output = pid.unlimited(state, gains, mixed, rate)
        axes = Axes(leader.state.heading_rad if self._tow is None else target.heading_rad, turning)
        forward = feed_forward(target, leader, axes, slots, self._gust(leader.state, follower, dt_s), self._model)
        wanted = Setpoints.of((forward + output).T)
        bounds = Envelope.of(forward[:, 1], follower, self._model)
        limited = bounds.limit(wanted)
        # What the feed-forward alone asks beyond the envelope isn't the integrators' to work off.
        excess = _difference(limited, bounds.limit(Setpoints.of(forward.T))) - output
        following = pid.integrate(state, gains, mixed, rate, excess, parameters.anti_windup_s, dt_s)
        following = following.with_integral(state.integral, situation.replaced[self._followers])
        active = situation.active[self._followers]
        self._state = _where(active, following, self._rest)
        self._drift_mps[:, ~active] = np.nan
        if self._tow is not None:
            self._tow.forget(~active)
        shown = np.concatenate((gains.proportional, gains.integral, gains.derivative), axis=1)
        return Decision(self._followers, follower, limited, error_m, mixed, shown)

    def _pairwise(self, situation: Situation) -> tuple[FlightState, FlightState]:
        """Return the leader's states and the followers' own when the followers' setpoints act."""
        table, count = situation.states.of(*self._pairs).table, self._followers.size
        return FlightState.of(table[:, :count]), FlightState.of(table[:, count:])

    def _led(self, lead: Lead, state: FlightState) -> LeaderMotion:
        """Return the motion of a leader in `state`, (F,) columns; its heading lags what it's told by (7).

        Its setpoint jumps where its route changes. The slots turn no faster than the leader can.
        """
        model = self._leader_model
        told = lead.told.setpoints.take(self._followers)
        turn_rps, most_rps = turn_rate(state, told, model), model.turn_rate_max_rps
        told_turn_rps = within(lead.told.turn_rps[self._followers], -most_rps, most_rps)
        bend_rps2 = (told_turn_rps - turn_rps) / model.tau_psi_s
        hurry_mps2 = (told.speed_mps - state.airspeed_mps) / model.tau_v_s
        hurry_mps2 = within(hurry_mps2, -model.accel_max_mps2, model.accel_max_mps2)
        to_climb_m = told.height_m - state.height_m - (model.tau_ha_s + model.tau_hb_s) * state.climb_mps
        climb_change_mps2 = to_climb_m / (model.tau_ha_s * model.tau_hb_s)
        return LeaderMotion(state, Turning(turn_rps, bend_rps2), hurry_mps2, climb_change_mps2)

    def _steady(self, error_m: Array, target: Target, follower: FlightState, slots: SlotMotion) -> Array:
        """Return the errors that are mixed: in the follower's own frame, without what its heading sweeps forward.

        While the follower's heading differs from its slot's by some angle, the follower's frame swings a slot at the
        side forward by y_rc times the angle. Speed can't follow that and needn't: the error vanishes as the heading
        comes back. A slot behind swings sideways by x_rc times the angle, which adds damping; a slot with less of
        this damping than `TOW_S` gives is given the rest.
        """
        if self._parameters.frame == "leader_heading":
            return error_m
        off = np.sin(wrap(follower.heading_rad - target.heading_rad))
        steady_m = error_m.copy()
        steady_m[:, 0] += slots.position_m[:, 1] * off
        steady_m[:, 1] -= np.maximum(TOW_S * target.speed_mps + slots.position_m[:, 0], 0.0) * off
        return steady_m

    def _bandwidth(self, situation: Situation, leader: FlightState, slots: SlotMotion) -> Array:
        """Return (F, 3), the share of the design bandwidth for each loop: less for the heading of a slot at the side.

        In the follower's own frame a turn swings such a slot forward at y_rc times the turn rate. The follower's speed
        has to match that, and changes far more slowly than the heading loop would turn.
        """
        bandwidth = situation.bandwidth[self._followers]
        if self._parameters.frame == "leader_heading":
            return bandwidth
        aside_s = np.minimum(np.abs(slots.position_m[:, 1]) / leader.airspeed_mps, TOW_S)
        heading, others = SWING_S / (SWING_S + aside_s), np.ones_like(aside_s)
        return bandwidth * np.column_stack((others, heading, others))

    def _gust(self, leader: FlightState, follower: FlightState, dt_s: float) -> tuple[Array, Array]:
        """Return the rate of change of the followers' drift since the last tick, along and across, in m/s².

        In the follower's own frame there is no lead across: its slot swings as it turns.
        """
        before_mps, self._drift_mps = self._drift_mps, drift(leader, follower)
        rate_mps2 = or_zero((self._drift_mps - before_mps) / dt_s)
        along, across = rotate_to(slot_axis(leader, follower, self._parameters.frame), *rate_mps2)
        return along, np.zeros_like(across) if self._parameters.frame == "follower_heading" else across


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


def _difference(limited: Setpoints, wanted: Setpoints) -> Array:
    return (limited.table - wanted.table).T


def _where(active: Mask, moving: PidState, rest: PidState) -> PidState:
    keep = active[:, None]
    return PidState(
        np.where(keep, moving.integral, rest.integral),
        np.where(keep, moving.rate, rest.rate),
        np.where(keep, moving.error, rest.error),
    )
