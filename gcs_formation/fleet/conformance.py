"""Whether vehicles do what they were commanded and acknowledged."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Instants, Mask, wrap
from formation_scenario import Scenario
from formation_scenario.arrangement import columns
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.reconfiguration import column_models
from gcs_formation.controller import FormationController
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates
from gcs_formation.estimation.predictor import advance
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.parameters import autopilot_model
from gcs_formation.recorder import Detail, Note, Tick
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import UNANSWERED_S, Vehicle

CHECK_S = 0.4
WINDOW_S = 3.2
"""Length of the window over which motion is compared."""
SETTLED_S = WINDOW_S + 1.0
"""A vehicle is judged once it has been commanded, and has acknowledged setpoints, for this long."""
CLIMBING_MPS, LEVELS_OUT_S = 1.0, 30.0
"""Airspeed and height of one that climbed, or sank, faster when it was taken over, after so long: an aircraft that
levels out of its climb trades speed for height, and its throttle lags."""
LEAST_CHANGE = np.array((1.0, 0.04, 1.5))
"""Airspeed in m/s, heading in rad, height in m: smaller expected changes within the window aren't judged."""
SIGMAS = 4.0
"""To that, this many standard deviations of the telemetry's noise are added."""
FAST_SHARE = 0.9
"""Share of the highest airspeed above which climbs aren't judged: hardly any power is left for them."""
RISING_AIR_MPS = 1.5
"""Vertical air motion that may keep a vehicle from its height, and that telemetry doesn't show."""
AIR_SIGMAS, AIR_MEMORY_S = 4.0, 60.0
"""If that is more, so many standard deviations of what a vehicle has shown of it within about that time."""
MISSED_SHARE = 0.75
"""A vehicle that falls short by more isn't following. One that does, as the model says, falls short by 0.3 at most, or
overshoots; a real one, whose turns begin 0.6 s later than the model's, by 0.65 at the beginning of a bend."""
STEP_LAG_S = 4.0
"""Least time constant of an airspeed under total-energy control after a step, which its energy's rate limits."""
CHECKS_DOUBTED, CHECKS_BROKEN, CHECKS_MENDED = 2, 4, 8
CHANNELS = ("airspeed", "heading", "height")
ROWS = [4, 5, 2]
"""Rows of a state's table that the channels are."""
HEIGHT = CHANNELS.index("height")
ENERGY = [CHANNELS.index("airspeed"), HEIGHT]
"""Channels between which an aircraft trades energy."""
GAP_S = 0.5
"""Longer gaps between acknowledgements of setpoints may mean that setpoints didn't arrive."""


class NonConformance(NamedTuple):
    """A commanded change that a column didn't fly within the window: m/s, rad or m."""

    column: int
    channel: str
    expected: float
    flown: float


