"""The laws that a scenario can name: one table, which holds all that differs between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flight_model.autopilot_model import AutopilotModel, FlightState, rate, within, wrap
from formation_scenario import Scenario
from formation_scenario import formation as keys
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.follower import Controller, FollowerController, LawParameters, Pair
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, ChannelConstants, FuzzyGainScheduler, GainRange, PidGains
from gcs_formation.control.setpoint import LeaderMotion, Mixer
from gcs_formation.control.situation import Decided, Law, Situation
from gcs_formation.control.velocity_law import VelocityController
from gcs_formation.guidance.leader_guidance import LeaderCommand

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
        its_model, decided = self._models[self._leader].held(dt_s), list[Decided]()
        for column in self._followers:
            controller, state = self._controllers[column], situation.states.of(column, column)
            if situation.active[column]:
                controller.decide(self._pair(situation, column, state, its_model, dt_s), dt_s)
            else:
                controller.forget()
            decided.append(
                Decided(column, state, controller.setpoint, controller.error_m, controller.mixed, controller.gains)
            )
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
