"""The formation law of all followers: each has a controller of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from flight_model.autopilot import AutopilotModel, FlightState, rate, within, wrap
from gcs_formation.control.feed_forward import LeaderMotion
from gcs_formation.control.follower import FollowerController, LawParameters, Pair
from gcs_formation.control.mixer import Triple
from gcs_formation.control.situation import Decision, Situation
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices, Setpoints
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

    def forget(self) -> None:
        """Start again: it isn't commanded, or follows another leader."""
        ...


class FormationLaw:
    """The law of all followers, with the state it keeps between ticks."""

    def __init__(
        self,
        parameters: LawParameters,
        model: AutopilotModels,
        controller: Callable[[LawParameters], Controller] = FollowerController,
    ) -> None:
        """Start at rest, with a `controller` for each vehicle.

        `model` has (C,) columns, and is read anew at every tick: its lags are learnt in flight.
        """
        self._model = model
        self._controllers = [controller(parameters) for _ in model.tau_v_s]
        self._lead_by(0)

    def _lead_by(self, leader: int) -> None:
        """Start again behind a new leader: what the integrators hold belongs to the old pair of leader and follower."""
        everyone = np.arange(len(self._controllers), dtype=np.intp)
        self._leader = leader
        self._columns: Indices = everyone[everyone != leader]
        self._followers: list[int] = self._columns.tolist()
        leading = np.full_like(self._columns, leader)
        self._pairs = np.concatenate((leading, self._columns)), np.tile(self._columns, 2)
        for controller in self._controllers:
            controller.forget()

    def decide(self, situation: Situation, dt_s: float) -> Decision:
        """Return the followers' setpoints; the controllers of those that aren't active are kept at rest."""
        if situation.lead.leader != self._leader:
            self._lead_by(situation.lead.leader)
        active: list[bool] = situation.active.tolist()
        states, pairs = self._pairs_at(situation, dt_s)
        for column, pair in zip(self._followers, pairs, strict=True):
            if active[column]:
                self._controllers[column].decide(pair, dt_s)
            else:
                self._controllers[column].forget()
        made = [self._controllers[column] for column in self._followers]
        return Decision(
            self._columns,
            states,
            Setpoints.of(np.array([each.setpoint for each in made]).T),
            np.array([each.error_m for each in made]),
            np.array([each.mixed for each in made]),
            np.array([each.gains for each in made]),
        )

    def _pairs_at(self, situation: Situation, dt_s: float) -> tuple[FlightStates, list[Pair]]:
        """Return the states of all followers, and each with its leader as its setpoint acts."""
        count, table = len(self._followers), situation.states.of(*self._pairs).table
        following = FlightStates.of(table[:, count:])
        states = zip(self._followers, FlightStates.of(table[:, :count]).each(), following.each(), strict=True)
        held, slots = [model.held(dt_s) for model in self._model.each()], situation.slots.each
        commanded: list[list[float]] = situation.commanded.table.T.tolist()
        variance: list[float] = (situation.wind_sigma_mps**2).tolist()
        bandwidth: list[list[float]] = situation.bandwidth.tolist()
        replaced: list[list[bool]] = situation.replaced.tolist()
        return following, [
            Pair(
                led(situation.lead.commanded[column], leader, held[self._leader]),
                follower,
                slots[column],
                held[column],
                commanded[column],
                variance[column] + variance[self._leader],
                bandwidth[column],
                replaced[column],
            )
            for column, leader, follower in states
        ]


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
