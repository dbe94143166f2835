"""Computes the setpoints of all vehicles from their newest states, in one place and in a fixed order.

measured state -> state when the setpoint acts -> leader's guidance -> slots -> law -> envelope -> separation rule ->
fence.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from flight_model.arrays import Array, Instants, Mask, all_of, or_zero
from flight_model.autopilot import FlightState, advance, rate, within, wrap
from formation_scenario import Scenario
from formation_scenario.formation import added
from formation_scenario.slot_motion import SlotMotion
from gcs_formation import parameters
from gcs_formation.control.envelope import Envelope
from gcs_formation.control.laws import law_kind
from gcs_formation.control.situation import Decision, Lead, Situation
from gcs_formation.estimation.estimator import STATES, Sample, StateEstimator
from gcs_formation.estimation.flight_state import FlightStates, Setpoint, Setpoints
from gcs_formation.estimation.projection import Measured, States
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.guidance.leader import ASSEMBLED_S, LeaderCommand, LeaderCommands, LeaderWind, amid
from gcs_formation.guidance.slots import UP, FormationPlan, Outlook
from gcs_formation.recorder import Tick
from gcs_formation.separation.fence import FenceLimits
from gcs_formation.separation.resolver import ConflictResolver

VIRTUAL = 0
"""The column of a virtual leader."""
CHANNELS = 3
AHEAD_POINTS = 5
"""Places along the leader's way at which the ground is looked at."""
GAINS_CHANGE_S = 1.0
"""Time constant with which gains follow a change of the bandwidth, so that no setpoint jumps."""


class Links(NamedTuple):
    """The link to every column, arrays (C,)."""

    ready: Mask
    """Whether it follows setpoints."""
    delay_s: Array
    """One-way delay as measured, half the round trip."""
    ways_s: Array
    """Delay up and down, (C, 2); NaN where it isn't known how the round trip is split."""
    jitter_s: Array
    """Interarrival jitter of the telemetry, NaN where there is none yet."""
    lag_s: Array
    """Half a period of the vehicle's main loop, the mean wait of a setpoint that has arrived, and the time for which
    the station holds it back."""
    hold_s: float
    """How long the leader's setpoints are held back."""
    airborne: Mask
    """Whether it flies, as far as it can be heard."""
    heard: Instants
    """Until when it is known to have heard what it was told."""
    disobeying: Mask
    """Whether it doesn't seem to fly as it was told, though it hears it."""

    @property
    def up_s(self) -> Array:
        """How long a setpoint is on its way, (C,): half the round trip where its split isn't known."""
        return np.where(np.isnan(self.ways_s[:, 0]), self.delay_s, self.ways_s[:, 0])