class MotionConformance:
    """Predicts every vehicle from an earlier state through the setpoints since then, and compares."""

    def __init__(self, scenario: Scenario, history: SetpointHistory) -> None:
        """Take the model from the scenario; `history` holds what was told."""
        self.broken: Mask = np.zeros(1 + len(scenario.followers), dtype=bool)
        """Columns that don't follow, (C,)."""
        self._model = _judged_by(scenario)
        self._history = history
        self._least = LEAST_CHANGE[:, None] + SIGMAS * _noise(scenario)
        self._carried_m = _carried_m(self._model)
        self._air_variance = np.zeros(self.broken.size)
        """Of the vertical motion of the air that would explain each column's heights, (m/s)²."""
        self._past: deque[tuple[Instants, Array]] = deque(maxlen=round(WINDOW_S / CHECK_S))
        self._climbed: Mask = np.zeros(self.broken.size, dtype=bool)
        """Columns that were climbing or descending when they were first commanded, (C,)."""
        self._next_check = Instant(0)
        self._bad = np.zeros((len(CHANNELS), self.broken.size), dtype=np.int64)
        self._good = np.zeros(self.broken.size, dtype=np.int64)

    @property
    def doubted(self) -> Mask:
        """Columns that don't follow, or have missed what was expected in two checks in a row, (C,)."""
        return self.broken | (self._bad >= CHECKS_DOUBTED).any(axis=0)

    def due(self, now: Instant) -> bool:
        """Whether a check is due."""
        return now >= self._next_check

    def check(
        self, now: Instant, stamps: Instants, state: FlightStates, settled: Mask, commanded_s: Array
    ) -> list[NonConformance]:
        """Compare, if a check is due; return new findings. `broken` has all columns that don't follow.

        Args:
            now: the tick's instant.
            stamps: (C,) when the states were true.
            state: (C,) newest states.
            settled: (3, C) channels that have been commanded, and acknowledged, for `SETTLED_S`.
            commanded_s: (C,) for how long each has been commanded without a break.
        """
        if not self.due(now):
            return []
        self._next_check = Instant(now + round(CHECK_S * NANOSECONDS))
        self._climbed = np.where(commanded_s < CHECK_S, np.abs(state.climb_mps) > CLIMBING_MPS, self._climbed)
        self._past.append((stamps, state.table))
        if len(self._past) < (self._past.maxlen or 0):
            return []
        expected, flown = self._changes(stamps, state.table)
        settled = settled.copy()
        settled[ENERGY] &= ~self._climbed | (commanded_s >= LEVELS_OUT_S)
        before = FlightStates.of(self._past[0][1])
        fast = np.maximum(state.airspeed_mps, before.airspeed_mps) > FAST_SHARE * self._model.speed_max_mps
        settled[HEIGHT] &= ~(fast & (expected[HEIGHT] > 0.0))
        missed = self._missed(expected, flown, settled)
        self._bad = np.where(missed, self._bad + 1, 0)
        self._good = np.where((settled & ~missed).all(axis=0), self._good + 1, 0)
        self.broken = self.broken & (self._good < CHECKS_MENDED)
        found: list[NonConformance] = []
        for column in np.flatnonzero((self._bad >= CHECKS_BROKEN).any(axis=0) & ~self.broken):
            channel = int(np.argmax(self._bad[:, column]))
            change = float(expected[channel, column]), float(flown[channel, column])
            found.append(NonConformance(int(column), CHANNELS[channel], *change))
            self.broken[column] = True
        return found

    def _missed(self, expected: Array, flown: Array, settled: Mask) -> Mask:
        """Return which changes (3, C) weren't flown, and update the estimate of vertical air motion."""
        limit, short = MISSED_SHARE * np.abs(expected), (expected - flown) * np.sign(expected)
        air_mps = np.maximum(RISING_AIR_MPS, AIR_SIGMAS * np.sqrt(self._air_variance))
        limit[HEIGHT] = np.maximum(limit[HEIGHT], air_mps * self._carried_m)
        learnt = CHECK_S / AIR_MEMORY_S * (((expected - flown)[HEIGHT] / self._carried_m) ** 2 - self._air_variance)
        self._air_variance += np.where(settled[HEIGHT], learnt, 0.0)
        return (np.abs(expected) >= self._least) & (short > limit) & settled

    def _changes(self, stamps: Instants, table: Array) -> tuple[Array, Array]:
        """Return the changes (3, C) that should have been flown within the window, and those that were."""
        since, before = self._past[0]
        columns = np.arange(stamps.size, dtype=np.intp)
        until = np.maximum(stamps, since)
        predicted = self._history.predict(FlightStates.of(before), since, until, columns, self._model).table
        expected, flown = predicted[ROWS] - before[ROWS], table[ROWS] - before[ROWS]
        flown[1] = wrap(flown[1])
        return expected, flown


def _judged_by(scenario: Scenario) -> AutopilotModels:
    """Return the model that changes are expected by; the lags of an airframe's slow changes aren't those of steps."""
    model = autopilot_model(scenario)
    aircraft = np.array([each.airframe is not None for each in column_models(scenario)])
    model.tau_v_s[aircraft] = np.maximum(model.tau_v_s, STEP_LAG_S)[aircraft]
    return model


def _carried_m(model: AutopilotModels) -> Array:
    """Return (C,) how far air that rises at 1 m/s carries vehicles within the window, their height loops against it.

    In the end tau_ha + tau_hb; until then the model's own way there.
    """
    end_m, none = model.tau_ha_s + model.tau_hb_s, np.zeros_like(model.tau_ha_s)
    state = FlightStates(none, none, -end_m, np.ones_like(none), none, none, none, none)
    return end_m + advance(state, np.zeros((1, 3, none.size)), np.full((1, none.size), WINDOW_S), model).height_m


def _noise(scenario: Scenario) -> Array:
    """Return the standard deviations (3, C) of each channel's telemetry."""
    sources = [vehicle.navigation if vehicle else None for vehicle in columns(scenario)]
    rows = [
        (each.airspeed_sigma_mps, np.radians(each.heading_sigma_deg), each.position_sigma_m)
        if isinstance(each, NoisyNavigation)
        else (0.0, 0.0, 0.0)
        for each in sources
    ]
    return np.array(rows, dtype=np.float64).T


