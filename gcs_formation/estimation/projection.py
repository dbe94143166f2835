"""From measured states to those that a law acts on: as measured, at one common time stamp, or predicted."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from airlink.clock import NANOSECONDS
from flight_model.arrays import Array, Instants, Mask, any_of
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Indices
from gcs_formation.estimation.predictor import HISTORY_S, SetpointHistory

HEADING = 5
"""Row of `FlightStates` that is an angle."""
LEVEL, WIND = slice(0, 2), slice(6, 8)
"""Its rows of the place north and east, and of the wind."""
CARRIED = slice(8, 10)
"""Rows of a sample after them: how far the wind has carried the vehicle."""
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


@dataclass(frozen=True)
class WhenSetpointsAct:
    """Every vehicle's state at the instant at which a setpoint for it, or for another vehicle, acts."""

    measured: Measured
    samples: Sequence[tuple[Instants, Array]]
    """Every vehicle's stamps (C,) and, tick by tick, the newest last, (10, C): states, and how far the wind has carried
    it north and east."""
    history: SetpointHistory
    model: AutopilotModels
    between_messages: np.int64
    """How much later than another vehicle's a state may be with nothing missing, ns."""

    def of(self, which: Indices, whose: Indices) -> FlightStates:
        """Return the states predicted through the setpoints in flight, each from the stamp of `whose` newest sample.

        Between states that two vehicles measured at different times, a gust looks like a gap. If the newest message of
        `which` is older than that of `whose`, it is taken to have met the same gusts since then. This doesn't hold
        for the usual interval between two messages, where it would only add the other's measurement noise.
        """
        newest = self.measured.stamps[whose]
        since, state = self._nearest(which, newest)
        met, then = self._nearest(whose, np.minimum(since + self.between_messages, newest))
        _, now = self.samples[-1]
        change_mps = now[WIND, whose] - then[WIND]
        # The prediction takes the wind to have been as it is now since the beginning.
        carried_m = now[CARRIED, whose] - then[CARRIED] - now[WIND, whose] * (newest - met) / NANOSECONDS
        state[LEVEL] += carried_m - change_mps * (met - since) / NANOSECONDS
        state[WIND] += change_mps
        model = self.model.take(which)
        return self.history.predict(
            FlightStates.of(state[: CARRIED.start]), since, self.measured.acts[whose], which, model
        )

    def _nearest(self, which: Indices, stamps: Instants) -> tuple[Instants, Array]:
        """Return the samples (8, ...) of `which` nearest to the stamps, and their own time stamps."""
        older = reversed(self.samples)
        newest, table = next(older)
        since, state = newest[which], table[:, which]
        for each_stamps, each in older:
            nearer = np.abs(each_stamps[which] - stamps) < np.abs(since - stamps)
            if not any_of(nearer):
                break
            since = np.where(nearer, each_stamps[which], since)
            state = np.where(nearer, each[:, which], state)
        return since, state

    def instants(self, whose: Indices) -> Instants:
        """Return when the setpoints act."""
        return self.measured.acts[whose]


class AsMeasured:
    """No projection."""

    def take(self, measured: Measured) -> AtTheirStamps:
        """Return the states as measured."""
        return AtTheirStamps(measured)


class Prediction:
    """Model (7) run through the setpoints in flight."""

    def __init__(self, history: SetpointHistory, model: AutopilotModels, telemetry_hz: float) -> None:
        """Predict by `model`, (C,) columns, through what `history` says was sent."""
        self._between_messages = np.int64(MISSED * NANOSECONDS / telemetry_hz)
        self._history = history
        self._model = model
        self._samples: deque[tuple[Instants, Array]] = deque(maxlen=history.length)

    def take(self, measured: Measured) -> WhenSetpointsAct:
        """Return the states when this tick's setpoints act."""
        lost = ~measured.active & (measured.acts - measured.stamps > LOST_S * NANOSECONDS)
        stamps = np.where(lost, measured.acts, measured.stamps)
        measured = Measured(measured.state, stamps, measured.active, measured.acts)
        self._samples.append((measured.stamps, self._carried(measured)))
        return WhenSetpointsAct(measured, self._samples, self._history, self._model, self._between_messages)

    def _carried(self, measured: Measured) -> Array:
        """Return the states (8, C), and how far the wind has carried each vehicle since the first sample (2, C)."""
        table = measured.state.table
        if not self._samples:
            return np.concatenate((table, np.zeros_like(table[WIND])))
        stamps, before = self._samples[-1]
        over_s = (measured.stamps - stamps) / NANOSECONDS
        return np.concatenate((table, before[CARRIED] + (before[WIND] + table[WIND]) / 2 * over_s))


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
