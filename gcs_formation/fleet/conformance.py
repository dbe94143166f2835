"""Whether vehicles do what they were commanded and acknowledged."""

from __future__ import annotations

import math
from collections import deque
from typing import Final, NamedTuple

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from airlink.endpoint import VehicleId
from flight_model.autopilot import AutopilotModel, FlightState, respond, within, wrap
from flight_model.energy import GRAVITY_MPS2
from formation_scenario import Scenario
from formation_scenario.navigation import NoisyNavigation
from formation_scenario.reconfiguration import column_models
from formation_scenario.slot_assignment import columns
from gcs_formation.controller import FormationController
from gcs_formation.estimation.estimator import LEAST_AIRSPEED_MPS, heading_shown
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.parameters import autopilot_models
from gcs_formation.recorder import Detail, Note, Tick, unknown_state
from gcs_formation.vehicle.telemetry import Motion
from gcs_formation.vehicle.vehicle import UNANSWERED_S, Member, Vehicle

CHECK_S: Final = 0.4
WINDOW_S: Final = 3.2
"""Length of the window over which motion is compared."""
WINDOW_CHECKS: Final = round(WINDOW_S / CHECK_S)
SETTLED_S: Final = WINDOW_S + 1.0
"""A vehicle is judged once it has been commanded, and has acknowledged setpoints, for this long."""
CLIMBING_MPS: Final = 1.0
LEVELS_OUT_S: Final = 30.0
"""Airspeed and height of one that climbed, or sank, faster when it was taken over, after so long: an aircraft that
levels out of its climb trades speed for height, and its throttle lags."""
LEAST_CHANGE = (1.0, 0.04, 1.5)
"""Airspeed in m/s, heading in rad, height in m: smaller expected changes within the window aren't judged."""
SIGMAS: Final = 4.0
"""To that, this many standard deviations of the telemetry's noise are added."""
FAST_SHARE: Final = 0.9
"""Share of the highest airspeed above which climbs aren't judged: hardly any power is left for them."""
RISING_AIR_MPS: Final = 1.5
"""Vertical air motion that may keep a vehicle from its height, and that telemetry doesn't show."""
AIR_SIGMAS: Final = 4.0
AIR_MEMORY_S: Final = 60.0
"""If that is more, so many standard deviations of what a vehicle has shown of it within about that time; as much may
come from the side."""
MISSED_SHARE: Final = 0.75
"""A vehicle that falls short by more isn't following. One that does, as the model says, falls short by 0.3 at most, or
overshoots; a real one, whose turns begin 0.6 s later than the model's, by 0.65 at the beginning of a bend."""
STEP_LAG_S: Final = 4.0
"""Least time constant of an airspeed under total-energy control after a step, which its energy's rate limits."""
CHECKS_DOUBTED: Final = 2
CHECKS_BROKEN: Final = 4
CHECKS_MENDED: Final = 8
CHANNELS = ("airspeed", "heading", "height")
AIRSPEED: Final = 0
HEADING: Final = 1
HEIGHT: Final = 2
GAP_S: Final = 0.5
"""Acknowledgements of setpoints that come later than this may mean that setpoints didn't arrive."""


class NonConformance(NamedTuple):
    """A commanded change that a column didn't fly within the window: m/s, rad or m."""

    column: int
    channel: str
    expected: float
    flown: float


