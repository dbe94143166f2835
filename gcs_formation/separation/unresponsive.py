"""Vehicles that may not respond: where they are if they really don't."""

from __future__ import annotations

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from flight_model.autopilot_model import AutopilotModel, FlightState, advance, within
from flight_model.slot import UNKNOWN, Triple
from flight_model.vehicle_arrays import AutopilotModels, FlightStates
from gcs_formation.estimation.projection import Measured
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.recorder import VehicleLink
from gcs_formation.separation.approach import Traffic
from gcs_formation.vehicle.vehicle import UNANSWERED_S


class Unresponsive:
    """Predicts where vehicles are that may not respond: they fly on by the last setpoint that they surely heard."""

    def __init__(self, history: SetpointHistory, models: list[AutopilotModel], *, hovers: bool) -> None:
        """Take the setpoints that were sent from `history`, and the (C,) `models`."""
        self._history, self._models, self._hovers = history, models, hovers
        self._held: list[Triple | None] = [None] * len(models)
        """The setpoint that each vehicle flies on by that doesn't answer; None for those that answer."""
        self._disobeying = [False] * len(models)

    def watch(self, now: Instant, links: list[VehicleLink]) -> None:
        """Note who may not respond, and the setpoint that each of them holds; who disobeys flies straight on."""
        for column, link in enumerate(links):
            answers = now - link.heard <= UNANSWERED_S * NANOSECONDS
            if answers:
                self._held[column] = None
            elif self._held[column] is None:
                self._held[column] = self._history.commanded(link.heard, column)
            self._disobeying[column] = link.disobeying

    @property
    def any(self) -> bool:
        """Whether any vehicle may not respond."""
        for column, held in enumerate(self._held):  # noqa: SIM110 - compiled, `any` costs ten times as much
            if held is not None or self._disobeying[column]:
                return True
        return False

    def among(self, members: list[int]) -> list[int]:
        """Return which of the columns `members` may not respond."""
        return [each for each in members if self._disobeying[each] or self._held[each] is not None]

    def traffic(self, which: list[int], measured: Measured, at: int) -> Traffic:
        """Return vehicles as they are at the instant `at` if they haven't responded since."""
        states: list[FlightState] = []
        for column in which:
            state, elapsed_s = measured.states[column].copy(), max(at - measured.stamps[column], 0) / NANOSECONDS
            model, (speed_mps, heading_rad, height_m) = self._models[column], self._held[column] or UNKNOWN
            speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
            advance(state, model, speed_mps, heading_rad, height_m, elapsed_s)
            states.append(state)
        still = np.zeros(len(which))
        models = AutopilotModels.from_each(self._models[column] for column in which)
        return Traffic(FlightStates.from_each(states), still, still, models, self._hovers)
