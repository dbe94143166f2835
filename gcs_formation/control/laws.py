"""The laws that a scenario can name, in one table of all that differs between them; and the law of what hovers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from flight_model.autopilot_model import AutopilotModel, FlightState, rate, within, wrap
from flight_model.slot import Triple
from formation_scenario import Scenario
from formation_scenario import formation as keys
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.follower import BRAKING_SHARE, Controller, FollowerController, LawParameters, Pair
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, ChannelConstants, FuzzyGainScheduler, GainRange, PidGains
from gcs_formation.control.setpoint import LeaderMotion, Mixer, error_rate, formation_error, lead_height
from gcs_formation.control.situation import Decided, Law, Situation
from gcs_formation.guidance.leader_guidance import LeaderCommand

STANDS_MPS: Final = 0.02
"""Commanded speed below which no direction is taken from it."""
LEAST_CORRECTION_MPS: Final = 0.5
"""Corrections up to this are never limited by that."""


class VelocityController(Controller):
    """The law of a follower that hovers: (13) and (14) with velocities in the place of speed and heading.

    A multirotor flies the velocity over ground that it is told, in any direction and down to 0, so forward and right
    are two channels of one kind: both have the gains of `law.speed`, and neither is divided by a speed. Slots lie in
    the leader's frame, which keeps its direction where the leader stands. A commanded velocity is told as a speed and a
    course.
    """

    def decide(self, pair: Pair, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
        leader, state, mixer, axis_rad = pair.leader, pair.state, self._parameters.mixer, pair.leader.state.heading_rad
        self.error_m = formation_error(leader.state, state, pair.slot, axis_rad)
        x_mps, y_mps, z_mps = error_rate(leader.state, state, self.error_m, pair.slot, axis_rad, leader.turn_rps)
        self.mixed = mixer.k_x * self.error_m[0], mixer.k_x * self.error_m[1], mixer.k_z * self.error_m[2]
        slopes = mixer.k_x * x_mps, mixer.k_x * y_mps, mixer.k_z * z_mps
        output = self._output(slopes, 1.0, pair, dt_s)
        along_mps, across_mps, height_m = self._limited(pair, _feed_forward(pair), output, dt_s)
        speed_mps = math.hypot(along_mps, across_mps)
        aside_rad = math.atan2(across_mps, along_mps) if speed_mps > STANDS_MPS else 0.0
        self.setpoint = speed_mps, axis_rad + aside_rad, height_m

    def _limited(self, pair: Pair, forward: Triple, output: Triple, dt_s: float) -> Triple:
        """Return velocities and height within the limits, and have the controllers integrate what is left.

        A correction is no faster than a vehicle can brake from until it is in its slot.
        """
        model, mixed = pair.model, self.mixed
        away_m = math.hypot(self.error_m[0], self.error_m[1])
        most_mps = LEAST_CORRECTION_MPS + math.sqrt(2.0 * BRAKING_SHARE * model.accel_max_mps2 * away_m)
        share = _share(output[0], output[1], most_mps)
        along_mps, across_mps = forward[0] + share * output[0], forward[1] + share * output[1]
        share = _share(along_mps, across_mps, model.speed_max_mps)
        along_mps, across_mps = share * along_mps, share * across_mps
        reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        height_m = within(forward[2] + output[2], pair.state.height_m - reach_m, pair.state.height_m + reach_m)
        if not (pair.replaced[0] or pair.replaced[1]):
            self._forward.integrate(mixed[0], along_mps - forward[0] - output[0], dt_s)
            self._right.integrate(mixed[1], across_mps - forward[1] - output[1], dt_s)
        if not pair.replaced[2]:
            self._height.integrate(mixed[2], height_m - forward[2] - output[2], dt_s)
        return along_mps, across_mps, height_m


def _feed_forward(pair: Pair) -> Triple:
    """Return what holds the slot without any error: velocities along and across the leader's heading, and height.

    They are the velocity of a point of the leader's turning frame, led by its acceleration over the vehicle's lags of
    speed and of course.
    """
    leader, slot, model = pair.leader, pair.slot, pair.model
    turn_rps, bend_rps2, speed_mps = leader.turn_rps, leader.bend_rps2, leader.state.airspeed_mps
    along_mps = speed_mps - turn_rps * slot.right_m + slot.forward_mps
    across_mps = turn_rps * slot.forward_m + slot.right_mps
    along_mps2 = leader.acceleration_mps2 - bend_rps2 * slot.right_m - turn_rps * turn_rps * slot.forward_m
    along_mps2 += slot.forward_mps2 - 2.0 * turn_rps * slot.right_mps
    across_mps2 = speed_mps * turn_rps + bend_rps2 * slot.forward_m - turn_rps * turn_rps * slot.right_m
    across_mps2 += slot.right_mps2 + 2.0 * turn_rps * slot.forward_mps
    height_m = lead_height(leader, slot, model, pair.state.updraught_mps)
    return along_mps + model.tau_v_s * along_mps2, across_mps + model.tau_psi_s * across_mps2, height_m


def _share(along: float, across: float, most: float) -> float:
    """Return to which share a vector is shortened that may be no longer than `most`."""
    length = math.hypot(along, across)
    return 1.0 if length <= most else most / length


LEAST_FILTER_S = 1e-6
Nominal = tuple[PidGains, PidGains, PidGains]
"""Of speed, heading and height."""
PRINTED, SYMMETRIC = "law.fuzzy.tables=printed", "law.fuzzy.tables=symmetric"


class FormationLaw(Law):
    """The law of all followers, with the state it keeps between ticks."""

    def __init__(
        self,
        parameters: LawParameters,
        models: list[AutopilotModel],
        controller: Callable[[LawParameters], Controller] = FollowerController,
    ) -> None:
        """Start at rest, with a `controller` for each vehicle.

        The (C,) `models` are read anew at every tick: their lags are learnt in flight.
        """
        self._models = models
        self._controllers = [controller(parameters) for _ in models]
        self._lead_by(0)

    def _lead_by(self, leader: int) -> None:
        """Start again behind a new leader: what the integrators hold belongs to the old pair of leader and follower."""
        self._leader = leader
        self._followers = [column for column in range(len(self._controllers)) if column != leader]
        for controller in self._controllers:
            controller.forget()

    def retune(self, parameters: LawParameters) -> None:
        """Go on with other gains; integrators keep what they hold."""
        for controller in self._controllers:
            controller.retune(parameters)

    def decide(self, situation: Situation, dt_s: float) -> list[Decided]:
        """Return the followers' setpoints; the controllers of those that aren't active are kept at rest."""
        if situation.lead.leader != self._leader:
            self._lead_by(situation.lead.leader)
        its_model, states = self._models[self._leader].held(dt_s), situation.states
        # Stage by stage for all: the code of a stage stays in the processor's cache, that of all stages doesn't fit.
        flown = [states.of(column, column) for column in self._followers]
        pairs = list[Pair | None]()
        for i, column in enumerate(self._followers):
            active = situation.active[column]
            pairs.append(self._pair(situation, column, flown[i], its_model, dt_s) if active else None)
        for i, pair in enumerate(pairs):
            controller = self._controllers[self._followers[i]]
            if pair is None:
                controller.forget()
            else:
                controller.decide(pair, dt_s)
        decided = list[Decided]()
        for i, column in enumerate(self._followers):
            of = self._controllers[column]
            decided.append(Decided(column, flown[i], of.setpoint, of.error_m, of.mixed, of.gains))
        return decided

    def _pair(
        self, situation: Situation, column: int, state: FlightState, its_model: AutopilotModel, dt_s: float
    ) -> Pair:
        """Return a follower, and its leader, whose `held` model is `its_model`, as the follower's setpoint acts."""
        leader = situation.states.of(self._leader, column)
        return Pair(
            led(situation.lead.commanded[column], leader, its_model),
            state,
            situation.slots[column],
            self._models[column].held(dt_s),
            situation.commanded(column),
            situation.wind_variance[column] + situation.wind_variance[self._leader],
            situation.bandwidth[column],
            situation.replaced[column],
        )


