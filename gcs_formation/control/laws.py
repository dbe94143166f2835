"""The table of the laws that a scenario can name, how they are made from it, and the law of hovering vehicles."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from flight_model.autopilot_model import AutopilotModel, rate, rotated, within, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3, all_finite
from formation_scenario import Scenario
from formation_scenario import law as keys
from formation_scenario.extensions import FORMATION_LAW, LAW, LAW_KINDS
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.follower import BRAKING_SHARE, FollowerController
from gcs_formation.control.follower_loops import Controller, LawInput, LawParameters
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, ChannelConstants, FuzzyGainScheduler, GainRange, PidGains
from gcs_formation.control.law_interface import CycleInput, Law, LawOutput
from gcs_formation.control.law_over_all import LawOverAll
from gcs_formation.control.outside import Feedback
from gcs_formation.control.setpoint import LeaderMotion, Mixer, error_rate, formation_error, lead_height
from gcs_formation.guidance.leader_commands import LeaderCommand

HOVER_MPS: Final = 0.02
"""Commanded speed below which its course is the leader's heading."""
MIN_CORRECTION_MPS: Final = 0.5
"""Speed correction, horizontal or vertical, that is allowed at any distance."""
CLIMB_ACCEL_MPS2: Final = 1.0
"""Vertical acceleration of multirotors: ArduCopter's WPNAV_ACCEL_Z; PX4's MPC_ACC_DOWN_MAX is larger."""


