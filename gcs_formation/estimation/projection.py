"""From measured states to those that a law acts on: as measured, at one common time stamp, or predicted."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Instants, Mask
from flight_model.autopilot import AutopilotModel, FlightState
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices
from gcs_formation.estimation.setpoint_history import HISTORY_S, SetpointHistory

HEADING = 5
"""Row of `FlightStates` that is an angle."""
LONG_AGO = np.int64(-(2**61))
"""Stamp of a state that nothing may be interpolated from."""
MISSED = 2
"""Periods of telemetry after which something is missing."""
LOST_S = 2.0
"""Age from which a vehicle that isn't commanded is taken to be where it was last seen: it costs no prediction."""


@dataclass(frozen=True)
class Measured:
    """The newest state of each vehicle, (C,) columns, its time stamp, and when a setpoint sent now will act."""

    state: FlightStates
    stamps: Instants
    active: Mask
    acts: Instants


class States(Protocol):
    """The states that a law acts on at one tick."""

    def of(self, which: Indices, whose: Indices) -> FlightStates:
        """Return, column by column, the state of `which` at the instant that matters for the setpoint of `whose`."""
        ...

    def instants(self, whose: Indices) -> Instants:
        """Return those instants."""
        ...


class Projection(Protocol):
    """Computes these from the measured states, tick by tick."""

    def take(self, measured: Measured) -> States:
        """Return the tick's states."""
        ...


@dataclass(frozen=True)
class AtTheirStamps:
    """Every vehicle's newest state, each at its own time stamp."""

    measured: Measured

    def of(self, which: Indices, whose: Indices) -> FlightStates:  # noqa: ARG002 - the same for everyone
        """Return the newest states."""
        return self.measured.state.take(which)

    def instants(self, whose: Indices) -> Instants:
        """Return the vehicles' own stamps."""
        return self.measured.stamps[whose]


@dataclass(frozen=True)
class AtOneStamp:
    """Every vehicle's state at one instant."""

    state: FlightStates
    stamp: np.int64

    def of(self, which: Indices, whose: Indices) -> FlightStates:  # noqa: ARG002 - the same for everyone
        """Return the states at the stamp."""
        return self.state.take(which)

    def instants(self, whose: Indices) -> Instants:
        """Return the stamp."""
        return np.full(whose.shape, self.stamp, dtype=np.int64)


class Sampled:
    """What was known of every vehicle at a tick."""

    __slots__ = ("carried_east_m", "carried_north_m", "stamps", "states")

    def __init__(self, stamps: list[int], states: list[FlightState], before: Sampled | None) -> None:
        """Take the states at their stamps, in ns, and what the sample of the tick before knew."""
        self.stamps = stamps
        self.states = states
        self.carried_north_m = [0.0] * len(stamps)
        """How far the wind has carried each vehicle since the first sample."""
        self.carried_east_m = [0.0] * len(stamps)
        if before is None:
            return
        for vehicle, (then, now) in enumerate(zip(before.states, states, strict=True)):
            half_s = (stamps[vehicle] - before.stamps[vehicle]) / NANOSECONDS / 2.0
            north_m = half_s * (then.wind_north_mps + now.wind_north_mps)
            self.carried_north_m[vehicle] = before.carried_north_m[vehicle] + north_m
            east_m = half_s * (then.wind_east_mps + now.wind_east_mps)
            self.carried_east_m[vehicle] = before.carried_east_m[vehicle] + east_m