class FormationController:
    """Commands C columns, one of which leads. Column 0 is the scenario's leader, real or virtual.

    Knows neither messages nor sockets.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Take law, model, path and slots from the scenario."""
        self.guidance = parameters.leader_guidance(scenario)
        self.plan = FormationPlan(scenario)
        self._scenario = scenario
        self._dt_s = 1.0 / scenario.law.rate_hz
        self._compensates = scenario.law.delay_compensation
        self._gains_change = 1.0 - math.exp(-self._dt_s / GAINS_CHANGE_S)
        self._columns = 1 + len(scenario.followers)
        self.model = parameters.autopilot_model(scenario)
        """The autopilot model of every column; its lags follow what the vehicles fly."""
        self._law = law_kind(scenario).make(scenario, self.model)
        self._leader_amid = scenario.leader is None and law_kind(scenario).mutual
        self._clearance = parameters.slot_clearance(scenario)
        self.history = SetpointHistory(scenario.law.rate_hz)
        """The setpoints that were sent, and when each acts."""
        self.lags = parameters.lag_estimator(scenario, self.history, self.model)
        self._projection = parameters.projection(scenario, self.history, self.model)
        self.separation = ConflictResolver(scenario, self.history, self.model)
        self.fence = FenceLimits(scenario, self.model)
        self._in_slots_s, self._leader_wind = 0.0, LeaderWind(self._dt_s)
        self._leader_commands = LeaderCommands(self._dt_s)
        self.last_tick: Tick | None = None
        """The last tick at which there was a leader to follow."""
        self._bandwidth, self._lift_m = np.ones((self._columns, CHANNELS)), np.zeros(self._columns)
        self.estimator = StateEstimator(
            parameters.declared_noise(scenario),
            self.history,
            scenario.telemetry.rate_hz,
            0.0 if scenario.hovers else scenario.law.disturbance_observer_radps,
        )

    def hand_over(self, leader: int, swing_rad: float) -> None:
        """Make another column the leader; it heads `swing_rad` clockwise of the present one."""
        self.plan.hand_over(leader, swing_rad)
        self._leader_commands.forget()

    def places_m(self, now: Instant) -> Array:
        """Return all positions, (C, 3) forward, right and up of the leader, without the lifts over terrain."""
        state, leader = self.estimator.state, self.plan.leader
        places = state.places_after((now - self.estimator.stamps) / NANOSECONDS)
        north, east, up = (places - places[leader]).T
        cos, sin = np.cos(state.heading_rad[leader]), np.sin(state.heading_rad[leader])
        return np.stack((north * cos + east * sin, east * cos - north * sin, up), axis=1) - self._lift_m[:, None] * UP

    def ahead_m(self, seconds: float) -> list[tuple[float, float]]:
        """Return how far north and east the leader gets along its route within some time, m, point by point."""
        route, begin_m = self.guidance.route, self.guidance.distance_m
        if route is None:
            return [(0.0, 0.0)]
        here = route.at(begin_m)
        way_m = np.linspace(0.0, seconds * self.guidance.speed_mps, AHEAD_POINTS).tolist()
        points = [route.at(begin_m + far_m) for far_m in way_m]
        return [(point.north_m - here.north_m, point.east_m - here.east_m) for point in points]

    def take(self, samples: Mapping[int, Sample]) -> None:
        """Take the newest sample of each column that has one."""
        told = np.zeros(self._columns, dtype=bool) if self.last_tick is None else self.last_tick.active
        self.estimator.take(samples, self.model, told)
        for column, sample in samples.items():
            motion = sample.airspeed_mps, sample.heading_rad, sample.height_m, sample.climb_mps
            self.lags.hear(column, sample.stamp, motion)

    def step(
        self,
        now: Instant,
        mission_time_s: float,
        phase: str,
        links: Links,
        margin_used: Array,
        bandwidth: Array,
        *,
        begin_regardless: bool = False,
        heights_m: Array | None = None,
    ) -> Tick:
        """Return this tick's setpoints and what led to them.

        Args:
            now: the tick's instant.
            mission_time_s: seconds since the leader started along its path, NaN before.
            phase: recorded with the tick.
            links: the way to every column.
            margin_used: (C,) share of the delay margin that the loops use.
            bandwidth: (C, 3) share of their full bandwidth that the law's loops should have.
            begin_regardless: begin the path even if followers haven't been in their slots for a while.
            heights_m: (C,) commanded instead of the law's at the end of a flight; NaN where there is none.
        """
        assembled = self._in_slots_s >= ASSEMBLED_S or begin_regardless
        if self._scenario.leader is None:
            self._place_virtual_leader(now)
        active, acts = links.ready & self.estimator.known, self._acts(now, links.up_s, links.lag_s)
        blank = self.blank_tick(now, mission_time_s, phase, links, margin_used.copy())
        self.lags.learn(active & ~links.disobeying)
        self.history.begin(acts)
        if not active[blank.leader]:
            self._in_slots_s = 0.0
            self.separation.rest()
            self.fence.rest()
            return blank
        measured = self._measured(active, acts)
        states = self._projection.take(measured)
        lead, tick = self._steer_leader(replace(blank, active=active), states, assembled=assembled)
        self.history.note(tick.setpoints)  # followers are where the leader is when theirs act
        if self._columns > 1:
            self._bandwidth = self._bandwidth + self._gains_change * (bandwidth - self._bandwidth)
            tick = self._at_heights(self._by_law(tick, states, lead), heights_m)
            tick = self.separation.keep(tick, measured, links.heard, links.disobeying)
        tick = self.fence.keep(tick)
        self.history.note(tick.setpoints)
        self._judge_assembly(tick)
        self.last_tick = tick
        return tick

    def blank_tick(
        self, now: Instant, mission_time_s: float, phase: str, links: Links, margin_used: Array | None = None
    ) -> Tick:
        """Return a tick at which nobody is commanded, as `step`'s begins."""
        known, nobody = self.estimator.known, np.zeros(self._columns, dtype=bool)
        blank = np.full((self._columns, CHANNELS), np.nan)
        return Tick(
            now=now,
            mission_time_s=mission_time_s,
            phase=phase,
            leader=self.plan.leader,
            state=FlightStates.of(np.full((STATES, self._columns), np.nan)),
            setpoints=Setpoints.of(blank.T),
            age_s=np.where(known, (now - self.estimator.stamps) / NANOSECONDS, np.nan),
            delay_s=links.delay_s,
            ways_s=links.ways_s,
            jitter_s=links.jitter_s,
            margin_used=blank[:, 0] if margin_used is None else margin_used,
            active=nobody,
            airborne=links.airborne,
            yielding=nobody,
            slots_m=blank,
            error_m=blank,
            mixed=blank,
            gains=np.full((self._columns, CHANNELS * CHANNELS), np.nan),
        )

    def _acts(self, now: Instant, up_s: Array, lag_s: Array) -> Instants:
        """Return when each column's present setpoint acts; a virtual leader amid the followers acts as they do."""
        acts = now + np.round((or_zero(up_s) + lag_s) * NANOSECONDS).astype(np.int64)
        if self._leader_amid:
            acts[0] = acts[1:].mean()
        return acts

    def _measured(self, active: Mask, acts: Instants) -> Measured:
        """Return the measured states; vehicles that were never heard get the leader's, so that no value is NaN."""
        known, table, stamps = self.estimator.known, self.estimator.state.table, self.estimator.stamps
        leader = self.plan.leader
        filled: Array = np.where(known, table, table[:, [leader]])
        return Measured(FlightStates.of(filled), np.where(known, stamps, stamps[leader]), active, acts)

    def _place_virtual_leader(self, now: Instant) -> None:
        """Place the virtual leader amid the followers; unless the law commands it, it then flies by the model."""
        flown, stamp = self.last_tick, now
        if flown is not None and not self._leader_amid:
            state = self._flown_on(flown, now)
        elif self.estimator.known[1:].all():
            slots = self._slots(now, math.nan if flown is None else flown.mission_time_s)
            state = amid(self.estimator.state.each()[1:], slots.each[1:], self.guidance.speed_mps)
            stamp = Instant(int(self.estimator.stamps[1:].mean())) if self._leader_amid else now
        else:
            return
        self.estimator.place(VIRTUAL, np.array(state.values()), stamp)

    def _flown_on(self, flown: Tick, now: Instant) -> FlightState:
        """Return where a virtual leader is by now that has flown what it was commanded at the last tick."""
        state, model = flown.state.each()[VIRTUAL], self.model.each()[VIRTUAL]
        speed_mps, heading_rad, height_m = flown.setpoints.table[:, VIRTUAL].tolist()
        speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
        advance(state, model, speed_mps, heading_rad, height_m, seconds_between(flown.now, now))
        return state

    def _slots(self, now: Instant, mission_time_s: float) -> SlotMotion:
        return self.plan.at(now / NANOSECONDS, begun=mission_time_s >= 0)

    def _steer_leader(self, tick: Tick, states: States, *, assembled: bool) -> tuple[Lead, Tick]:
        """Return what the followers need to know of the leader, and the tick with its state and setpoint."""
        leading = np.array([tick.leader])
        at = Instant(int(states.instants(leading)[0]))
        flown = states.of(leading, leading)
        state, model = flown.each()[0], self.model.each()[tick.leader]
        guided, rates = self._leader_wind.guided(state, (at - self.estimator.stamps[tick.leader]) / NANOSECONDS)
        wanted = self.guidance.steer(guided, model, assembled=assembled)
        if self._scenario.path.steps:
            steps = added(self._scenario.path.steps, tick.mission_time_s)
            wanted = Setpoint(*(each + step for each, step in zip(wanted, steps, strict=True)))
        commanded = Envelope(wanted.heading_rad, state, model).limit(*wanted)
        short_rad, held = wrap(commanded[1] - state.heading_rad), model.held(self._dt_s)
        rates = rates._replace(turn_rps=rate(short_rad, held.tau_psi_s, held.turn_rate_max_rps))
        self._leader_commands.add(at, LeaderCommand(*commanded, self.guidance.turn_rps(guided, model, rates)))
        followed = states.instants(np.arange(self._columns)) if self._compensates else np.full(self._columns, at)
        commands = [self._leader_commands.at(instant) for instant in followed.tolist()]
        lead = Lead(tick.leader, at, commands, self.guidance.heading(guided))
        state_of_all, setpoints = tick.state.table.copy(), tick.setpoints.table.copy()
        state_of_all[:, leading], setpoints[:, tick.leader] = flown.table, commanded
        return lead, replace(tick, state=FlightStates.of(state_of_all), setpoints=Setpoints.of(setpoints))

    def _by_law(self, tick: Tick, states: States, lead: Lead) -> Tick:
        """Return the tick with what the law decides for all others."""
        slots, commanded_m = self._over_ground(tick, states, lead)
        everyone = np.arange(self._columns, dtype=np.intp)
        situation = Situation(
            states=states,
            lead=lead,
            slots=slots,
            commanded=self.history.told(states.instants(everyone) - 1, everyone),
            wind_sigma_mps=self.estimator.wind_sigma_mps,
            active=tick.active,
            bandwidth=self._bandwidth,
            replaced=self.separation.replaced | self.fence.replaced,
        )
        return self._decided(tick, self._law.decide(situation, self._dt_s), commanded_m)

    def _over_ground(self, tick: Tick, states: States, lead: Lead) -> tuple[SlotMotion, Array]:
        """Return the slots at the instants when setpoints act, clear of the ground, and the slots commanded now."""
        slots, route = self._slots(tick.now, tick.mission_time_s), self.guidance.route
        instants = states.instants(np.arange(self._columns))
        later = self.plan.at_each(instants / NANOSECONDS, begun=tick.mission_time_s >= 0)
        if self._clearance is None or route is None:
            return later, slots.position_m

        def ahead(seconds: float) -> Array:
            return self._slots(after(tick.now, seconds), tick.mission_time_s).position_m

        leading = np.array([tick.leader])
        along_mps, arranged = lead.path.along_mps, self.plan.arrangement
        leader = states.of(leading, leading)
        outlook = Outlook(route, leader, tick.leader, self.guidance.distance_m, along_mps, ahead, arranged)
        at_m = outlook.distance_m + along_mps * ((instants - lead.at) / NANOSECONDS)
        self._clearance.look_ahead(outlook, at_m)
        now_m = outlook.distance_m - along_mps * ((lead.at - tick.now) / NANOSECONDS)
        self._lift_m, _, _ = self._clearance.lift(np.full(at_m.shape, now_m))
        return self._clearance.lifted(later, at_m, along_mps), slots.position_m + self._lift_m[:, None] * UP

    def _decided(self, tick: Tick, decision: Decision, slots_m: Array) -> Tick:
        which, active = decision.columns, tick.active[decision.columns]
        slots, state, setpoints = slots_m.copy(), tick.state.table.copy(), tick.setpoints.table.copy()
        slots[tick.leader] = np.nan
        setpoints[:, which] = np.where(active, decision.setpoints.table, np.nan)
        known = np.isfinite(tick.age_s[which])
        state[:, which[known]] = decision.state.table[:, known]
        flown = replace(tick, state=FlightStates.of(state), setpoints=Setpoints.of(setpoints), slots_m=slots)
        noted = decision.error_m, decision.mixed, decision.gains
        of_all = [np.full((self._columns, values.shape[1]), np.nan) for values in noted]
        for rows, values in zip(of_all, noted, strict=True):
            rows[which] = np.where(active[:, None], values, np.nan)
        return replace(flown, error_m=of_all[0], mixed=of_all[1], gains=of_all[2])

    def _at_heights(self, tick: Tick, heights_m: Array | None) -> Tick:
        """Return a tick with heights (C,) in the place of the law's, within the envelope: slots are left."""
        if heights_m is None:
            return tick
        none, setpoints = np.full((self._columns, CHANNELS), np.nan), tick.setpoints.table.copy()
        states, models = tick.state.each(), self.model.each()
        for column in np.flatnonzero(tick.active & np.isfinite(heights_m)).tolist():
            speed_mps, heading_rad, _ = setpoints[:, column].tolist()
            bounds = Envelope(heading_rad, states[column], models[column])
            setpoints[:, column] = bounds.limit(speed_mps, heading_rad, float(heights_m[column]))
        return replace(tick, setpoints=Setpoints.of(setpoints), slots_m=none, error_m=none)

    def _judge_assembly(self, tick: Tick) -> None:
        within = np.abs(tick.error_m) < self._scenario.start.tolerance_m
        within[tick.leader] = True
        self._in_slots_s = self._in_slots_s + self._dt_s if all_of(within) else 0.0