class _Flier:
    """One column: where it has been within the window, and how often it fell short."""

    __slots__ = ("air_variance", "bad", "broken", "carried_m", "climbed", "good", "least", "model", "past")

    def __init__(self, model: AutopilotModel, sigma: tuple[float, float, float]) -> None:
        """Expect changes by `model`; `sigma`: standard deviations of the telemetry of each channel."""
        self.model = model
        self.least = [least + SIGMAS * each for least, each in zip(LEAST_CHANGE, sigma, strict=True)]
        self.carried_m = _carried_m(model)
        self.past: deque[tuple[int, FlightState]] = deque(maxlen=WINDOW_CHECKS)
        self.climbed = False
        """Whether it was climbing or descending when it was first commanded."""
        self.air_variance = 0.0
        """Of the vertical motion of the air that would explain its heights, (m/s)²."""
        self.bad, self.good, self.broken = [0, 0, 0], 0, False

    def judge(self, expected: list[float], flown: list[float], settled: list[bool], speed_mps: float) -> int | None:
        """Take the changes of the window, of channels that are judged; return the channel that newly isn't followed.

        `speed_mps` is its airspeed: the faster it flies, the less a gust aside turns its course.
        """
        gust_mps = AIR_SIGMAS * math.sqrt(self.air_variance)
        kept_up = settled[AIRSPEED] and settled[HEADING] and settled[HEIGHT]
        for channel, change in enumerate(expected):
            seen = flown[channel]
            limit, short = MISSED_SHARE * abs(change), change - seen if change > 0.0 else seen - change
            if channel == HEADING:
                limit = max(limit, gust_mps / max(speed_mps, gust_mps, LEAST_AIRSPEED_MPS))
            elif channel == HEIGHT:
                limit = max(limit, max(RISING_AIR_MPS, gust_mps) * self.carried_m)
                if settled[channel]:
                    air_mps = (change - seen) / self.carried_m
                    self.air_variance += CHECK_S / AIR_MEMORY_S * (air_mps * air_mps - self.air_variance)
            missed = settled[channel] and abs(change) >= self.least[channel] and short > limit
            self.bad[channel] = self.bad[channel] + 1 if missed else 0
            kept_up = kept_up and not missed
        self.good = self.good + 1 if kept_up else 0
        self.broken = self.broken and self.good < CHECKS_MENDED
        worst = max(self.bad)
        if worst < CHECKS_BROKEN or self.broken:
            return None
        self.broken = True
        return self.bad.index(worst)


class MotionConformance:
    """Predicts every vehicle from an earlier state through the setpoints since then, and compares."""

    def __init__(self, scenario: Scenario, history: SetpointHistory) -> None:
        """Take the model from the scenario; `history` holds what was commanded."""
        models = zip(_judged_by(scenario), _noise(scenario), strict=True)
        self._fliers = [_Flier(model, sigma) for model, sigma in models]
        self._history = history
        self._next_check = Instant(0)
        self.broken = [False] * len(self._fliers)
        """Columns that don't follow, (C,)."""
        self.doubted = self.broken
        """Columns that don't follow, or have missed what was expected in two checks in a row, (C,)."""

    def due(self, now: Instant) -> bool:
        """Whether a check is due."""
        return now >= self._next_check

    def check(
        self,
        now: Instant,
        stamps: list[int],
        states: list[FlightState],
        settled: list[list[bool]],
        commanded_s: list[float],
    ) -> list[NonConformance]:
        """Compare, as a check is due; return new findings. `broken` has all columns that don't follow.

        Args:
            now: the tick's instant.
            stamps: (C,) when the states were true.
            states: (C,) newest states.
            settled: (C, 3) channels that have been commanded, and acknowledged, for `SETTLED_S`.
            commanded_s: (C,) for how long each has been commanded without a break.
        """
        self._next_check = Instant(now + round(CHECK_S * NANOSECONDS))
        found: list[NonConformance] = []
        for column, stamp in enumerate(stamps):
            finding = self._look(column, stamp, states[column], settled[column], commanded_s[column])
            if finding is not None:
                found.append(finding)
        self.broken = [flier.broken for flier in self._fliers]
        self.doubted = [flier.broken or max(flier.bad) >= CHECKS_DOUBTED for flier in self._fliers]
        return found

    def _look(
        self, column: int, stamp: int, seen: FlightState, settled: list[bool], commanded_s: float
    ) -> NonConformance | None:
        """Compare one column's motion."""
        flier = self._fliers[column]
        if commanded_s < CHECK_S:
            flier.climbed = abs(seen.climb_mps) > CLIMBING_MPS
        flier.past.append((stamp, seen))
        if len(flier.past) < WINDOW_CHECKS or not any(settled):
            flier.bad, flier.good = [0, 0, 0], 0
            return None
        since, before = flier.past[0]
        end = before.copy()
        self._history.respond(end, since, max(stamp, since), column, flier.model)
        expected, flown = _change(before, end), _change(before, seen)
        flown[HEADING] = wrap(flown[HEADING])
        if flier.climbed and commanded_s < LEVELS_OUT_S:
            settled[AIRSPEED] = settled[HEIGHT] = False
        fast = max(seen.airspeed_mps, before.airspeed_mps) > FAST_SHARE * flier.model.speed_max_mps
        if fast and expected[HEIGHT] > 0.0:
            settled[HEIGHT] = False
        judged = flown.copy()
        if flier.model.speed_min_mps > 0.0:
            judged[AIRSPEED] = _by_energy(expected, flown, max(seen.airspeed_mps, flier.model.speed_min_mps))
        channel = flier.judge(expected, judged, settled, seen.airspeed_mps)
        return None if channel is None else NonConformance(column, CHANNELS[channel], expected[channel], flown[channel])


