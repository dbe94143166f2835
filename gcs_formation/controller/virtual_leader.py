"""A leader that isn't a vehicle: its state is the formation's centroid at first, then what its setpoints make of it.

The centroid is of the vehicles that fly in the formation: one that its pilot flies, or that is lost, moves no other.
"""

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
from gcs_formation.recorder import Tick, VehicleLink

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
        tolerance_m: float,
        *,
        as_centroid: bool,
    ) -> None:
        """Take the vehicles' `filters`, the setpoints' `history`, the leader's model and the slots' frame.

        `tolerance_m`: how near a vehicle is in its slot; `as_centroid`: the law commands it, so that it is always the
        followers' centroid.
        """
        self._filters, self._history, self._model, self._frame, self._tolerance_m, self._as_centroid = (
            filters,
            history,
            model,
            frame,
            tolerance_m,
            as_centroid,
        )
        self.members = list[int]()
        """Indices of the followers at whose centroid it is."""

    def begins(self, *, flown: bool) -> bool:
        """Return whether its position is its followers' centroid; `flown`: it has had setpoints."""
        return self._as_centroid or not flown

    def take_members(self, links: list[VehicleLink], last: Tick | None) -> None:
        """Take the followers that fly in the formation as those at whose centroid it is; `last`: the tick before.

        One that comes back counts from when it is in its slot, so that the leader doesn't leap by its share of the way
        there. Where none counts, all do.
        """
        present = [each for each in range(1, len(links)) if links[each].ready and self._filters[each].state is not None]
        kept = [each for each in present if each in self.members or self._is_in_slot(each, last)]
        self.members = kept or present

    def _is_in_slot(self, index: int, last: Tick | None) -> bool:
        """Return whether a vehicle was in its slot at a tick."""
        return last is not None and all(abs(error_m) < self._tolerance_m for error_m in last.error_of(index))

    def place_at_centroid(self, now: Instant, slots: list[Slot], speed_mps: float, turn_rps: float) -> None:
        """Set its state to its members' centroid; without any it carries on, once it has a position.

        Args:
            now: this instant.
            slots: of all vehicles.
            speed_mps: at which it begins.
            turn_rps: its turn rate.
        """
        if not self.members:
            if self._filters[VIRTUAL].state is not None:
                self.carry_on(now)
            return
        states, stamps = list[FlightState](), 0
        for index in self.members:
            known = self._filters[index]
            assert known.state is not None
            states.append(known.state)
            stamps += known.stamp
        own = [slots[index] for index in self.members]
        stamp = Instant(stamps // len(states)) if self._as_centroid else now
        self._filters[VIRTUAL].place(centroid(states, own, speed_mps, turn_rps, self._frame), stamp)

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