class VelocityController(Controller):
    """The law of a follower that can hover: (13) and (14) with velocities in place of speed and heading.

    A multirotor flies a commanded velocity over ground in any direction and down to 0. Forward and right are therefore
    equal channels: both use the gains of `law.speed`, and neither is divided by a speed. Slots are defined in the
    leader's frame, which keeps its direction while the leader hovers. Setpoints are a speed and a course.
    """

    def decide(self, pair: LawInput, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
        leader, state, mixer, axis_rad = pair.leader, pair.state, self._parameters.mixer, pair.leader.state.heading_rad
        self.error_m = formation_error(leader.state, state, pair.slot, axis_rad)
        x_mps, y_mps, z_mps = error_rate(leader.state, state, self.error_m, pair.slot, axis_rad, leader.begun_rps)
        self.mixed = mixer.k_x * self.error_m[0], mixer.k_x * self.error_m[1], mixer.k_z * self.error_m[2]
        slopes = mixer.k_x * x_mps, mixer.k_x * y_mps, mixer.k_z * z_mps
        output = self._output(slopes, 1.0, pair, dt_s)
        along_mps, across_mps, height_m = self._limited(pair, _feed_forward(pair), output, dt_s)
        speed_mps = math.hypot(along_mps, across_mps)
        lead_rad = math.atan2(across_mps, along_mps) if speed_mps > HOVER_MPS else 0.0
        self.setpoint = speed_mps, axis_rad + lead_rad, height_m

    def _limited(self, pair: LawInput, forward: Vector3, output: Vector3, dt_s: float) -> Vector3:
        """Return velocities and height within the limits, and update the integrators by what was limited.

        A correction is no faster than the vehicle can brake from before it reaches its slot.
        """
        model, mixed = pair.model, self.mixed
        if not all_finite(output):
            return output
        away_m = math.hypot(self.error_m[0], self.error_m[1])
        max_mps = MIN_CORRECTION_MPS + math.sqrt(2.0 * BRAKING_SHARE * model.accel_max_mps2 * away_m)
        share = _share(output[0], output[1], max_mps)
        along_mps, across_mps = forward[0] + share * output[0], forward[1] + share * output[1]
        share = _share(along_mps, across_mps, model.speed_max_mps)
        along_mps, across_mps = share * along_mps, share * across_mps
        height_m = self._limited_height(pair, forward[2] + output[2])
        if self.feedback is not None:
            along, across, height = along_mps - forward[0], across_mps - forward[1], height_m - forward[2]
            self.feedback.limited((along - output[0], across - output[1], height - output[2]))
            return along_mps, across_mps, height_m
        if not (pair.replaced[0] or pair.replaced[1]):
            self._forward.integrate(mixed[0], along_mps - forward[0] - output[0], dt_s)
            self._right.integrate(mixed[1], across_mps - forward[1] - output[1], dt_s)
        if not pair.replaced[2] and not self._closes_fast(model):
            self._height.integrate(mixed[2], height_m - forward[2] - output[2], dt_s)
        return along_mps, across_mps, height_m

    def _limited_height(self, pair: LawInput, wanted_m: float) -> float:
        """Return a height setpoint with which it climbs no faster, alongside its slot, than it can brake from.

        By (7) a setpoint that is (tau_ha + tau_hb) c above the vehicle is a climb at c.
        """
        model, state, taus_s = pair.model, pair.state, pair.model.tau_ha_s + pair.model.tau_hb_s
        slot_mps = pair.leader.state.climb_mps + pair.slot.up_mps - state.updraught_mps
        max_mps = MIN_CORRECTION_MPS + math.sqrt(2.0 * BRAKING_SHARE * CLIMB_ACCEL_MPS2 * abs(self.error_m[2]))
        alongside_m = state.height_m + taus_s * slot_mps
        height_m = within(wanted_m, alongside_m - taus_s * max_mps, alongside_m + taus_s * max_mps)
        reach_m = model.climb_max_mps * taus_s
        return within(height_m, state.height_m - reach_m, state.height_m + reach_m)


def _feed_forward(pair: LawInput) -> Vector3:
    """Return the feed-forward: velocities along and across the leader's heading, and height.

    The velocity is that of a point in the leader's turning frame, plus its acceleration times the vehicle's time
    constants of speed and course.
    """
    leader, slot, model = pair.leader, pair.slot, pair.model
    turn_rps, bend_rps2, speed_mps = leader.turn_rps, leader.bend_rps2, leader.state.airspeed_mps
    along_mps = speed_mps - leader.begun_rps * slot.right_m + slot.forward_mps
    across_mps = leader.begun_rps * slot.forward_m + slot.right_mps
    along_mps2 = leader.acceleration_mps2 - bend_rps2 * slot.right_m - turn_rps * turn_rps * slot.forward_m
    along_mps2 += slot.forward_mps2 - 2.0 * turn_rps * slot.right_mps
    across_mps2 = speed_mps * turn_rps + bend_rps2 * slot.forward_m - turn_rps * turn_rps * slot.right_m
    across_mps2 += slot.right_mps2 + 2.0 * turn_rps * slot.forward_mps
    height_m = lead_height(leader, slot, model, pair.state.updraught_mps)
    return along_mps + model.tau_v_s * along_mps2, across_mps + model.tau_psi_s * across_mps2, height_m


def _share(along: float, across: float, maximum: float) -> float:
    """Return the factor that limits a vector's length to `maximum`."""
    length = math.hypot(along, across)
    return 1.0 if length <= maximum else maximum / length


MIN_FILTER_S = 1e-6
Nominal = tuple[PidGains, PidGains, PidGains]
"""Of speed, heading and height."""
PRINTED, SYMMETRIC = "law.fuzzy.tables=printed", "law.fuzzy.tables=symmetric"


class FormationLaw(Law):
    """The law of all followers, with its state between ticks."""

    def __init__(
        self,
        parameters: LawParameters,
        models: list[AutopilotModel],
        controller: Callable[[LawParameters], Controller] = FollowerController,
        feedbacks: list[Feedback] | None = None,
    ) -> None:
        """Make a `controller` for each vehicle, with its feedback from outside if there are any.

        The (C,) `models` are read at every tick: their time constants are estimated in flight.
        """
        self._models, self._to_north = models, parameters.frame == "north"
        self._controllers = [controller(parameters) for _ in models]
        if feedbacks is not None:
            for each, feedback in zip(self._controllers, feedbacks, strict=True):
                each.feedback = feedback
        self._lead_by(0)

    def _lead_by(self, leader: int) -> None:
        """Reset the controllers behind a new leader: the integrals belong to the previous one."""
        self._leader = leader
        self._followers = [index for index in range(len(self._controllers)) if index != leader]
        for controller in self._controllers:
            controller.reset()

    def retune(self, parameters: LawParameters) -> None:
        """Use other gains from now on; integrals are kept."""
        for controller in self._controllers:
            controller.retune(parameters)

    def decide(self, cycle_input: CycleInput, dt_s: float) -> list[LawOutput]:
        """Return the followers' setpoints; the controllers of inactive ones are reset."""
        if cycle_input.lead.leader != self._leader:
            self._lead_by(cycle_input.lead.leader)
        its_model, states = self._models[self._leader].held(dt_s), cycle_input.states
        # Each stage runs for all followers: its code then stays in the processor's cache, which can't hold all stages.
        flown = [states.of(index, index) for index in self._followers]
        pairs = list[LawInput | None]()
        for i, index in enumerate(self._followers):
            active = cycle_input.active[index]
            pairs.append(self._pair(cycle_input, index, flown[i], its_model, dt_s) if active else None)
        for i, pair in enumerate(pairs):
            controller = self._controllers[self._followers[i]]
            if pair is None:
                controller.reset()
            else:
                controller.decide(pair, dt_s)
        decided = list[LawOutput]()
        for i, index in enumerate(self._followers):
            of = self._controllers[index]
            error_m, pair = of.error_m, pairs[i]
            if self._to_north and pair is not None:
                error_m = *rotated(-pair.leader.state.heading_rad, error_m[0], error_m[1]), error_m[2]
            decided.append(LawOutput(index, flown[i], of.setpoint, error_m, of.mixed, of.gains))
        return decided

    def _pair(
        self, cycle_input: CycleInput, index: int, state: FlightState, its_model: AutopilotModel, dt_s: float
    ) -> LawInput:
        """Return a follower and its leader when the follower's setpoint acts; `its_model`: the leader's, `held`."""
        leader = cycle_input.states.of(self._leader, index)
        motion = leader_motion(cycle_input.lead.commanded[index], leader, its_model, dt_s)
        slot = cycle_input.slots[index]
        if self._to_north:
            slot = slot.turned(leader.heading_rad, motion.begun_rps, motion.bend_rps2)
        return LawInput(
            motion,
            state,
            slot,
            self._models[index].held(dt_s),
            cycle_input.commanded(index),
            cycle_input.wind_variance[index] + cycle_input.wind_variance[self._leader],
            cycle_input.bandwidth[index],
            cycle_input.replaced[index],
        )


def leader_motion(commanded: LeaderCommand, state: FlightState, model: AutopilotModel, dt_s: float) -> LeaderMotion:
    """Return the motion of a leader in `state` over the tick of `dt_s` in which it follows `commanded` by (7).

    `model` is `held` for a tick. Turn rates are limited to the leader's: its heading setpoint jumps where its route
    changes. By (7) the setpoint's rate is r + tau r' at the tick's beginning, where the turn rate r is its mean less
    half a tick of r'.
    """
    max_rps = model.turn_rate_max_rps
    turn_rps = rate(wrap(commanded.heading_rad - state.heading_rad), model.tau_psi_s, max_rps)
    bend_rps2 = (within(commanded.turn_rps, -max_rps, max_rps) - turn_rps) / max(model.tau_psi_s - dt_s, dt_s / 2.0)
    acceleration_mps2 = rate(commanded.speed_mps - state.airspeed_mps, model.tau_v_s, model.accel_max_mps2)
    own_mps = state.climb_mps - state.updraught_mps
    to_climb_m = commanded.height_m - state.height_m - (model.tau_ha_s + model.tau_hb_s) * own_mps
    climb_change_mps2 = to_climb_m / (model.tau_ha_s * model.tau_hb_s)
    return LeaderMotion(state, turn_rps, bend_rps2, acceleration_mps2, climb_change_mps2, dt_s)


def nominal_gains(scenario: Scenario) -> Nominal:
    """Return the gains that a scenario gives; hovering vehicles use those of speed for both horizontal channels."""
    speed, heading, height = (
        PidGains(channel.kp, channel.ki, channel.kd, scenario.law.derivative_filter_s)
        for channel in _channels(scenario)
    )
    return speed, heading, height


def gain_range(scenario: Scenario) -> GainRange:
    """Return the range of the law's gains about the nominal ones."""
    fuzzy = scenario.law.fuzzy
    return GainRange(fuzzy.base, fuzzy.span) if law_kind(scenario).scheduled else FIXED_GAINS


def _by_velocity(scenario: Scenario) -> bool:
    """Return whether followers are commanded by velocity, not by speed and heading."""
    return scenario.hovers and not law_kind(scenario).mutual


def _channels(scenario: Scenario) -> tuple[keys.PidGains, keys.PidGains, keys.PidGains]:
    law = scenario.law
    return law.speed, law.speed if _by_velocity(scenario) else law.heading, law.height


def law_parameters(scenario: Scenario) -> LawParameters:
    """Return the constants of a law in which each follower has its own controllers and follows the leader."""
    law = scenario.law
    speed, heading, height = (
        ChannelConstants(
            replace(gains, filter_s=max(gains.filter_s, MIN_FILTER_S)),
            channel.error_scale,
            channel.rate_scale,
            law.anti_windup_s,
        )
        for gains, channel in zip(nominal_gains(scenario), _channels(scenario), strict=True)
    )
    scheduler, fuzzy = None, law.fuzzy
    if law_kind(scenario).scheduled:
        rules = fuzzy.table_p, fuzzy.table_i, fuzzy.table_d
        scheduler = FuzzyGainScheduler(fuzzy.tables, rules, gain_range(scenario))
    return LawParameters(
        mixer=Mixer(**law.mixer.model_dump()),
        frame=scenario.formation.frame,
        speed=speed,
        heading=heading,
        height=height,
        scheduler=scheduler,
        gust_radps=law.disturbance_observer_radps,
    )


def formation_law(scenario: Scenario, models: list[AutopilotModel]) -> FormationLaw:
    """Return the law in which each follower has its own controllers and follows the leader."""
    controller = VelocityController if _by_velocity(scenario) else FollowerController
    entry, keys, feedbacks = scenario.registered.get(scenario.law.type, LAW), scenario.law.parameters, None
    if entry is not None:
        feedbacks = [Feedback(entry, keys, index) for index in range(len(models))]
    return FormationLaw(law_parameters(scenario), models, controller, feedbacks)


def law_over_all(scenario: Scenario, models: list[AutopilotModel]) -> LawOverAll:
    """Return the law from outside that makes the setpoints of all followers at once."""
    entry = scenario.registered.get(scenario.law.type, FORMATION_LAW)
    assert entry is not None
    return LawOverAll(entry, scenario, models)


def consensus_law(scenario: Scenario, models: list[AutopilotModel]) -> ConsensusLaw:
    """Return the consensus law, its graph in the order of indices; the scenario's leader has index 0."""
    law, followers = scenario.law.consensus, {each.vehicle_id: 1 + i for i, each in enumerate(scenario.followers)}
    indices = np.array([followers.get(vehicle.vehicle_id, 0) for vehicle in scenario.vehicles], dtype=np.intp)
    weights = np.zeros((1 + len(followers),) * 2)
    weights[np.ix_(indices, indices)] = scenario.adjacency
    frame = scenario.formation.frame
    return ConsensusLaw((law.k1, law.k2, law.k3), weights, sorted(indices.tolist()), frame, models)


@dataclass(frozen=True)
class LawKind:
    """What the commands need to know of a law."""

    name: str
    """As shown in reports."""
    make: Callable[[Scenario, list[AutopilotModel]], Law]
    mutual: bool = False
    """Whether all vehicles, including the leader, follow one another over the scenario's graph; else each the leader.

    A mutual law needs all states at one instant, and its loop is closed around all vehicles at once.
    """
    has_margins: bool = False
    """Whether `gcs_formation.stability` knows its loops: PID channels, or the consensus protocol of a mutual law.

    A law with other feedback has no delay margin of its own there, and nothing may state another law's in its place.
    """
    scheduled: bool = False
    """Whether gains are scheduled about the nominal ones."""
    variants: tuple[tuple[str, tuple[str, ...]], ...] = (("", ()),)
    """Variants that `compare` flies: a suffix of the name, and overrides in the manner of `--set`."""


LAWS: dict[str, LawKind] = {
    "pid": LawKind("PID", formation_law, has_margins=True),
    "fuzzy_pid": LawKind(
        "fuzzy PID",
        formation_law,
        has_margins=True,
        scheduled=True,
        variants=(("", (PRINTED,)), ("_symmetric", (SYMMETRIC,))),
    ),
    "consensus": LawKind("consensus", consensus_law, mutual=True, has_margins=True),
}


def law_kind(scenario: Scenario) -> LawKind:
    """Return the kind of law that a scenario flies."""
    name = scenario.law.type
    entry = scenario.registered.get(name, *LAW_KINDS) if scenario.registered else None
    if entry is None:
        return LAWS[name]
    return LawKind(name, formation_law if entry.kind == LAW else law_over_all)
