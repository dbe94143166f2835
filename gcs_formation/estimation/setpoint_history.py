"""The present state from a delayed one: the autopilot model (7) run through the setpoints still in flight."""

from __future__ import annotations

import math

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Indices, Instants
from flight_model.autopilot import AutopilotModel, FlightState, advance, respond, within
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Setpoints

HISTORY_S = 6.0


class _Tick:
    """A tick's setpoints, vehicle by vehicle, and when each is expected to act; NaN until they are known."""

    __slots__ = ("acts", "headings", "heights", "speeds")

    def __init__(self, acts: list[int]) -> None:
        self.acts = acts
        self.speeds: list[float] = [math.nan] * len(acts)
        self.headings: list[float] = self.speeds
        self.heights: list[float] = self.speeds


class SetpointHistory:
    """The setpoints sent to every vehicle in the last seconds, oldest first."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of ticks at `rate_hz`."""
        self.length = max(8, int(HISTORY_S * rate_hz))
        self._ticks: list[_Tick] = []

    @property
    def empty(self) -> bool:
        """Whether nothing has been sent yet."""
        return not self._ticks

    def begin(self, acts: Instants) -> None:
        """Begin a tick whose setpoints act at `acts`, (V,); until they are known, vehicles fly straight on then."""
        if len(self._ticks) == self.length:
            del self._ticks[0]
        self._ticks.append(_Tick(acts.tolist()))

    def note(self, setpoints: Setpoints) -> None:
        """Take the setpoints of the tick that was begun last, (V,), NaN for those that aren't known yet."""
        tick = self._ticks[-1]
        tick.speeds, tick.headings, tick.heights = setpoints.table.tolist()

    def predict(
        self, state: FlightStates, since: Instants, until: Instants, vehicles: Indices, model: AutopilotModels
    ) -> FlightStates:
        """Return the state of each column at `until`, from its `state` at `since`.

        Column i is vehicle `vehicles[i]`; a vehicle may appear in several columns.
        """
        states, models = state.each(), model.each()
        columns = zip(states, since.tolist(), until.tolist(), vehicles.tolist(), models, strict=True)
        for each, since_ns, until_ns, vehicle, its_model in columns:
            self.predicted(each, since_ns, until_ns, vehicle, its_model)
        return FlightStates.from_each(states)

    def predicted(
        self, state: FlightState, since: int, until: int, vehicle: int, model: AutopilotModel, *, place: bool = True
    ) -> None:
        """Move a vehicle's `state` on from `since` to `until`, instants in ns, through what it was sent.

        Before the oldest known setpoint it is taken to follow that one already, and without any setpoint to fly
        straight on. Without `place`, north and east are left as they are.
        """
        ticks, last = self._ticks, len(self._ticks) - 1
        first = self._acting(since, vehicle)
        for index in range(first, last + 1):
            tick, end = ticks[index], until
            if index < last:
                end = min(max(ticks[index + 1].acts[vehicle], since), until)
            if end > since:
                speed_mps = within(tick.speeds[vehicle], model.speed_min_mps, model.speed_max_mps)
                heading_rad, height_m = tick.headings[vehicle], tick.heights[vehicle]
                if place:
                    advance(state, model, speed_mps, heading_rad, height_m, (end - since) / NANOSECONDS)
                else:
                    respond(state, model, speed_mps, heading_rad, height_m, (end - since) / NANOSECONDS)
                since = end

    def _acting(self, instant: int, vehicle: int) -> int:
        """Return the place of a vehicle's newest setpoint that acts at an instant; the oldest if none does yet."""
        index = len(self._ticks) - 1
        while index > 0 and self._ticks[index].acts[vehicle] > instant:
            index -= 1
        return index

    def told(self, instants: Instants, vehicles: Indices) -> Setpoints:
        """Return each vehicle's newest setpoint that acts at its instant, or the oldest one if none does yet."""
        rows = list[tuple[float, float, float]]()
        each: list[int] = vehicles.tolist()
        for instant, vehicle in zip(instants.tolist(), each, strict=True):
            tick = self._ticks[self._acting(instant, vehicle)]
            rows.append((tick.speeds[vehicle], tick.headings[vehicle], tick.heights[vehicle]))
        return Setpoints.of(np.array(rows).T)

    def between(self, since: Instants, until: Instants) -> tuple[Instants, Array]:
        """Return what all vehicles were told from `since` to `until`, (V,): when each acts (R, V), and (R, 3, V)."""
        begins, ends = since.tolist(), until.tolist()
        first = min(self._acting(begin, vehicle) for vehicle, begin in enumerate(begins))
        last = max(self._acting(end - 1, vehicle) for vehicle, end in enumerate(ends))
        ticks = self._ticks[first : max(first, last) + 1]
        told = np.array([(tick.speeds, tick.headings, tick.heights) for tick in ticks])
        return np.maximum.accumulate(np.array([tick.acts for tick in ticks], dtype=np.int64)), told