def _by_energy(expected: list[float], flown: list[float], speed_mps: float) -> float:
    """Return by how much an aircraft's airspeed has changed, but for what it is off because its height is.

    Its throttle holds the sum of both energies and its pitch divides it, slowly: one that is too low by h is too fast
    by g h / v, and obeys (ArduPilot documentation, "TECS (Total Energy Control System) for speed and height tuning").
    """
    traded_mps = flown[AIRSPEED] + GRAVITY_MPS2 * (flown[HEIGHT] - expected[HEIGHT]) / speed_mps
    return within(expected[AIRSPEED], min(flown[AIRSPEED], traded_mps), max(flown[AIRSPEED], traded_mps))


def _change(before: FlightState, after: FlightState) -> list[float]:
    """Return by how much airspeed, heading and height have changed."""
    return [
        after.airspeed_mps - before.airspeed_mps,
        after.heading_rad - before.heading_rad,
        after.height_m - before.height_m,
    ]


def _judged_by(scenario: Scenario) -> list[AutopilotModel]:
    """Return the models that changes are expected by; the lags of an airframe's slow changes aren't those of steps."""
    models = autopilot_models(scenario)
    for model, keys in zip(models, column_models(scenario), strict=True):
        if keys.airframe is not None:
            model.tau_v_s = max(model.tau_v_s, STEP_LAG_S)
    return models


def _carried_m(model: AutopilotModel) -> float:
    """Return how far air that rises at 1 m/s carries a vehicle within the window, its height loop against it.

    In the end tau_ha + tau_hb; until then the model's own way there.
    """
    end_m = model.tau_ha_s + model.tau_hb_s
    state = FlightState(0.0, 0.0, -end_m, 1.0, 0.0, 0.0, 0.0, 0.0)
    respond(state, model, 0.0, 0.0, 0.0, WINDOW_S)
    return end_m + state.height_m


def _noise(scenario: Scenario) -> list[tuple[float, float, float]]:
    """Return the standard deviations of each channel's telemetry, column by column."""
    sources = [vehicle.navigation if vehicle else None for vehicle in columns(scenario)]
    return [
        (each.airspeed_sigma_mps, math.radians(each.heading_sigma_deg), each.position_sigma_m)
        if isinstance(each, NoisyNavigation)
        else (0.0, 0.0, 0.0)
        for each in sources
    ]


