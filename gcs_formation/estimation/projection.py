"""From measured states to those that a law acts on: predictions by model (7) and the setpoints in flight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import NANOSECONDS
from flight_model.autopilot_model import AutopilotModel, wrap
from flight_model.flight_state import FlightState
from gcs_formation.estimation.setpoint_history import HISTORY_S, SetpointHistory

HEADING: Final = 5
"""Index of the value of a state that is an angle."""
MISSED: Final = 2
"""Telemetry periods between two vehicles' newest samples beyond which a message is missing. Tuned: periods; 1.5 to 4;
shown by `pytest tests/gcs_formation/estimation`."""
FORGOTTEN_AFTER_S: Final = 30.0
"""A vehicle whose state is older is ignored: nothing is planned around where it may be. Tuned: s; 15 to 60; shown by
the tests of what is kept clear of silent vehicles."""
LOST_NS: Final = 2 * NANOSECONDS
"""A vehicle that isn't commanded and whose state is older stays where it was last seen, which saves its prediction.
Tuned: ns; 1 to 5 s; shown by `pytest tests/gcs_formation/estimation`."""


class States(ABC):
    """The states that a law acts on at one tick; read-only."""

    @abstractmethod
    def of(self, which: int, whose: int) -> FlightState:
        """Return the state of vehicle `which` at the instant used for the setpoint of vehicle `whose`."""

    @abstractmethod
    def instant(self, whose: int) -> int:
        """Return the instant used for a vehicle's setpoint, ns."""


class MeasuredStates(States):
    """Every vehicle's newest state at a tick, each at its own time stamp."""

    def __init__(self, states: list[FlightState], stamps: vec[i64], active: list[bool], acts: vec[i64]) -> None:
        """Take the newest states, their time stamps, which vehicles are commanded, and when setpoints sent now act."""
        self.states = states
        self.stamps = stamps
        self.active = active
        self.acts = acts

    def of(self, which: int, whose: int) -> FlightState:  # noqa: ARG002 - the same for everyone
        """Return the newest state."""
        return self.states[which]

    def instant(self, whose: int) -> int:
        """Return the vehicle's own stamp."""
        return self.stamps[whose]


Projection = Callable[[MeasuredStates], States]
"""Returns the states that a law acts on, from the measured ones, tick by tick."""


class TickStates:
    """Every vehicle's newest state at a tick, and how far the wind has carried it."""

    def __init__(self, stamps: vec[i64], states: list[FlightState], before: TickStates | None) -> None:
        """Take the states at their stamps, in ns, and the previous tick's."""
        self.stamps = stamps
        self.states = states
        self.carried_north_m = vec[float]([0.0] * len(stamps))
        """Displacement of each vehicle by the wind since the first tick."""
        self.carried_east_m = vec[float]([0.0] * len(stamps))
        if before is None:
            return
        for vehicle, now in enumerate(states):
            then = before.states[vehicle]
            half_s = float(self.stamps[vehicle] - before.stamps[vehicle]) / NANOSECONDS / 2.0
            north_m = half_s * (then.wind_north_mps + now.wind_north_mps)
            self.carried_north_m[vehicle] = before.carried_north_m[vehicle] + north_m
            east_m = half_s * (then.wind_east_mps + now.wind_east_mps)
            self.carried_east_m[vehicle] = before.carried_east_m[vehicle] + east_m