class WhenSetpointsAct:
    """Every vehicle's state at the instant at which a setpoint for it, or for another vehicle, acts."""

    def __init__(
        self,
        acts: Instants,
        samples: list[Sampled],
        history: SetpointHistory,
        models: list[AutopilotModel],
        between_messages: int,
    ) -> None:
        """Predict from `samples`, tick by tick and the newest last, by `models` through what `history` says was sent.

        A state may be `between_messages` ns later than another vehicle's with nothing missing. Setpoints sent now to
        each vehicle act at `acts`, (C,).
        """
        self._acts, self._each_acts = acts, acts.tolist()
        self._samples, self._history, self._models = samples, history, models
        self._between_messages = between_messages

    def of(self, which: Indices, whose: Indices) -> FlightStates:
        """Return, column by column, the state of `which` when a setpoint sent now to `whose` acts."""
        pairs = zip(which.tolist(), whose.tolist(), strict=True)
        return FlightStates.from_each([self.one(each, other) for each, other in pairs])

    def one(self, which: int, whose: int) -> FlightState:
        """Return a vehicle's state predicted through the setpoints in flight, from the stamp of `whose` newest sample.

        Between states that two vehicles measured at different times, a gust looks like a gap. If the newest message of
        `which` is older than that of `whose`, it is taken to have met the same gusts since then. This doesn't hold
        for the usual interval between two messages, where it would only add the other's measurement noise.
        """
        newest = self._samples[-1]
        at = newest.stamps[whose]
        begin = newest if which == whose else self._nearest(which, at)
        state, since = begin.states[which].copy(), begin.stamps[which]
        if which != whose:
            met = self._nearest(whose, min(since + self._between_messages, at))
            if met is not newest:
                self._meet(state, whose, met, since)
        self._history.predicted(state, since, self._each_acts[whose], which, self._models[which])
        return state

    def _meet(self, state: FlightState, whose: int, met: Sampled, since: int) -> None:
        """Move a state at `since` to where the wind has carried it that `whose` has met since the sample `met`.

        The prediction takes the wind to have been as it is now since the beginning.
        """
        newest, then = self._samples[-1], met.states[whose]
        now, over_s = newest.states[whose], (newest.stamps[whose] - met.stamps[whose]) / NANOSECONDS
        ago_s = (met.stamps[whose] - since) / NANOSECONDS
        north_mps = now.wind_north_mps - then.wind_north_mps
        north_m = newest.carried_north_m[whose] - met.carried_north_m[whose] - now.wind_north_mps * over_s
        state.north_m += north_m - north_mps * ago_s
        state.wind_north_mps += north_mps
        east_mps = now.wind_east_mps - then.wind_east_mps
        east_m = newest.carried_east_m[whose] - met.carried_east_m[whose] - now.wind_east_mps * over_s
        state.east_m += east_m - east_mps * ago_s
        state.wind_east_mps += east_mps

    def _nearest(self, vehicle: int, stamp: int) -> Sampled:
        """Return the sample of a vehicle that is nearest to a stamp."""
        best = index = len(self._samples) - 1
        apart = abs(self._samples[best].stamps[vehicle] - stamp)
        while index > 0:
            index -= 1
            older = abs(self._samples[index].stamps[vehicle] - stamp)
            if older > apart:
                break
            if older < apart:
                best, apart = index, older
        return self._samples[best]

    def instants(self, whose: Indices) -> Instants:
        """Return when the setpoints act."""
        return self._acts[whose]


class AsMeasured:
    """No projection."""

    def take(self, measured: Measured) -> AtTheirStamps:
        """Return the states as measured."""
        return AtTheirStamps(measured)


class Prediction:
    """Model (7) run through the setpoints in flight."""

    def __init__(self, history: SetpointHistory, model: AutopilotModels, telemetry_hz: float) -> None:
        """Predict by `model`, (C,) columns, through what `history` says was sent."""
        self._between_messages = round(MISSED * NANOSECONDS / telemetry_hz)
        self._history = history
        self._model = model
        self._samples: list[Sampled] = []

    def take(self, measured: Measured) -> WhenSetpointsAct:
        """Return the states when this tick's setpoints act."""
        lost = ~measured.active & (measured.acts - measured.stamps > LOST_S * NANOSECONDS)
        stamps = np.where(lost, measured.acts, measured.stamps)
        before = self._samples[-1] if self._samples else None
        if len(self._samples) == self._history.length:
            del self._samples[0]
        self._samples.append(Sampled(stamps.tolist(), measured.state.each(), before))
        models = self._model.each()
        return WhenSetpointsAct(measured.acts, self._samples, self._history, models, self._between_messages)


class Pairing:
    """All states at the newest instant for which every active vehicle has one, interpolated where necessary."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of samples, of ticks at `rate_hz`."""
        self._samples: deque[tuple[Instants, Array]] = deque(maxlen=max(8, int(HISTORY_S * rate_hz)))

    def take(self, measured: Measured) -> AtOneStamp:
        """Return the states at the common stamp; a vehicle that isn't active stays as measured."""
        known = np.where(measured.active, measured.stamps, LONG_AGO)
        self._samples.append((known, measured.state.table))
        stamp = measured.stamps[measured.active].min(initial=measured.stamps.max())
        return AtOneStamp(FlightStates.of(self._at(stamp)), stamp)

    def _at(self, stamp: np.int64) -> Array:
        """Return the table (8, C) at a stamp: interpolated, or the nearest sample outside the samples' span."""
        (after_stamps, after), *older = reversed(self._samples)
        before_stamps, before = after_stamps, after
        for stamps, table in older:
            late = before_stamps > stamp
            if not late.any():
                break
            after_stamps, after = np.where(late, before_stamps, after_stamps), np.where(late, before, after)
            before_stamps, before = np.where(late, stamps, before_stamps), np.where(late, table, before)
        between = np.maximum(after_stamps - before_stamps, 1)
        share = np.clip((stamp - before_stamps) / between, 0.0, 1.0)
        step = after - before
        step[HEADING] = np.remainder(step[HEADING] + np.pi, 2 * np.pi) - np.pi
        return before + share * step
