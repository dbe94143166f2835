"""The formation law: linear mixer, fuzzy scheduler and PID for all followers and all three channels at once.

Equations (13) and (14) as corrected: integrators start at trim, the leader's motion is fed forward, the mixed error's
references are the slot's own speed and heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array, Mask, within, wrap
from formation_scenario.formation import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control import fuzzy_pid
from gcs_formation.control.envelope import Envelope
from gcs_formation.control.feed_forward import Axes, LeaderMotion, TrailingSlots, Turning, feed_forward, gust_lead
from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler, Gains, PidState
from gcs_formation.control.mixer import (
    TOW_S,
    Mixer,
    Target,
    drift,
    error_rate,
    formation_error,
    mix,
    rotate_to,
    slot_axis,
    slot_target,
)
from gcs_formation.control.situation import Decision, Lead, Situation
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices, Setpoints
from gcs_formation.estimation.predictor import air_rates, turn_rate

CHANNELS = 3
"""Speed, heading, height."""
SLEW = np.array((1.6, 1.04))
"""How fast corrections of speed and heading grow at most, as a share of the vehicle's own limits."""
GUST_SIGMAS = 3.0
"""Standard deviations of the wind's estimate below which a change of it isn't led."""
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
    gust_radps: float
    """Bandwidth with which a change of the drift is fed forward."""


