"""Orders in flight: the operator's, and those planned in the scenario."""

from __future__ import annotations

from collections import deque

from airlink.clock import Instant, after, seconds_between
from formation_scenario import Scenario
from formation_scenario.expectation import LATE_PERIODS
from formation_scenario.orders import Answer, Order, OrderError, parse_order
from formation_scenario.shapes import SHAPE
from formation_scenario.transition_plan import NotFlyableError
from gcs_formation.mission.phase_machine import FlightPhaseMachine
from gcs_formation.mission.reconfiguration import Reconfiguration
from gcs_formation.phases import OVER, Phase
from gcs_formation.recorder import LogEvent


class Orders:
    """Takes orders from the operator and those planned in the scenario."""

    def __init__(
        self,
        scenario: Scenario,
        phase_machine: FlightPhaseMachine,
        reconfiguration: Reconfiguration,
        log_event: LogEvent,
    ) -> None:
        """Carry out changes by `reconfiguration`, and the end of the flight by `phase_machine`."""
        self._phase_machine, self._flight = phase_machine, phase_machine.flight
        self._reconfiguration = reconfiguration
        self._log_event = log_event
        self._duration_s, self._shapes = scenario.duration_s, scenario.registered.names(SHAPE)
        self._latest_s = scenario.duration_s + LATE_PERIODS / scenario.law.rate_hz
        self._planned = deque(sorted((each for _, each in scenario.timed_orders), key=lambda each: each.at_s))
        self._refused: list[str] = []
        self._ended = False
        """Whether a planned order has ended the flight."""

    @property
    def undone(self) -> list[str]:
        """Planned orders and changes of the formation that weren't carried out to their end, with the reasons.

        What an end by order or `--until` prevented isn't counted.
        """
        late = [f"order at {each.at_s:g} s: {each.order}: the flight was over" for each in self._planned]
        late += self._reconfiguration.left + self._reconfiguration.under_way(self._flight_ended)
        missed = [] if self._phase_machine.cut_short else late
        return self._refused + self._reconfiguration.unflown + missed

    @property
    def _flight_ended(self) -> Instant | None:
        """When the flight along the path ended, or was to end if late ticks prolonged it."""
        began, ended = self._flight.path_began, self._flight.path_ended
        if began is None or ended is None or seconds_between(began, ended) < self._latest_s:
            return ended
        return after(began, self._duration_s)

    def resume(self, mission_s: float) -> None:
        """Resume at a mission time: orders planned for earlier have been given."""
        while self._planned and self._planned[0].at_s <= mission_s:
            self._planned.popleft()

    def advance(self, now: Instant) -> None:
        """Give the planned orders that are due, also at the end, unless something else has cut the flight short."""
        if self._phase_machine.cut_short and not self._ended:
            return
        mission_s = self._flight.mission_time_s(now)
        while self._planned and mission_s >= self._planned[0].at_s:
            planned = self._planned.popleft()
            self._reconfiguration.record_lateness(mission_s - planned.at_s)
            answer = self.execute(planned.order, now)
            self._ended = self._ended or (answer.accepted and self._flight.phase in OVER)
            if not answer.accepted:
                self._refused.append(f"order at {planned.at_s:g} s: {answer.text}")

    def execute(self, text: str, now: Instant) -> Answer:
        """Carry out an order, or refuse it with a reason; record both as an event."""
        try:
            refusal = self._carry_out(parse_order(text, shapes=self._shapes), now)
        except (OrderError, NotFlyableError, ValueError) as error:
            refusal = str(error)
        answer = Answer(refusal is None, f"{text}: {'accepted' if refusal is None else f'refused: {refusal}'}")
        self._log_event(now, "order", answer.text, None, {"accepted": answer.accepted})
        return answer

    def consider(self, text: str, now: Instant) -> Answer:
        """Return what the answer to an order would be, without carrying it out."""
        try:
            refusal = self._refusal(parse_order(text, shapes=self._shapes), now)
        except (OrderError, NotFlyableError, ValueError) as error:
            refusal = str(error)
        return Answer(refusal is None, f"{text}: {'can be done' if refusal is None else f'refused: {refusal}'}")

    def _refusal(self, order: Order, now: Instant) -> str | None:
        if order.end is not None:
            return self._phase_machine.why_not_end(order.end)
        if self._not_flying is not None:
            return self._not_flying
        if order.speed_mps is not None:
            return self._reconfiguration.why_not_speed(order.speed_mps, now)
        if order.heading_rad is not None:
            return self._reconfiguration.why_not_heading()
        return None if order.change is None else self._reconfiguration.why_not_change(order.change, now)

    @property
    def _not_flying(self) -> str | None:
        """Why no order but one that ends the flight can be carried out; None if it can."""
        if self._flight.phase in (Phase.ASSEMBLING, Phase.FLYING):
            return None
        return f"the run is {self._flight.phase.value}; allowed: assembling, flying"

    def _carry_out(self, order: Order, now: Instant) -> str | None:
        if order.end is not None:
            return self._phase_machine.end_by_order(order.end, now)
        if self._not_flying is not None:
            return self._not_flying
        if order.speed_mps is not None:
            return self._reconfiguration.order_speed(order.speed_mps, now)
        if order.heading_rad is not None:
            return self._reconfiguration.order_heading(order.heading_rad, now)
        return None if order.change is None else self._reconfiguration.order_change(order.change, now)
