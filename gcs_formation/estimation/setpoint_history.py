"""The setpoints sent to vehicles: those still in flight, and those that the vehicles followed in the last seconds."""

from __future__ import annotations

import math
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import LONG_AGO, NANOSECONDS
from flight_model.autopilot_model import AutopilotModel, advance, respond, respond_hovering, within, wrap
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3

HISTORY_S: Final = 6.0
"""How long setpoints are kept. Tuned: s; the largest loop delay and more, 4 to 20; shown by `pytest
tests/gcs_formation/estimation`."""
RESPOND_NS: Final = 280_000_000
"""Longest step in which a model answers the mean of the setpoints that act in it. Tuned: ns; 100 to 300 ms; shown by
`pytest tests/gcs_formation/estimation`."""


class SentSetpoints:
    """One vehicle's setpoints of the last ticks, the newest at `end` - 1, and when each is expected to act, in ns."""

    def __init__(self, length: int) -> None:
        """Keep those of `length` ticks; before the first acts, the vehicle flies straight on."""
        self.acts = vec[i64]([0] * (2 * length))
        self._speeds_mps, self._headings_rad, self._heights_m = (vec[float]([0.0] * (2 * length)) for _ in range(3))
        self.first: i64 = 0
        self.end: i64 = 0
        self.begin_tick(LONG_AGO)

    def begin_tick(self, acts: i64) -> None:
        """Begin a tick whose setpoint acts at `acts`; it is NaN, for flight straight on, until `record` sets it."""
        length = len(self.acts) // 2
        if self.end - self.first == length:
            self.first += 1
        if self.end == len(self.acts):
            for index in range(self.first, self.end):
                self._move(index, index - self.first)
            self.first, self.end = 0, length - 1
        self.acts[self.end] = acts
        self.end += 1
        self.record((math.nan, math.nan, math.nan))

    def _move(self, index: i64, to: i64) -> None:
        self.acts[to], self._speeds_mps[to] = self.acts[index], self._speeds_mps[index]
        self._headings_rad[to], self._heights_m[to] = self._headings_rad[index], self._heights_m[index]

    def record(self, setpoint: Vector3) -> None:
        """Set the setpoint of the tick that was begun last."""
        newest = self.end - 1
        self._speeds_mps[newest], self._headings_rad[newest], self._heights_m[newest] = setpoint

    def acting(self, instant: i64) -> i64:
        """Return the index of the newest setpoint that acts at an instant; the oldest's if none does yet."""
        acts, index = self.acts, self.end - 1
        while index > self.first and acts[index] > instant:
            index -= 1
        return index

    def at(self, index: i64) -> Vector3:
        """Return the setpoint at an index."""
        return self._speeds_mps[index], self._headings_rad[index], self._heights_m[index]

    def later(self, index: i64, instant: i64) -> i64:
        """Return the index of the newest setpoint that acts at an instant, searching from one that acts, `index`."""
        while index < self.end - 1 and self.acts[index + 1] <= instant:
            index += 1
        return index

    def mean(self, index: i64, since: i64, until: i64) -> Vector3:
        """Return the mean of the setpoints that act from `since` to `until`, the first of which is at `index`."""
        acts, speeds_mps, headings_rad, heights_m = self.acts, self._speeds_mps, self._headings_rad, self._heights_m
        speed_mps, heading_rad, height_m = speeds_mps[index], headings_rad[index], heights_m[index]
        last, acted, whole = self.end - 1, since, float(until - since)
        while index < last and acts[index + 1] < until:
            acted = max(acted, acts[index + 1])
            share = float(until - acted) / whole
            speed_mps += share * (speeds_mps[index + 1] - speeds_mps[index])
            heading_rad += share * wrap(headings_rad[index + 1] - headings_rad[index])
            height_m += share * (heights_m[index + 1] - heights_m[index])
            index += 1
        return speed_mps, heading_rad, height_m

    def carry(self, state: FlightState, since: i64, until: i64, model: AutopilotModel) -> None:
        """Predict the vehicle's `state`: see `SetpointHistory.carry`."""
        acts, last = self.acts, self.end - 1
        for index in range(self.acting(since), self.end):
            end = until
            if index < last and acts[index + 1] < until:
                end = max(acts[index + 1], since)
            if end > since:
                speed_mps = within(self._speeds_mps[index], model.speed_min_mps, model.speed_max_mps)
                heading_rad, height_m = self._headings_rad[index], self._heights_m[index]
                time_s = float(end - since) / NANOSECONDS
                advance(state, model, speed_mps, heading_rad, height_m, time_s)
                since = end

    def respond(self, state: FlightState, since: i64, until: i64, model: AutopilotModel) -> None:
        """Predict the vehicle's `state`: see `SetpointHistory.respond`."""
        steps, index = (until - since) // RESPOND_NS + 1, self.acting(since)
        step = (until - since) // steps
        for _ in range(steps):
            index = self.later(index, since)
            speed_mps, heading_rad, height_m = self.mean(index, since, since + step)
            speed_mps = within(speed_mps, model.speed_min_mps, model.speed_max_mps)
            if model.may_hover:
                respond_hovering(state, model, speed_mps, heading_rad, height_m, float(step) / NANOSECONDS)
            else:
                respond(state, model, speed_mps, heading_rad, height_m, float(step) / NANOSECONDS)
            since += step


class SetpointHistory:
    """The setpoints sent to every vehicle in the last seconds."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of ticks at `rate_hz`."""
        self.length = max(8, int(HISTORY_S * rate_hz))
        self._each: list[SentSetpoints] = []

    @property
    def empty(self) -> bool:
        """Whether nothing has been sent yet."""
        return not self._each

    def begin_tick(self, acts: vec[i64]) -> None:
        """Begin a tick whose setpoints act at `acts`, (V,)."""
        if not self._each:
            self._each = [SentSetpoints(self.length) for _ in acts]
        for vehicle in range(len(acts)):
            self._each[vehicle].begin_tick(acts[vehicle])

    def record(self, setpoints: list[Vector3]) -> None:
        """Set the setpoints of the tick that was begun last, (V,), NaN for those that aren't known yet."""
        for vehicle, setpoint in enumerate(setpoints):
            self._each[vehicle].record(setpoint)

    def carry(self, state: FlightState, since: i64, until: i64, vehicle: int, model: AutopilotModel) -> None:
        """Predict a vehicle's `state` from `since` to `until`, instants in ns, through the setpoints that it was sent.

        Before the first setpoint acts it flies straight on. Before the history begins, it follows the oldest setpoint.
        """
        if self._each:
            self._each[vehicle].carry(state, since, until, model)

    def respond(self, state: FlightState, since: i64, until: i64, vehicle: int, model: AutopilotModel) -> None:
        """Predict airspeed, heading, height and climb rate likewise, but coarsely, and leave the position.

        Each `RESPOND_NS` uses the mean of its setpoints. A vehicle that may hover, a multirotor, follows velocities.
        """
        if self._each:
            self._each[vehicle].respond(state, since, until, model)

    def commanded(self, instant: int, vehicle: int) -> Vector3:
        """Return a vehicle's newest setpoint that acts at an instant: NaN before the first, else the oldest known."""
        sent = self._each[vehicle]
        return sent.at(sent.acting(instant))

    def of(self, vehicle: int) -> SentSetpoints:
        """Return one vehicle's setpoints."""
        return self._each[vehicle]