def led(commanded: LeaderCommand, state: FlightState, model: AutopilotModel) -> LeaderMotion:
    """Return the motion of a leader in `state`, by a `held` model; its heading lags what is commanded by (7).

    Its setpoint jumps where its route changes. The slots turn no faster than the leader can.
    """
    most_rps = model.turn_rate_max_rps
    turn_rps = rate(wrap(commanded.heading_rad - state.heading_rad), model.tau_psi_s, most_rps)
    bend_rps2 = (within(commanded.turn_rps, -most_rps, most_rps) - turn_rps) / model.tau_psi_s
    acceleration_mps2 = rate(commanded.speed_mps - state.airspeed_mps, model.tau_v_s, model.accel_max_mps2)
    own_mps = state.climb_mps - state.updraught_mps
    to_climb_m = commanded.height_m - state.height_m - (model.tau_ha_s + model.tau_hb_s) * own_mps
    return LeaderMotion(state, turn_rps, bend_rps2, acceleration_mps2, to_climb_m / (model.tau_ha_s * model.tau_hb_s))


def nominal_gains(scenario: Scenario) -> Nominal:
    """Return the gains that a scenario gives; vehicles that hover fly velocities, across as along."""
    speed, heading, height = (
        PidGains(channel.kp, channel.ki, channel.kd, scenario.law.derivative_filter_s)
        for channel in _channels(scenario)
    )
    return speed, heading, height