class FormationLaw:
    """The law of all followers, with the state it keeps between ticks."""

    commands_leader = False

    def __init__(self, parameters: LawParameters, model: AutopilotModels) -> None:
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
        self._correction = np.full((self._followers.size, CHANNELS), np.nan)
        self._tow = TrailingSlots(self._followers.size) if self._parameters.frame == "follower_heading" else None

    def decide(self, situation: Situation, dt_s: float) -> Decision:
        """Return the followers' setpoints; the controllers of those that aren't active are kept at rest."""
        if situation.lead.leader != self._leader:
            self._lead_by(situation.lead.leader)
        held = self._models.held(dt_s)
        self._leader_model, self._model = held.take(self._leading), held.take(self._followers)
        parameters, state, slots = self._parameters, self._state, situation.slots.take(self._followers)
        leader, follower = self._pairwise(situation)
        turning = leader.turning if self._tow is None else self._tow.turning(leader, slots, dt_s)
        error_m = formation_error(leader.state, follower, slots.position_m, parameters.frame)
        along_mps2, across_mps2 = self._gust(situation, leader.state, follower, dt_s)
        target, lead = self._target(leader.state, follower, turning.rate_rps, slots, across_mps2, dt_s)
        mixed = mix(parameters.mixer, target, follower, self._steady(error_m, target, follower, slots))
        axes = Axes(leader.state.heading_rad if self._tow is None else target.heading_rad, turning)
        forward = feed_forward(target, leader, axes, slots, self._model) + lead
        own = self._own_rates(follower, situation.told, dt_s)
        slope = self._slopes(leader, follower, error_m, target, forward, own, slots)
        rate = fuzzy_pid.filter_rate(state, slope, parameters.derivative_filter_s, dt_s)
        gains = scheduled_gains(parameters, mixed, rate).slowed(self._bandwidth(situation, leader.state, slots))
        output = fuzzy_pid.unlimited(state, gains, mixed, rate)
        answer = gust_lead(target, axes, (along_mps2, across_mps2), self._model)
        gust = answer if self._tow is None else answer * (1.0, 0.0, 1.0)
        replaced = situation.replaced[self._followers]
        bounds = Envelope.of(forward[:, 1], follower, self._model)
        corrected = _difference(bounds.limit(Setpoints.of((forward + output).T)), forward)
        self._correction = self._slewed(corrected, replaced, np.abs(answer), dt_s)
        limited = bounds.limit(Setpoints.of((forward + self._correction + gust).T))
        # What the feed-forward alone asks beyond the envelope isn't the integrators' to work off.
        excess = _difference(limited, bounds.limit(Setpoints.of((forward + gust).T)).table.T) - output
        following = fuzzy_pid.integrate(
            state, gains, mixed, rate, excess, parameters.anti_windup_s, dt_s
        ).with_integral(state.integral, replaced)
        self._keep(following, situation.active[self._followers])
        shown = np.concatenate((gains.proportional, gains.integral, gains.derivative), axis=1)
        return Decision(self._followers, follower, limited, error_m, mixed, shown)

    def _keep(self, following: PidState, active: Mask) -> None:
        """Keep what the next tick needs; those that aren't active begin again."""
        self._state = _where(active, following, self._rest)
        self._drift_mps[:, ~active] = self._correction[~active] = np.nan
        if self._tow is not None:
            self._tow.forget(~active)

    def _pairwise(self, situation: Situation) -> tuple[LeaderMotion, FlightStates]:
        """Return the leader's motion and the followers' states when the followers' setpoints act."""
        table, count = situation.states.of(*self._pairs).table, self._followers.size
        return self._led(situation.lead, FlightStates.of(table[:, :count])), FlightStates.of(table[:, count:])

    def _led(self, lead: Lead, state: FlightStates) -> LeaderMotion:
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

    def _target(
        self,
        leader: FlightStates,
        follower: FlightStates,
        turn_rps: Array,
        slots: SlotMotion,
        across_mps2: Array,
        dt_s: float,
    ) -> tuple[Target, Array]:
        """Return the slots' targets, and by how much setpoints lead them beyond the feed-forward, (F, 3).

        In the follower's own frame a gust across has the heading crab slowly, and swing a slot at the side as it does:
        speed is led by that.
        """
        frame, model, speed = self._parameters.frame, self._model, leader.airspeed_mps
        if self._tow is None:
            return slot_target(leader, follower, turn_rps, slots, frame), np.zeros((speed.size, CHANNELS))
        axis, swung_m = follower.heading_rad, -slots.position_m[:, 1]
        (along_mps, _), (_, late_mps) = rotate_to(axis, *drift(leader, follower)), rotate_to(axis, *self._drift_mps)
        crab = self._tow.crab(late_mps, across_mps2, speed, dt_s)
        crabbing = FlightStates.of(follower.table.copy())
        crabbing.wind_mps[:] = leader.wind_mps + rotate_to(-axis, along_mps, -speed * crab.angle_rad)
        target = slot_target(leader, crabbing, turn_rps, slots, frame)
        lead = model.tau_v_s * swung_m * crab.acceleration_rps2, model.tau_psi_s * crab.rate_rps, np.zeros_like(speed)
        return Target(target.speed_mps + swung_m * crab.rate_rps, target.heading_rad), np.array(lead).T

    def _steady(self, error_m: Array, target: Target, follower: FlightStates, slots: SlotMotion) -> Array:
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
        steady_m[:, 1] -= self._tow_m(target, slots) * off
        return steady_m

    @staticmethod
    def _tow_m(target: Target, slots: SlotMotion) -> Array:
        """Return how much farther behind than its slot is a place whose damping the heading's gains are for, (F,)."""
        return np.maximum(TOW_S * target.speed_mps + slots.position_m[:, 0], 0.0)

    def _bandwidth(self, situation: Situation, leader: FlightStates, slots: SlotMotion) -> Array:
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

    def _slewed(self, correction: Array, replaced: Mask, answer: Array, dt_s: float) -> Array:
        """Return (F, 3) corrections of the feed-forward that grow no faster than a vehicle can follow.

        They shrink as fast as they like, or the loop would lag in large manoeuvres. Heights are limited by their
        envelope. A gust is answered at once: they grow by as much as its `answer` (F, 3) besides. Those of `replaced`
        channels are as wanted: a setpoint that the separation rule replaced isn't one to start from.
        """
        model, before = self._model, np.where(replaced, np.nan, self._correction)[:, :2]
        most = SLEW * dt_s * np.array((model.accel_max_mps2, model.turn_rate_max_rps)).T + answer[:, :2]
        slewed, wanted = correction.copy(), correction[:, :2]
        grown = within(wanted, np.minimum(before, 0.0) - most, np.maximum(before, 0.0) + most)
        slewed[:, :2] = np.where(np.isnan(before), wanted, grown)
        return slewed

    def _slopes(
        self,
        leader: LeaderMotion,
        follower: FlightStates,
        error_m: Array,
        target: Target,
        forward: Array,
        own: Array,
        slots: SlotMotion,
    ) -> Array:
        """Return the rates of change of the mixed errors, (F, 3), from the states and not from earlier errors.

        What the target needs changes at the rate that the feed-forward leads it by. `own` (2, F) are the followers'
        acceleration and turn rate.
        """
        towed = self._parameters.frame == "follower_heading"
        axis_turn_rps = own[1] if towed else leader.turning.rate_rps
        rates = error_rate(leader.state, follower, error_m, slots, axis_turn_rps, self._parameters.frame)
        wanted = (forward[:, :2].T - np.array((target.speed_mps, target.heading_rad))) / self._model.air_lags_s
        if towed:
            off, swing_rps = wrap(follower.heading_rad - target.heading_rad), own[1] - wanted[1]
            along_m, along_mps = self._tow_m(target, slots), slots.velocity_mps[:, 1] * np.sin(off)
            rates[:, 0] += slots.position_m[:, 1] * swing_rps * np.cos(off) + along_mps
            rates[:, 1] -= along_m * swing_rps * np.cos(off)
        mixer, changes = self._parameters.mixer, (wanted - own).T
        weights = np.array((mixer.k_x, mixer.k_y, mixer.k_z))
        return rates * weights + np.column_stack(
            (mixer.k_v * changes[:, 0], mixer.k_psi * changes[:, 1], np.zeros_like(own[0]))
        )

    def _own_rates(self, follower: FlightStates, told: Setpoints, dt_s: float) -> Array:
        """Return the followers' acceleration and turn rate, (2, F), as (7) has them over the tick that ends.

        The others' rates are means of the tick that begins. Setpoints are held in between, so rates fall during a tick:
        those of its beginning would be too large by half of that, whenever the leader turns.
        """
        return air_rates(follower, told.take(self._followers), self._models.take(self._followers).held(-dt_s))

    def _gust(
        self, situation: Situation, leader: FlightStates, follower: FlightStates, dt_s: float
    ) -> tuple[Array, Array]:
        """Return how fast the followers' drift is to be followed, along and across, in m/s².

        The drift is followed with a lag of 1/`gust_radps`, as far as it stands out from what isn't known of the wind.
        """
        seen_mps = drift(leader, follower)
        lagged_mps = np.where(np.isnan(self._drift_mps), seen_mps, self._drift_mps)
        gust_mps = seen_mps - lagged_mps
        self._drift_mps = lagged_mps + gust_mps * -np.expm1(-self._parameters.gust_radps * dt_s)
        unknown = situation.wind_sigma_mps[self._followers] ** 2 + situation.wind_sigma_mps[self._leading] ** 2
        size = np.maximum((gust_mps**2).sum(axis=0), 1e-12)
        certain = np.maximum(1.0 - GUST_SIGMAS**2 * unknown / size, 0.0)
        rate_mps2 = certain * self._parameters.gust_radps * gust_mps
        return rotate_to(slot_axis(leader, follower, self._parameters.frame), *rate_mps2)


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


def _difference(limited: Setpoints, wanted: Array) -> Array:
    return limited.table.T - wanted


def _where(active: Mask, moving: PidState, rest: PidState) -> PidState:
    keep = active[:, None]
    return PidState(
        np.where(keep, moving.integral, rest.integral),
        np.where(keep, moving.rate, rest.rate),
    )