class ConformanceMonitor:
    """Reports vehicles that don't do what they acknowledged: events `disobeys`, and `obeys` when they do again."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: dict[VehicleId, Vehicle],
        note: Note,
    ) -> None:
        """Compare `vehicles`."""
        self._controller = controller
        self._vehicles = vehicles
        self._note = note
        self._motion = MotionConformance(scenario, controller.history)
        for vehicle in vehicles.values():
            for channel in vehicle.setpoint_channels.values():
                channel.allow(max(GAP_S, 2.5 / scenario.law.rate_hz))
        self._unanswered = set[VehicleId]()
        """Vehicles that were commanded and answered nothing."""
        self._since: list[Instant | None] = [None] * (1 + len(scenario.followers))
        """Since when each column has been commanded without interruption, (C,)."""

    @property
    def doubted(self) -> list[bool]:
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
                details: dict[str, Detail] = {
                    "order": missing.description,
                    "after_s": missing.after_s,
                    "mode": mode,
                    "armed": armed,
                }
                self._note(now, "disobeys", text, vehicle, details)
            elif missing is None and before is not None:
                self._note(now, "obeys", f"{before.description} is over", vehicle, {"order": before.description})

    def judge_motion(self, tick: Tick, now: Instant) -> None:
        """Check how the vehicles follow this and earlier ticks' setpoints."""
        for column, active in enumerate(tick.active):
            if not active:
                self._since[column] = None
            elif self._since[column] is None:
                self._since[column] = now
        if not self._motion.due(now):
            return
        filters, settled = self._controller.estimator.filters, [[False] * len(CHANNELS) for _ in tick.active]
        commanded_s = [0.0] * len(settled)
        for vehicle in self._vehicles.values():
            column = vehicle.column
            began = self._since[column]
            since = now if began is None else began
            commanded_s[column] = seconds_between(since, now)
            settled[column] = self._settled(vehicle, since, now)
        before = self._motion.broken
        states = [each.state or unknown_state() for each in filters]
        for vehicle in self._vehicles.values():
            if vehicle.autopilot.flies_courses:
                states[vehicle.column] = _by_course(states[vehicle.column], vehicle.telemetry.motion)
        found = self._motion.check(now, [each.stamp for each in filters], states, settled, commanded_s)
        for each in found:
            self._note(now, "disobeys", _words(each), self._at(each.column), _figures(each))
        for column, broken in enumerate(self._motion.broken):
            if broken or not before[column]:
                continue
            self._note(now, "obeys", "follows its setpoints again", self._at(column), {"order": "setpoints"})

    def _settled(self, vehicle: Vehicle, since: Instant, now: Instant) -> list[bool]:
        """Return which channels of a vehicle commanded `since` then have been acknowledged for long enough."""
        if not vehicle.autopilot.setpoint_commands:
            return _settled_unanswered(vehicle, since, now)
        runs = [vehicle.setpoint_channels[i].since(now) for i in vehicle.autopilot.setpoint_commands]
        latest = after(now, -SETTLED_S)
        return [run is not None and max(since, run) <= latest for run in runs]

    def _at(self, column: int) -> Vehicle:
        return next(each for each in self._vehicles.values() if each.column == column)


def _by_course(state: FlightState, seen: Motion | None) -> FlightState:
    """Return a state with the heading that the course over ground shows."""
    shown = state.copy()
    if seen is not None:
        shown.heading_rad = heading_shown(state, seen.north_mps, seen.east_mps)
    return shown


def _settled_unanswered(vehicle: Vehicle, since: Instant, now: Instant) -> list[bool]:
    """Return which channels have been commanded for long enough of a vehicle that acknowledges no setpoint.

    Its answers to probes show that it hears. A vehicle that can stand has any course there.
    """
    settled = vehicle.talks_on_s <= UNANSWERED_S and since <= after(now, -SETTLED_S)
    return [settled, settled and not vehicle.autopilot.stands, settled]


def _words(found: NonConformance) -> str:
    scale, unit = {"airspeed": (1.0, "m/s"), "heading": (180 / math.pi, "°"), "height": (1.0, "m")}[found.channel]
    flown, expected = found.flown * scale, found.expected * scale
    return (
        f"acknowledges setpoints and doesn't follow them: {found.channel} changed by {flown:.1f} {unit} "
        f"in {WINDOW_S:g} s, {expected:.1f} {unit} expected"
    )


def _figures(found: NonConformance) -> dict[str, Detail]:
    return {"order": "setpoints", "channel": found.channel, "expected": found.expected, "flown": found.flown}
