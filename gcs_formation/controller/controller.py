"""Computes the setpoints of all vehicles from their newest states, in steps that stages of the control cycle call.

measured state -> state when the setpoint acts -> leader's guidance -> slots -> law -> envelope.
"""

from __future__ import annotations

import math

import numpy as np
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS, Instant, nanoseconds
from flight_model.arrays import Array
from flight_model.autopilot_model import finite, within
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Slot, Vector3
from formation_scenario import Scenario
from gcs_formation import from_scenario
from gcs_formation.control.finite import (
    GUIDANCE,
    LAW,
    PREDICTOR,
    FiniteStates,
    require_decision,
    require_slots,
)
from gcs_formation.control.law_interface import CycleInput, Lead
from gcs_formation.control.laws import law_kind, law_parameters
from gcs_formation.control.setpoint import AS_DECIDED, Envelope
from gcs_formation.control.straight_on import StraightOn
from gcs_formation.controller.assembly import Assembly
from gcs_formation.controller.bandwidth import Bandwidth
from gcs_formation.controller.leader_steering import LeaderSteering
from gcs_formation.controller.present_positions import positions_from_leader
from gcs_formation.controller.slots_over_ground import SlotsOverGround
from gcs_formation.controller.virtual_leader import VIRTUAL, VirtualLeader
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.estimation.projection import MeasuredStates, States
from gcs_formation.estimation.sample import Sample
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.extend.in_flight import OnTicks, on_ticks
from gcs_formation.guidance.path_ahead import path_ahead
from gcs_formation.guidance.slots import FormationPlan
from gcs_formation.recorder import Tick, VehicleLink, unknown_state


