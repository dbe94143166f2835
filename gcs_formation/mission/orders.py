"""Orders in flight: carries them out, or refuses them with a reason."""

from __future__ import annotations

from collections import deque
from typing import Protocol

from airlink.clock import Instant
from formation_scenario import Scenario
from formation_scenario.orders import End, Order, OrderError, parse_order
from formation_scenario.transition_plan import NotFlyableError
from gcs_formation.answer import Answer
from gcs_formation.mission.reconfiguration import Reconfiguration
from gcs_formation.phases import Flight, Phase
from gcs_formation.recorder import Note


class EndFlight(Protocol):
    """Ends a flight."""

    def __call__(self, manner: End, now: Instant) -> str | None:
        """End the flight; return why that isn't possible, None if it is."""
        ...


class Orders:
    """Takes orders from the operator and those that the scenario plans."""

    def __init__(
        self, scenario: Scenario, flight: Flight, reconfiguration: Reconfiguration, end: EndFlight, note: Note
    ) -> None:
        """Carry out changes by `reconfiguration`, and the flight's end by `end`."""
        self._flight = flight
        self._reconfiguration = reconfiguration
        self._end = end
        self._note = note
        self._planned = deque(sorted(scenario.orders, key=lambda each: each.at_s))

    def resume(self, mission_s: float) -> None:
        """Go on after a mission time; what was planned for before has been given."""
        while self._planned and self._planned[0].at_s <= mission_s:
            self._planned.popleft()

    def advance(self, now: Instant) -> None:
        """Give the planned orders that are due."""
        mission_s = self._flight.mission_time_s(now)
        while self._planned and mission_s >= self._planned[0].at_s:
            self.take(self._planned.popleft().order, now)

    def take(self, text: str, now: Instant) -> Answer:
        """Carry out an order, or refuse it with a reason; record either as an event."""
        try:
            refusal = self._carry_out(parse_order(text), now)
        except (OrderError, NotFlyableError, ValueError) as error:
            refusal = str(error)
        answer = Answer(refusal is None, f"{text}: {'accepted' if refusal is None else f'refused: {refusal}'}")
        self._note(now, "order", answer.text, None, {"accepted": answer.accepted})
        return answer

    def _carry_out(self, order: Order, now: Instant) -> str | None:
        if order.end is not None:
            return self._end(order.end, now)
        if self._flight.phase not in (Phase.ASSEMBLING, Phase.FLYING):
            return f"the run is {self._flight.phase.value}; allowed: assembling, flying"
        if order.speed_mps is not None:
            return self._reconfiguration.order_speed(order.speed_mps, now)
        if order.heading_rad is not None:
            return self._reconfiguration.order_heading(order.heading_rad, now)
        return None if order.change is None else self._reconfiguration.order_change(order.change, now)
