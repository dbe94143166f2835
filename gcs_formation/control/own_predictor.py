"""A predictor from outside, in place of equation (7) alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from airlink.clock import NANOSECONDS
from airlink.endpoint import VehicleId
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from formation_scenario import Scenario
from formation_scenario.extensions import Registered
from formation_scenario.slot_assignment import ids_by_index
from gcs_formation.control.outside import guarded, made
from gcs_formation.control.plain_values import MeasuredVehicle, Setpoint, State, plain_state, vehicle_name
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.projection import MeasuredStates, Prediction, States
from gcs_formation.estimation.setpoint_history import SetpointHistory


class OwnPrediction(States):
    """The states that an extension predicts; instants are ours."""

    def __init__(
        self,
        entry: Registered,
        keys: Mapping[str, Any],
        scenario: Scenario,
        history: SetpointHistory,
        models: list[AutopilotModel],
    ) -> None:
        """Make an instance; the (C,) `models` and the setpoints in `history` are what our own predictor uses.

        Raises:
            RunAbortedError: it can't begin.
        """
        self._entry = entry
        self._own: Any = made(entry, keys)
        self._identities: list[VehicleId | None] = list(ids_by_index(scenario))
        self._history, self._models = history, models
        self._by_model = Prediction(history, models, scenario.telemetry.rate_hz)
        self._measured: MeasuredStates | None = None
        self._seen: list[MeasuredVehicle] = []
        self._found: dict[tuple[int, int], FlightState] = {}

    def predict(self, measured: MeasuredStates) -> OwnPrediction:
        """Take a tick's states, and show them to the predictor.

        Raises:
            NotFiniteError: it raised an error.
        """
        self._by_model.predict(measured)
        self._measured, self._found = measured, {}
        self._seen = [self._vehicle(index, measured) for index in range(len(measured.states))]
        guarded(self._entry, partial(self._own.take, tuple(self._seen)))
        return self

    def instant(self, whose: int) -> int:
        """Return when the setpoint acts."""
        return self._by_model.instant(whose)

    def of(self, which: int, whose: int) -> FlightState:
        """Return a vehicle's predicted state.

        Raises:
            NotFiniteError: the predictor raised an error, or returned something else than eight finite numbers.
        """
        known = self._found.get((which, whose))
        if known is None:
            known = self._found[which, whose] = self._predicted(which, whose)
        return known

    def _predicted(self, which: int, whose: int) -> FlightState:
        vehicle, follower, to_s = self._seen[which], self._seen[whose], self.instant(whose) / NANOSECONDS
        values = guarded(self._entry, lambda: _eight_numbers(self._own.predict(vehicle, to_s, follower)))
        north_m, east_m, height_m, airspeed_mps, heading_rad, climb_mps, wind_north_mps, wind_east_mps = values
        if not math.isfinite(sum(values)):
            shown = ", ".join([f"{name} {value:.6g}" for name, value in zip(State._fields, values, strict=True)])
            raise NotFiniteError(f"{self._entry} ({self._entry.where})", which, f"state: {shown}")
        state = self._by_model.of(which, whose)
        state.north_m, state.east_m, state.height_m = north_m, east_m, height_m
        state.airspeed_mps, state.heading_rad, state.climb_mps = airspeed_mps, heading_rad, climb_mps
        state.wind_north_mps, state.wind_east_mps = wind_north_mps, wind_east_mps
        return state

    def _vehicle(self, index: int, measured: MeasuredStates) -> MeasuredVehicle:
        identity = self._identities[index]
        return MeasuredVehicle(
            None if identity is None else vehicle_name(identity),
            plain_state(measured.states[index]),
            measured.stamps[index] / NANOSECONDS,
            measured.acts[index] / NANOSECONDS,
            measured.active[index],
            partial(self._carried, index),
            partial(self._commanded, index),
        )

    def _carried(self, index: int, to_s: float) -> State:
        """Return a vehicle's state at a time by equation (7), through the setpoints in flight."""
        assert self._measured is not None
        state, since = self._measured.states[index].copy(), int(self._measured.stamps[index])
        until = max(since, round(to_s * NANOSECONDS))
        self._history.carry(state, since, until, index, self._models[index])
        return plain_state(state)

    def _commanded(self, index: int, at_s: float) -> Setpoint:
        if self._history.empty:
            return Setpoint(math.nan, math.nan, math.nan)
        return Setpoint(*self._history.commanded(round(at_s * NANOSECONDS), index))


def _eight_numbers(values: Iterable[Any]) -> list[float]:
    found = [float(each) for each in values]
    if len(found) != len(State._fields):
        raise ValueError(f"found {len(found)} numbers; allowed: {len(State._fields)}")
    return found