class FormationController:
    """Commands C vehicles, one of which is the leader. Index 0 is the scenario's leader, real or virtual.

    It knows neither messages nor sockets.
    """

    fault: NotFiniteError | None = None
    """What isn't finite of what a part returned; from then on neither guidance nor law is used."""

    def __init__(self, scenario: Scenario) -> None:
        """Build law, models, path and slots from the scenario."""
        self.plan, self.assembly, self._frame = FormationPlan(scenario), Assembly(scenario), scenario.formation.frame
        self._dt_s, self._compensates = 1.0 / scenario.law.rate_hz, scenario.law.delay_compensation
        self._indices = list(range(1 + len(scenario.followers)))
        self.count = len(self._indices)
        self.models = from_scenario.autopilot_models(scenario)
        """The autopilot model of every vehicle; its time constants are updated by their estimator."""
        self._speeds_mps = [(each.speed_min_mps, each.speed_max_mps) for each in self.models]
        self._reached_mps, self._waits_m = [math.inf] * self.count, math.inf
        self._law = law_kind(scenario).make(scenario, self.models)
        self._leads_as_centroid = scenario.leader is None and law_kind(scenario).mutual
        self.history = SetpointHistory(scenario.law.rate_hz)
        """The setpoints sent, and when each acts."""
        self._projection = from_scenario.projection(scenario, self.history, self.models)
        self._turn_rps, self._straight_on = 0.0, StraightOn(self.models, hovers=scenario.hovers)
        self._steering = LeaderSteering(scenario, self.plan, self.models, self.history)
        self.guidance = self._steering.guidance
        self._slots = SlotsOverGround(scenario, self.plan, self.guidance)
        self.last_tick: Tick | None = None
        """The last tick at which there was a leader to follow."""
        self._bandwidth = Bandwidth(self.count, self._dt_s)
        self._outside = on_ticks(scenario, self.models)
        self._commanded_slots, self.slots_m = list[Slot](), list[Vector3]()
        """The slots commanded last, and their positions in the form that a tick records."""
        self._acts = vec[i64]([0] * self.count)
        """When each vehicle's present setpoint acts."""
        observer_radps = scenario.law.disturbance_observer_radps
        self.estimator = StateEstimator(
            from_scenario.declared_noise(scenario),
            self.history,
            scenario.telemetry.rate_hz,
            0.0 if scenario.hovers else observer_radps,
            updraughts=observer_radps > 0.0 and self._compensates,  # a late response to updraughts would oscillate
        )
        self._virtual = None if scenario.leader is not None else self._virtual_leader(scenario.start.tolerance_m)

    def _virtual_leader(self, tolerance_m: float) -> VirtualLeader:
        filters, model, mutual = self.estimator.filters, self.models[VIRTUAL], self._leads_as_centroid
        return VirtualLeader(filters, self.history, model, self._frame, tolerance_m, as_centroid=mutual)

    @property
    def leader_m(self) -> float:
        """The height setpoint by which the leader would keep to its path in still air, m; NaN before its first."""
        return self._steering.leader_m

    def hand_over(self, leader: int, swing_rad: float) -> None:
        """Make another vehicle the leader; its heading is `swing_rad` clockwise of the present leader's."""
        self.plan.hand_over(leader, swing_rad)
        if self._outside is not None:
            self._outside.reset()
        fault = self._steering.hand_over()
        self.fault = self.fault or fault

    def outside(self, scenario: Scenario) -> OnTicks:
        """Return what changes and watches ticks from outside, from now on also if the scenario names nothing."""
        if self._outside is None:
            self._outside = OnTicks(scenario, self.models)
        return self._outside

    def retune(self, scenario: Scenario) -> None:
        """Use another scenario's gains and filters from now on."""
        self._law.retune(law_parameters(scenario))
        if not scenario.hovers:
            self.estimator.observe_wind(scenario.law.disturbance_observer_radps)

    def positions_m(self, now: Instant) -> Array:
        """Return all positions, (C, 3) forward, right and up of the leader, minus terrain-clearance offsets."""
        positions_m = positions_from_leader(self.estimator.filters, self.plan.leader, self._frame, now)
        return positions_m - np.array([(0.0, 0.0, offset_m) for offset_m in self._slots.terrain_offset_m])

    def ahead_m(self, seconds: float) -> list[tuple[float, float]]:
        """Return the leader's path along its route within some time: points north and east of its position, m."""
        if self.fault is not None:
            return self._straight_on.ahead_m(seconds)
        route, begin_m = self.guidance.route, self.guidance.distance_m
        return [(0.0, 0.0)] if route is None else path_ahead(route, begin_m, seconds * self.guidance.speed_mps)

    def update_states(self, samples: list[Sample | None]) -> None:
        """Take the vehicles' newest samples, (C,); None for a vehicle without a new one."""
        commanded = [False] * self.count if self.last_tick is None else self.last_tick.active
        self.estimator.update_states(samples, self.models, commanded)

    def begin_tick(
        self, now: Instant, mission_time_s: float, phase: str, links: list[VehicleLink], margin_used: list[float]
    ) -> Tick:
        """Return a tick without setpoints, for the states as they are now.

        Args:
            now: the tick's instant.
            mission_time_s: seconds since the leader started along its path, NaN before.
            phase: recorded with the tick.
            links: the link to every vehicle.
            margin_used: (C,) share of the delay margin that the loops use.
        """
        if self._virtual is not None and self.fault is None:
            self._place_virtual_leader(self._virtual, now, links)
        self._limit_speeds(links)
        self._steering.set_turn_time_constant()
        self._acts = self._acts_at(now, links)
        return self._blank_tick(now, mission_time_s, phase, links, margin_used)

    def follow(self, tick: Tick) -> bool:
        """Begin the setpoints of a tick; return whether there is a leader to follow. Without one none is commanded."""
        self.history.begin_tick(self._acts)
        tick.virtual_leader = None if self._virtual is None else self._virtual.flown_on(tick.now)
        if not tick.active[tick.leader]:
            tick.active = [False] * self.count
            self.assembly.begin_again()
            return False
        return True

    def decide(self, tick: Tick, bandwidth: list[list[float]], *, begin_regardless: bool = False) -> MeasuredStates:
        """Put the setpoints of guidance and law into a tick; return the states that they are for.

        Args:
            tick: a tick with a leader to follow.
            bandwidth: (C, 3) wanted share of the full bandwidth of the law's loops.
            begin_regardless: begin the path even if followers haven't been in their slots for a while.
        """
        measured = self._measured(tick.active, self._acts)
        if self.fault is None:
            self._decide(tick, measured, bandwidth, assembled=self.assembly.complete or begin_regardless)
        if self.fault is not None:
            measured = self._fly_straight_on(tick, measured)
        return measured

    def _decide(self, tick: Tick, measured: MeasuredStates, bandwidth: list[list[float]], *, assembled: bool) -> None:
        """Put the setpoints of guidance and law into a tick.

        If a part of that returns a value that isn't finite, or fails to compute one, set `fault`.
        """
        part = PREDICTOR
        try:
            states = FiniteStates(self._projection(measured))
            part = GUIDANCE
            lead = self._steer_leader(tick, states, assembled=assembled)
            self._turn_rps = lead.path.turn_rps
            part = LAW
            if self.count > 1:
                self._bandwidth.follow(bandwidth)
                self._by_law(tick, states, lead)
                self._await_followers(tick)
        except NotFiniteError as error:
            self.fault = error
        except (ArithmeticError, ValueError) as error:  # where Python refuses what is NaN or infinite elsewhere
            self.fault = NotFiniteError(part, None, f"{type(error).__name__}: {error}")

    def filter(self, tick: Tick) -> None:
        """Let filters from outside change a tick's setpoints."""
        self._steering.before_filters(tick)
        if self._outside is not None and self.fault is None:
            self.fault = self._outside.filter(tick)

    def take_final(self, tick: Tick) -> None:
        """Take a tick's setpoints as those that are sent."""
        self._steering.after_all(tick)
        self.history.record(tick.setpoints)

    def monitor(self, tick: Tick) -> None:
        """Show a tick to the monitors from outside."""
        if self._outside is not None and self.fault is None:
            self.fault = self._outside.show(tick)

    def conclude(self, tick: Tick) -> None:
        """Judge whether the formation is assembled, and keep the tick as the last one."""
        self.assembly.assess(tick, self.guidance, slots_rest=self.plan.settled(tick.now / NANOSECONDS))
        self.last_tick = tick

    def _fly_straight_on(self, tick: Tick, measured: MeasuredStates) -> MeasuredStates:
        """Put setpoints into a tick that need neither guidance nor law; return the states that are finite."""
        last = UNKNOWN if self.last_tick is None else self.last_tick.setpoints[self.last_tick.leader]
        known = self._straight_on.known(measured, tick.leader, last)
        tick.active, tick.setpoints = known.active, self._straight_on.setpoints(known)
        tick.decided, tick.replaced = [None] * self.count, [AS_DECIDED] * self.count
        tick.state = [state if known.active[index] else unknown_state() for index, state in enumerate(known.states)]
        return known

    def look_on(
        self,
        now: Instant,
        mission_time_s: float,
        phase: str,
        links: list[VehicleLink],
        seen: dict[int, tuple[FlightState, float]],
    ) -> Tick:
        """Return a tick at which no vehicle is commanded; `seen`: states from the newest positions, and their ages."""
        tick = self._blank_tick(now, mission_time_s, phase, links, [math.nan] * self.count)
        tick.active = [False] * self.count
        for index, (state, age_s) in seen.items():
            tick.state[index], tick.age_s[index] = state, age_s
        return tick

    def _blank_tick(
        self, now: Instant, mission_time_s: float, phase: str, links: list[VehicleLink], margin_used: list[float]
    ) -> Tick:
        """Return a tick at which nothing is commanded yet."""
        age_s = [self.estimator.age_s(index, now) for index in self._indices]
        active = [links[index].ready and not math.isnan(age_s[index]) for index in self._indices]
        return Tick(now, mission_time_s, phase, self.plan.leader, links, age_s, list(margin_used), active)

    def bound(self, index: int, accel_max_mps2: float, turn_rate_max_rps: float, climb_max_mps: float) -> None:
        """Bound a vehicle's setpoints by limits that it has reported; the leader's path is for the slowest climb."""
        self.models[index].bound(accel_max_mps2, turn_rate_max_rps, climb_max_mps)
        self.guidance.climb_max_mps = min(self.guidance.climb_max_mps, climb_max_mps)

    def bound_leader(self, max_mps: float) -> None:
        """Bound the leader's speed from the next tick on; infinite: not."""
        self._steering.max_mps = max_mps

    def wait_from(self, error_m: float) -> None:
        """Let slots that move on the path wait for followers that are farther off; infinite: for none."""
        self._waits_m = error_m

    def bound_speed(self, index: int, max_mps: float) -> None:
        """Lower a vehicle's greatest speed, from the next tick on, to what it reaches at present; infinite: don't."""
        self._reached_mps[index] = max_mps

    def _limit_speeds(self, links: list[VehicleLink]) -> None:
        """Set the models' speed limits to the airspeeds that vehicles can be commanded to fly now."""
        for index, link in enumerate(links):
            if link.speeds_mps is not None:
                self._speeds_mps[index] = link.speeds_mps
            slowest_mps, fastest_mps = self._speeds_mps[index]
            self.models[index].reach(slowest_mps, min(fastest_mps, self._reached_mps[index]))

    def _acts_at(self, now: Instant, links: list[VehicleLink]) -> vec[i64]:
        """Return when each vehicle's present setpoint acts; for a leader at vehicles' centroid the mean of theirs."""
        acts, leader = vec[i64]([_acts(now, link) for link in links]), self._virtual
        if leader is not None and leader.members and self._leads_as_centroid:
            acts[0] = sum([acts[index] for index in leader.members]) // len(leader.members)
        return acts

    def _measured(self, active: list[bool], acts: vec[i64]) -> MeasuredStates:
        """Return the measured states; a vehicle never received from gets the leader's, so that no value is NaN."""
        filters = self.estimator.filters
        leader = filters[self.plan.leader]
        assert leader.state is not None
        states: list[FlightState] = [leader.state if each.state is None else each.state for each in filters]
        stamps = vec[i64]([leader.stamp if each.state is None else each.stamp for each in filters])
        return MeasuredStates(states, stamps, active, acts)

    def _by_law(self, tick: Tick, states: States, lead: Lead) -> None:
        """Put the law's setpoints into a tick, and the quantities behind them."""
        slots, commanded_slots = self._slots.at(tick, states, lead)
        require_slots(slots, tick.active)
        variance = [each.wind_variance for each in self.estimator.filters]
        replaced = [AS_DECIDED] * self.count if self.last_tick is None else self.last_tick.replaced
        cycle_input = CycleInput(
            states, lead, slots, self.history, variance, tick.active, self._bandwidth.shares, replaced
        )
        if commanded_slots is not self._commanded_slots:  # the same list while the slots don't change
            self._commanded_slots = commanded_slots
            self.slots_m = [(each.forward_m, each.right_m, each.up_m) for each in commanded_slots]
            self.slots_m[tick.leader] = UNKNOWN
        tick.slots_m = self.slots_m
        for each in self._law.decide(cycle_input, self._dt_s):
            index = each.index
            if tick.active[index]:
                require_decision(each, tick.leader)
                tick.setpoints[index] = each.setpoint
                tick.decided[index] = each
            if not math.isnan(tick.age_s[index]):
                tick.state[index] = each.state

    def _place_virtual_leader(self, leader: VirtualLeader, now: Instant, links: list[VehicleLink]) -> None:
        """Set the virtual leader's state: from the followers' at first or if the law commands it, else by the model."""
        flown = self.last_tick
        if leader.begins(flown=flown is not None):
            slots = self._slots.planned(now, math.nan if flown is None else flown.mission_time_s)
            leader.take_members(links, flown)
            leader.place_at_centroid(now, slots.each, self.guidance.speed_mps, self._turn_rps)
        else:
            leader.carry_on(now)

    def _steer_leader(self, tick: Tick, states: States, *, assembled: bool) -> Lead:
        """Put the leader's setpoint into a tick; return how it goes on."""
        sigma_rad = self.estimator.filters[tick.leader].course_sigma_rad
        turns = self._steering.turn_bounds(tick, self.slots_m, sigma_rad)
        led = self.last_tick is not None and self.last_tick.leader == tick.leader
        return self._steering.steer(tick, states, turns, self._outside, led=led, assembled=assembled)

    def fly_at(self, tick: Tick, heights_m: list[float]) -> None:
        """Replace the law's heights by those for the end of the flight, (C,), within the envelope; slots are given up.

        One vehicle alone goes on at the law's.
        """
        if self.count == 1:
            return
        for index, height_m in enumerate(heights_m):
            if tick.active[index] and finite(height_m):
                speed_mps, heading_rad, _ = tick.setpoints[index]
                bounds = Envelope(heading_rad, tick.state[index], self.models[index])
                tick.setpoints[index] = bounds.limit(speed_mps, heading_rad, height_m)
        tick.slots_m, tick.slots_left = [UNKNOWN] * self.count, True

    def _await_followers(self, tick: Tick) -> None:
        """Slow down the slots' motion while a follower is too far off."""
        pace, from_m = 1.0, self.plan.kept_m if math.isnan(tick.mission_time_s) else self._waits_m
        if from_m < math.inf and not self.plan.settled(tick.now / NANOSECONDS):
            for index in self._indices:
                if tick.active[index] and index != tick.leader:
                    x_m, y_m, _ = tick.error_of(index)
                    pace = min(pace, within(2.0 - math.hypot(x_m, y_m) / from_m, 0.0, 1.0))
        self.plan.wait(pace, self._dt_s)


def _acts(now: Instant, link: VehicleLink) -> int:
    """Return when a setpoint sent now acts; without a vehicle on the link it acts at once."""
    uplink_s = link.uplink_delay_s
    return now + nanoseconds((0.0 if math.isnan(uplink_s) else uplink_s) + link.further_delay_s)
