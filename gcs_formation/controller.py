"""From the vehicles' newest states to everyone's setpoints, in one place and in one order.

state as measured -> state when the setpoint acts -> leader's guidance -> slots -> law -> envelope.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from formation_scenario import Scenario
from gcs_formation import parameters
from gcs_formation.arrays import Array, Instants, Mask
from gcs_formation.control import envelope
from gcs_formation.control.law import Decision, FormationLaw, Situation
from gcs_formation.control.mixer import SlotMotion
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Indices, Setpoints
from gcs_formation.estimation.predictor import SentSetpoints, SetpointHistory, turn_rate
from gcs_formation.formation.slots import schedule
from gcs_formation.guidance.tracking import Lags, Motion
from gcs_formation.guidance.virtual_leader import amid, fly_on
from gcs_formation.records import Tick

LEADER = np.zeros(1, dtype=np.intp)
HELD_FOR_S = 2.0
"""How long followers must stay in their slots to count as assembled."""
CHANNELS = 3


class FormationController:
    """Commands a leader (column 0) and F followers (columns 1 to F). Knows no message and no socket."""

    def __init__(self, scenario: Scenario) -> None:
        """Take law, model, path and slots from the scenario."""
        self.guidance = parameters.leader_guidance(scenario)
        self._scenario = scenario
        self._dt_s = 1.0 / scenario.law.rate_hz
        self._followers = np.arange(1, 1 + len(scenario.followers), dtype=np.intp)
        self._columns = 1 + len(scenario.followers)
        self._model = parameters.autopilot_model(scenario)
        self._leader_model = self._model.take(LEADER)
        self._follower_model = self._model.take(self._followers)
        self._law = FormationLaw(parameters.law_parameters(scenario), len(scenario.followers))
        self._slots = schedule(scenario)
        self._history = SetpointHistory(scenario.law.rate_hz)
        self._in_slots_s = 0.0
        self._leader_told_rad = math.nan
        self._leader_heading_rate_rps = 0.0
        self._flown: Tick | None = None
        self.begin_regardless = False
        """Whether the path is begun even if the formation isn't assembled."""
        self.estimator = StateEstimator(self._columns, scenario.law.disturbance_observer_radps)

    @property
    def model(self) -> AutopilotModel:
        """The autopilot model of every column."""
        return self._model

    @property
    def assembled(self) -> bool:
        """Whether every follower has been in its slot for a while."""
        return self._in_slots_s >= HELD_FOR_S or self.begin_regardless

    def step(self, now: Instant, mission_time_s: float, phase: str, ready: Mask, delay_s: Array, lag_s: Array) -> Tick:
        """Return this tick's setpoints and what led to them.

        Args:
            now: the tick's instant.
            mission_time_s: seconds since the leader started along its path, NaN before.
            phase: recorded with the tick.
            ready: (C,) columns that follow setpoints.
            delay_s: (C,) one-way delay of each column's link, as measured.
            lag_s: (C,) mean wait at the vehicle until a setpoint that arrived is acted on.
        """
        if self._scenario.leader is None:
            self._fly_virtual_leader(now)
        acts = now + np.round((np.nan_to_num(delay_s) + lag_s) * NANOSECONDS).astype(np.int64)
        sent = SentSetpoints(acts, Setpoints(*np.full((CHANNELS, self._columns), np.nan)))
        self._history.add(sent)
        stamps, measured = self.estimator.stamps, self.estimator.state
        known = self.estimator.known
        state = FlightState(*np.full((8, self._columns), np.nan))
        blank = np.full((self._columns, CHANNELS), np.nan)
        tick = Tick(
            now=now,
            mission_time_s=mission_time_s,
            phase=phase,
            state=state,
            setpoints=sent.setpoints,
            age_s=np.where(known, (now - stamps) / NANOSECONDS, np.nan),
            delay_s=delay_s,
            active=ready & known,
            slots_m=blank.copy(),
            error_m=blank.copy(),
            mixed=blank.copy(),
            gains=np.full((self._columns, CHANNELS * CHANNELS), np.nan),
        )
        if not tick.active[0]:
            tick.active[:] = False
            self._in_slots_s = 0.0
            return tick
        self._steer_leader(tick, measured, stamps, acts)
        if self._followers.size:
            self._steer_followers(tick, measured, stamps, acts)
        self._judge_assembly(tick)
        self._flown = tick
        return tick

    def _fly_virtual_leader(self, now: Instant) -> None:
        """Put the virtual leader where it is now: amid the followers at first, on from the last tick then."""
        flown = self._flown
        if flown is not None:
            state = fly_on(flown.state.take(LEADER), flown.setpoints.take(LEADER), flown.now, now, self._leader_model)
        elif self.estimator.known[1:].all():
            followers = self.estimator.state.take(self._followers)
            state = amid(followers, self._slots.at(-1.0).position_m, self._scenario.path.speed_mps)
        else:
            return
        self.estimator.place(0, np.concatenate(_values(state)), now)

    def _steer_leader(self, tick: Tick, measured: FlightState, stamps: Instants, acts: Instants) -> None:
        state = self._project(measured.take(LEADER), stamps[:1], acts[:1], LEADER, self._leader_model)
        _fill(tick.state, LEADER, state)
        motion = Motion(*(float(getattr(state, name)[0]) for name in _MOTION))
        model = self._leader_model
        lags = Lags(float(model.tau_psi_s[0]), float(model.tau_ha_s[0]), float(model.tau_hb_s[0]))
        wanted = self.guidance.steer(motion, float(state.height_m[0]), lags, assembled=self.assembled)
        columns = Setpoints(*(np.array([value]) for value in wanted))
        _fill(tick.setpoints, LEADER, envelope.limit(columns, columns.heading_rad, state, model))
        told_rad, self._leader_told_rad = self._leader_told_rad, float(tick.setpoints.heading_rad[0])
        rate = math.remainder(self._leader_told_rad - told_rad, math.tau) / self._dt_s
        self._leader_heading_rate_rps = 0.0 if math.isnan(rate) else rate

    def _steer_followers(self, tick: Tick, measured: FlightState, stamps: Instants, acts: Instants) -> None:
        which, leading = self._followers, np.zeros_like(self._followers)
        model = self._leader_model.take(leading)
        leader = self._project(measured.take(leading), stamps[leading], acts[which], leading, model)
        follower = self._project(measured.take(which), stamps[which], acts[which], which, self._follower_model)
        slots = self._slots.at(tick.mission_time_s if tick.mission_time_s >= 0 else -1.0)
        turn_rps = turn_rate(leader, tick.setpoints.take(leading), model)
        bend_rps2 = (self._leader_heading_rate_rps - turn_rps) / model.tau_psi_s
        situation = Situation(leader, turn_rps, bend_rps2, follower, slots, self._follower_model)
        active = tick.active[which]
        decision = self._law.decide(_without_nan(situation, active), active, self._dt_s)
        self._note(tick, decision, follower, slots, active)

    def _project(
        self,
        measured: FlightState,
        stamps: Instants,
        acts: Instants,
        which: Indices,
        model: AutopilotModel,
    ) -> FlightState:
        if not self._scenario.law.delay_compensation:
            return measured
        return self._history.predict(measured, stamps, acts, which, model)

    def _note(self, tick: Tick, decision: Decision, follower: FlightState, slots: SlotMotion, active: Mask) -> None:
        which = self._followers
        _fill(tick.state, which, follower)
        shown = active[:, None]
        tick.slots_m[which] = slots.position_m
        tick.error_m[which] = np.where(shown, decision.error_m, np.nan)
        tick.mixed[which] = np.where(shown, decision.mixed, np.nan)
        gains = decision.gains
        tick.gains[which] = np.concatenate((gains.proportional, gains.integral, gains.derivative), axis=1)
        told = Setpoints(*(np.where(active, value, np.nan) for value in _values(decision.setpoints)))
        _fill(tick.setpoints, which, told)

    def _judge_assembly(self, tick: Tick) -> None:
        error_m = tick.error_m[self._followers]
        within = bool((np.abs(error_m) < self._scenario.start.tolerance_m).all())
        self._in_slots_s = self._in_slots_s + self._dt_s if within else 0.0


_MOTION = ("north_m", "east_m", "airspeed_mps", "heading_rad", "wind_north_mps", "wind_east_mps")


def _values(columns: FlightState | Setpoints) -> list[Array]:
    return [getattr(columns, name) for name in columns.__dataclass_fields__]


def _fill(target: FlightState | Setpoints, which: Indices, source: FlightState | Setpoints) -> None:
    for into, values in zip(_values(target), _values(source), strict=True):
        into[which] = values


def _without_nan(situation: Situation, active: Mask) -> Situation:
    """Give followers that aren't there the leader's state, so that nothing is computed with NaN."""
    follower = FlightState(
        *(
            np.where(active, own, leaders)
            for own, leaders in zip(_values(situation.follower), _values(situation.leader), strict=True)
        )
    )
    return replace(situation, follower=follower)