class ConformanceMonitor:
    """Reports vehicles that don't do what they acknowledged: events `disobeys`, and `obeys` when they do again."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: Mapping[VehicleId, Vehicle],
        columns: Mapping[VehicleId, int],
        note: Note,
    ) -> None:
        """Compare `vehicles`; `columns` are theirs in the controller."""
        self._controller = controller
        self._vehicles = vehicles
        self._columns = columns
        self._note = note
        self._motion = MotionConformance(scenario, controller.history)
        self._gap_s = max(GAP_S, 2.5 / scenario.law.rate_hz)
        self._unanswered = set[VehicleId]()
        """Those that were commanded and answered nothing."""
        self._commanded: dict[int, Instant] = {}
        """Since when each column has been commanded without interruption."""

    @property
    def doubted(self) -> Mask:
        """Columns that don't seem to follow the setpoints that they acknowledge, (C,)."""
        return self._motion.doubted

    def judge_answers(self, now: Instant) -> None:
        """Check that vehicles that are commanded and heard answer: events `uplink`, at the beginning and at the end."""
        for identity, vehicle in self._vehicles.items():
            missing = vehicle.talks_on_s > UNANSWERED_S
            if not missing and not self._unanswered:
                continue
            reported = identity in self._unanswered
            if missing and not reported and vehicle.member is Member.FLYING:
                self._unanswered.add(identity)
                self._note(now, "uplink", "is heard and answers nothing: it may not hear us", vehicle)
            elif reported and not missing:
                self._unanswered.remove(identity)
                self._note(now, "uplink", "answers again", vehicle)

    def judge_commands(self, now: Instant) -> None:
        """Check modes and arming."""
        for vehicle in self._vehicles.values():
            if not vehicle.effects.watching:
                continue
            before = vehicle.effects.missing
            vehicle.effects.judge(vehicle.telemetry, now)
            missing = vehicle.effects.missing
            if missing is not None and missing is not before:
                mode = vehicle.autopilot.mode_name(vehicle.telemetry)
                text = f"acknowledged {missing.description} {missing.after_s:.1f} s ago, and is still in {mode}"
                armed = vehicle.telemetry.armed
                details = {"order": missing.description, "after_s": missing.after_s, "mode": mode, "armed": armed}
                self._note(now, "disobeys", text, vehicle, details)
            elif missing is None and before is not None:
                self._note(now, "obeys", f"{before.description} is over", vehicle, {"order": before.description})

    def judge_motion(self, tick: Tick, now: Instant) -> None:
        """Check how the vehicles follow this and earlier ticks' setpoints."""
        commanded, active = self._commanded, tick.active.tolist()
        for column in self._columns.values():
            if not active[column]:
                commanded.pop(column, None)
            elif column not in commanded:
                commanded[column] = now
        if not self._motion.due(now):
            return
        estimator, settled = self._controller.estimator, np.zeros((len(CHANNELS), tick.active.size), dtype=bool)
        commanded_s = np.zeros(tick.active.size)
        for identity, column in self._columns.items():
            since = commanded.get(column, now)
            commanded_s[column] = seconds_between(since, now)
            settled[:, column] = self._settled(self._vehicles[identity], since, now)
        before = self._motion.broken
        found = self._motion.check(now, estimator.stamps, estimator.state, settled, commanded_s)
        for each in found:
            self._note(now, "disobeys", _words(each), self._at(each.column), _figures(each))
        for column in np.flatnonzero(before & ~self._motion.broken):
            self._note(now, "obeys", "follows its setpoints again", self._at(int(column)), {"order": "setpoints"})

    def _settled(self, vehicle: Vehicle, since: Instant, now: Instant) -> list[bool]:
        """Return which channels of a vehicle commanded `since` then have been acknowledged for long enough."""
        runs = [vehicle.setpoints_taken[i].since(now, self._gap_s) for i in vehicle.autopilot.setpoint_commands]
        latest = after(now, -SETTLED_S)
        return [run is not None and max(since, run) <= latest for run in runs]

    def _at(self, column: int) -> Vehicle:
        return next(self._vehicles[identity] for identity, its in self._columns.items() if its == column)


def _words(found: NonConformance) -> str:
    scale, unit = {"airspeed": (1.0, "m/s"), "heading": (180 / np.pi, "°"), "height": (1.0, "m")}[found.channel]
    flown, expected = found.flown * scale, found.expected * scale
    return (
        f"acknowledges setpoints and doesn't follow them: {found.channel} changed by {flown:.1f} {unit} "
        f"in {WINDOW_S:g} s, {expected:.1f} {unit} expected"
    )


def _figures(found: NonConformance) -> dict[str, Detail]:
    return {"order": "setpoints", "channel": found.channel, "expected": found.expected, "flown": found.flown}