def gain_range(scenario: Scenario) -> GainRange:
    """Return the range in which the law moves its gains about the nominal ones."""
    fuzzy = scenario.law.fuzzy
    return GainRange(fuzzy.base, fuzzy.span) if law_kind(scenario).scheduled else FIXED_GAINS


def _by_velocity(scenario: Scenario) -> bool:
    """Return whether followers are commanded velocities, not speed and heading."""
    return scenario.hovers and not law_kind(scenario).mutual


def _channels(scenario: Scenario) -> tuple[keys.PidGains, keys.PidGains, keys.PidGains]:
    law = scenario.law
    return law.speed, law.speed if _by_velocity(scenario) else law.heading, law.height


def law_parameters(scenario: Scenario) -> LawParameters:
    """Return the constants of a law in which each follows the leader by controllers of its own."""
    law = scenario.law
    speed, heading, height = (
        ChannelConstants(
            PidGains(gains.kp, gains.ki, gains.kd, max(gains.filter_s, LEAST_FILTER_S)),
            channel.error_scale,
            channel.rate_scale,
            law.anti_windup_s,
        )
        for gains, channel in zip(nominal_gains(scenario), _channels(scenario), strict=True)
    )
    return LawParameters(
        mixer=Mixer(**law.mixer.model_dump()),
        frame=scenario.formation.frame,
        speed=speed,
        heading=heading,
        height=height,
        gain_range=gain_range(scenario),
        scheduler=FuzzyGainScheduler(law.fuzzy.tables) if law_kind(scenario).scheduled else None,
        gust_radps=law.disturbance_observer_radps,
    )


def formation_law(scenario: Scenario, models: list[AutopilotModel]) -> FormationLaw:
    """Return the law in which each follows the leader by controllers of its own."""
    controller = VelocityController if _by_velocity(scenario) else FollowerController
    return FormationLaw(law_parameters(scenario), models, controller)


def consensus_law(scenario: Scenario, models: list[AutopilotModel]) -> ConsensusLaw:
    """Return the consensus law, its graph in the order of the columns: that of the scenario's leader is 0."""
    law, followers = scenario.law.consensus, {each.vehicle_id: 1 + i for i, each in enumerate(scenario.followers)}
    columns = np.array([followers.get(vehicle.vehicle_id, 0) for vehicle in scenario.vehicles], dtype=np.intp)
    weights = np.zeros((1 + len(followers),) * 2)
    weights[np.ix_(columns, columns)] = scenario.adjacency
    frame = scenario.formation.frame
    return ConsensusLaw((law.k1, law.k2, law.k3), weights, sorted(columns.tolist()), frame, models)


@dataclass(frozen=True)
class LawKind:
    """What the commands need to know of a law."""

    name: str
    """As reports show it."""
    make: Callable[[Scenario, list[AutopilotModel]], Law]
    mutual: bool = False
    """Whether vehicles follow one another over the scenario's graph, the leader among them; else each the leader.

    Their states are then needed at one instant, and their loops are closed around all at once.
    """
    scheduled: bool = False
    """Whether gains are moved about the nominal ones."""
    variants: tuple[tuple[str, tuple[str, ...]], ...] = (("", ()),)
    """What `compare` flies of it: the ending of the name, and overrides in the manner of `--set`."""


LAWS: dict[keys.LawType, LawKind] = {
    "pid": LawKind("PID", formation_law),
    "fuzzy_pid": LawKind(
        "fuzzy PID",
        formation_law,
        scheduled=True,
        variants=(("", (PRINTED,)), ("_symmetric", (SYMMETRIC,))),
    ),
    "consensus": LawKind("consensus", consensus_law, mutual=True),
}


def law_kind(scenario: Scenario) -> LawKind:
    """Return what there is to know of the law that a scenario flies."""
    return LAWS[scenario.law.type]
