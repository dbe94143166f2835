"""A leader that isn't a vehicle: its state is the formation's centroid at first, then what its setpoints make of it."""

from __future__ import annotations

from typing import Final

from airlink.clock import Instant
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from formation_scenario.fields import Frame
from gcs_formation.control.setpoint import centroid
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.vehicle_filter import VehicleFilter

VIRTUAL: Final = 0
"""The index of a virtual leader."""


class VirtualLeader:
    """The state of a virtual leader, kept where those of vehicles are."""

    def __init__(
        self,
        filters: list[VehicleFilter],
        history: SetpointHistory,
        model: AutopilotModel,
        frame: Frame,
        *,
        as_centroid: bool,
    ) -> None:
        """Take the vehicles' `filters`, the setpoints' `history`, the leader's model and the slots' frame.

        `as_centroid`: the law commands it, so that it is always the followers' centroid.
        """
        self._filters, self._history, self._model, self._frame, self._as_centroid = (
            filters,
            history,
            model,
            frame,
            as_centroid,
        )

    def begins(self, *, flown: bool) -> bool:
        """Return whether its position is its followers' centroid; `flown`: it has had setpoints."""
        return self._as_centroid or not flown

    def place_at_centroid(self, now: Instant, slots: list[Slot], speed_mps: float, turn_rps: float) -> None:
        """Set its state to the followers' centroid, once all of them are known.

        Args:
            now: this instant.
            slots: of all vehicles.
            speed_mps: at which it begins.
            turn_rps: its turn rate.
        """
        followers = self._filters[1:]
        states = [each.state for each in followers if each.state is not None]
        if len(states) < len(followers):
            return
        state, stamp = centroid(states, slots[1:], speed_mps, turn_rps, self._frame), now
        if self._as_centroid:
            stamp = Instant(sum(each.stamp for each in followers) // len(followers))
        self._filters[VIRTUAL].place(state, stamp)

    def carry_on(self, now: Instant) -> None:
        """Set its state to what its setpoints have made of it."""
        state = self.flown_on(now)
        assert state is not None
        self._filters[VIRTUAL].place(state, now)

    def flown_on(self, now: Instant) -> FlightState | None:
        """Return its present state, predicted through its setpoints; None before it has a position."""
        known = self._filters[VIRTUAL]
        if known.state is None:
            return None
        state = known.state.copy()
        self._history.carry(state, known.stamp, now, VIRTUAL, self._model)
        return state
