"""The formation law of all followers: each has a controller of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from flight_model.autopilot import AutopilotModel, FlightState, rate, within, wrap
from flight_model.slot import Triple
from gcs_formation.control.feed_forward import LeaderMotion
from gcs_formation.control.follower import FollowerController, LawParameters, Pair
from gcs_formation.control.situation import Decided, Situation
from gcs_formation.guidance.leader import LeaderCommand


class Controller(Protocol):
    """The law of one follower, with the state it keeps between ticks and what it decided last."""

    setpoint: Triple
    error_m: Triple
    mixed: Triple

    @property
    def gains(self) -> tuple[float, ...]:
        """k_p of the three channels, k_i, k_d."""
        ...

    def decide(self, pair: Pair, dt_s: float) -> None:
        """Compute the setpoint of this tick, which is `dt_s` after the last one."""
        ...

    def retune(self, parameters: LawParameters) -> None:
        """Go on with other gains."""
        ...

    def forget(self) -> None:
        """Start again: it isn't commanded, or follows another leader."""
        ...


class FormationLaw:
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
            made = controller.setpoint, controller.error_m, controller.mixed, controller.gains
            decided.append(Decided(column, state, *made))
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
            situation.commanded[column],
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
    to_climb_m = commanded.height_m - state.height_m - (model.tau_ha_s + model.tau_hb_s) * state.climb_mps
    return LeaderMotion(state, turn_rps, bend_rps2, acceleration_mps2, to_climb_m / (model.tau_ha_s * model.tau_hb_s))