class Prediction(States):
    """Every vehicle's state at the instant at which a setpoint for it, or for another vehicle, acts.

    Predicted by model (7) through the setpoints in flight.
    """

    def __init__(self, history: SetpointHistory, models: list[AutopilotModel], telemetry_hz: float) -> None:
        """Predict by (C,) `models` through the setpoints in `history`."""
        self._between_messages = round(MISSED * NANOSECONDS / telemetry_hz)
        """Newest states of two vehicles may be so far apart, ns, without a missing message."""
        self._history = history
        self._models = models
        self._samples: list[TickStates] = []
        """One a tick, the newest last."""
        self._acts = vec[i64]()
        """When setpoints sent now act, (C,)."""

    def predict(self, measured: MeasuredStates) -> Prediction:
        """Take a tick's states; until the next call this is the prediction to when the tick's setpoints act."""
        stamps, acts = vec[i64]([each for each in measured.stamps]), measured.acts  # noqa: C416 - compiled, no call
        for vehicle in range(len(stamps)):
            if not measured.active[vehicle] and acts[vehicle] - stamps[vehicle] > LOST_NS:
                stamps[vehicle] = acts[vehicle]
        before = self._samples[-1] if self._samples else None
        if len(self._samples) == self._history.length:
            del self._samples[0]
        self._samples.append(TickStates(stamps, measured.states, before))
        self._acts = acts
        return self

    def of(self, which: int, whose: int) -> FlightState:
        """Return a vehicle's state predicted through the setpoints in flight, from the stamp of `whose` newest sample.

        Between states that two vehicles measured at different times, a gust looks like a formation error. If the newest
        message of `which` is older than that of `whose`, `which` is assumed to have met the same gusts since then. The
        usual interval between two messages is left out: there it would only add the other's measurement noise.
        """
        newest = self._samples[-1]
        begin = newest if which == whose else self._nearest(which, newest.stamps[whose])
        state, since = begin.states[which].copy(), begin.stamps[which]
        if which != whose:
            met = self._nearest(whose, min(since + self._between_messages, newest.stamps[whose]))
            if met is not newest:
                self._meet(state, whose, met, since)
        self._history.carry(state, since, self._acts[whose], which, self._models[which])
        return state

    def _meet(self, state: FlightState, whose: int, met: TickStates, since: i64) -> None:
        """Change a state at `since` by the wind that `whose` has met since the sample `met`.

        The prediction that follows uses the present wind from `since` on; the state's position is corrected for that.
        """
        newest, then = self._samples[-1], met.states[whose]
        now, over_s = newest.states[whose], float(newest.stamps[whose] - met.stamps[whose]) / NANOSECONDS
        ago_s = float(met.stamps[whose] - since) / NANOSECONDS
        north_mps = now.wind_north_mps - then.wind_north_mps
        north_m = newest.carried_north_m[whose] - met.carried_north_m[whose] - now.wind_north_mps * over_s
        state.north_m += north_m - north_mps * ago_s
        state.wind_north_mps += north_mps
        east_mps = now.wind_east_mps - then.wind_east_mps
        east_m = newest.carried_east_m[whose] - met.carried_east_m[whose] - now.wind_east_mps * over_s
        state.east_m += east_m - east_mps * ago_s
        state.wind_east_mps += east_mps

    def _nearest(self, vehicle: i64, stamp: i64) -> TickStates:
        """Return the sample in which a vehicle's stamp is nearest to `stamp`."""
        best = index = len(self._samples) - 1
        nearest = _difference(self._samples[best].stamps[vehicle], stamp)
        while index > 0:
            index -= 1
            older = _difference(self._samples[index].stamps[vehicle], stamp)
            if older > nearest:
                break
            if older < nearest:
                best, nearest = index, older
        return self._samples[best]

    def instant(self, whose: int) -> int:
        """Return when the setpoint acts."""
        return self._acts[whose]


def _difference(one: i64, other: i64) -> i64:
    return one - other if one > other else other - one


class Pairing:
    """Brings all states to the newest instant for which every active vehicle has one, by interpolation."""

    def __init__(self, rate_hz: float) -> None:
        """Keep `HISTORY_S` of samples, of ticks at `rate_hz`."""
        self._samples: deque[MeasuredStates] = deque(maxlen=max(8, int(HISTORY_S * rate_hz)))

    def align(self, measured: MeasuredStates) -> MeasuredStates:
        """Return the states at the common stamp; an inactive vehicle's stays as measured."""
        self._samples.append(measured)
        stamps = measured.stamps
        stamp: int = max([each for each in stamps])  # noqa: C416 - max() takes a list, not a vec
        for vehicle, active in enumerate(measured.active):
            if active:
                stamp = min(stamp, int(stamps[vehicle]))
        states = [self._at(vehicle, stamp) for vehicle in range(len(measured.states))]
        return MeasuredStates(states, vec[i64]([stamp] * len(states)), measured.active, measured.acts)

    def _at(self, vehicle: int, stamp: int) -> FlightState:
        """Return a vehicle's state at a stamp: interpolated, or the nearest sample outside the samples' span."""
        newest = self._samples[-1]
        after, after_stamp = newest.states[vehicle], newest.stamps[vehicle]
        if not newest.active[vehicle] or after_stamp <= stamp:
            return after
        for older in islice(reversed(self._samples), 1, None):
            if not older.active[vehicle]:
                return after
            before, before_stamp = older.states[vehicle], older.stamps[vehicle]
            if before_stamp <= stamp:
                share = float(stamp - before_stamp) / float(max(after_stamp - before_stamp, 1))
                return _between(before, after, share)
            after, after_stamp = before, before_stamp
        return after


def _between(before: FlightState, after: FlightState, share: float) -> FlightState:
    """Return the state at a share of the way between two."""
    steps = [late - early for early, late in zip(before.values(), after.values(), strict=True)]
    steps[HEADING] = wrap(steps[HEADING])
    values = (early + share * step for early, step in zip(before.values(), steps, strict=True))
    return FlightState(*values)
