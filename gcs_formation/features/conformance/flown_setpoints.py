# Compiled by mypyc: it runs every tick.

"""Checks whether one vehicle follows its setpoints, by the autopilot model; the package's essay has the theory."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from flight_model.autopilot_model import AutopilotModel, respond, within, wrap
from flight_model.energy import GRAVITY_MPS2
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.estimation.vehicle_filter import MIN_AIRSPEED_MPS
from gcs_formation.vehicle.vehicle import Vehicle

CHECK_S: Final = 0.4
"""Interval of the checks. Tuned: s; 0.2 to 0.8; shown by `pytest tests/gcs_formation/features/conformance`."""
WINDOW_S: Final = 3.2
"""Length of the window over which flown and expected motion are compared. Tuned: s; 2 to 6; shown by `pytest
tests/gcs_formation/features/conformance`."""
WINDOW_CHECKS: Final = round(WINDOW_S / CHECK_S)
SETTLED_S: Final = WINDOW_S + 1.0
"""A vehicle is judged after it has been commanded, and has acknowledged its setpoints, for this long. Tuned: s;
`WINDOW_S` and more; shown by `pytest tests/gcs_formation/features/conformance`."""
CLIMBING_MPS: Final = 1.0
"""Climb or sink from which on a vehicle that is taken over counts as climbing. Tuned: m/s; 0.5 to 2; shown by `pytest
tests/gcs_formation/features/conformance`."""
LEVELS_OUT_S: Final = 30.0
"""Airspeed and height of a vehicle that was climbing or sinking faster when taken over aren't judged for this long: an
aircraft that levels out trades speed for height, and its throttle lags. Tuned: s; 20 to 60; shown by `pytest
tests/gcs_formation/features/conformance`."""
OFF_MPS: Final = 2.0
"""Airspeed off the setpoint from which on heights aren't judged. Tuned: m/s; 1 to 3; shown by `pytest
tests/gcs_formation/features/conformance`."""
OFF_S: Final = 8.0
"""An aircraft's height isn't judged while its airspeed is off the setpoint by more than `OFF_MPS`, and this long after:
it dives for speed or climbs to lose some, and its throttle lags (ArduPlanes were 7 m off 2 s after lacking 2.5 m/s).
Tuned: s; 4 to 15; shown by flights of ArduPlane's simulator."""
MIN_CHANGE = (1.0, 0.04, 1.5)
"""Airspeed in m/s, heading in rad, height in m: smaller expected changes in the window aren't judged. Tuned: m/s, rad,
m; half to double; shown by `pytest tests/gcs_formation/features/conformance`."""
SIGMAS: Final = 4.0
"""Multiple of the telemetry noise's standard deviation that is added to these. Tuned: standard deviations; 3 to 6;
shown by `pytest tests/gcs_formation/features/conformance`."""
FAST_SHARE: Final = 0.9
"""Share of the highest airspeed above which climbs aren't judged: little power is left for them. Tuned: share; 0.8 to
0.95; shown by `pytest tests/gcs_formation/features/conformance`."""
RISING_AIR_MPS: Final = 1.5
"""Vertical air motion, not visible in telemetry, that may always explain a vehicle's height error. Tuned: m/s; 1 to 3;
shown by `pytest tests/gcs_formation/features/conformance`."""
AIR_SIGMAS: Final = 4.0
"""Standard deviations of air motion that may explain an error. Tuned: standard deviations; 3 to 5; shown by `pytest
tests/gcs_formation/features/conformance`."""
AIR_MEMORY_S: Final = 60.0
"""If greater, this multiple of the standard deviation of air motion estimated from the vehicle's heights, averaged over
about `AIR_MEMORY_S`, explains it; the same is allowed for gusts from the side. Tuned: s; 30 to 180; shown by `pytest
tests/gcs_formation/features/conformance`."""
MISSED_SHARE: Final = 0.75
"""A vehicle that falls short by a greater share isn't following. By the model a vehicle falls short by at most 0.3; a
real one, whose turns begin 0.6 s later, by up to 0.65 at the beginning of a bend. Tuned: share; 0.65 to 0.9; shown by
flights of ArduPlane's simulator."""
CONTINUES_S: Final = 1.5
"""Time for which an aircraft continues the turn or speed change with which the window began, regardless of setpoints:
(7) lacks the bank and throttle that must first return. Tuned: s; 1 to 3; shown by `pytest
tests/gcs_formation/features/conformance`."""
CLIMBS_SHARE: Final = 0.5
"""Share of a vehicle's reach from which on a setpoint above it is a command to climb. Tuned: share; 0.3 to 0.7; shown
by `pytest tests/gcs_formation/features/conformance`."""
AT_LIMIT_SHARE: Final = 0.9
"""Shares of a vehicle's reach, which is how far it climbs at its limit within its height's time constants. A height
setpoint above it by more than the first share is a command to climb; by more than the second, to climb at the limit.
Tuned: share; 0.7 to 1; shown by `pytest tests/gcs_formation/features/conformance`."""
SUNK_M: Final = 15.0
"""A vehicle commanded to climb sinks if it loses more height than this, or, if greater, than the air explains. Tuned:
m; 10 to 30; shown by `pytest tests/gcs_formation/features/conformance`."""
CLIMBS_MIN_SHARE: Final = 0.25
"""Share of the climb limit below which one that is to climb at the limit hardly does. Tuned: share; 0.15 to 0.4; shown
by `pytest tests/gcs_formation/features/conformance`."""
CHECKS_STUCK: Final = 20
"""A vehicle is stuck if, commanded to climb at its limit, it climbs at less than `CLIMBS_MIN_SHARE` of that for so many
checks, 8 s. Sinking air could explain it too, and then keeps the vehicle from its height as well. Tuned: checks; 10 to
40; shown by `pytest tests/gcs_formation/features/conformance`."""
CHECKS_DOUBTED: Final = 2
"""Consecutive checks that a channel fails until its vehicle is doubted. Tuned: checks; 1 to 3; shown by `pytest
tests/gcs_formation/features/conformance`."""
CHECKS_BROKEN: Final = 4
"""Consecutive checks that a channel fails until its vehicle is doubted, and until it is reported. Tuned: checks; 3 to
6; shown by `pytest tests/gcs_formation/features/conformance`."""
CHECKS_MENDED: Final = 8
"""Consecutive checks without a failure until it counts as following again. Tuned: checks; 5 to 20; shown by `pytest
tests/gcs_formation/features/conformance`."""
MIN_NORM: Final = 1e-9
CHANNELS = ("airspeed", "heading", "height")
AIRSPEED: Final = 0
HEADING: Final = 1
HEIGHT: Final = 2
Judged = tuple[bool, bool, bool]
"""Whether each channel is judged."""


class NonConformance(NamedTuple):
    """A commanded change that wasn't flown in the window, or the height lost since sinking began: m/s, rad or m."""

    channel: str
    expected: float
    flown: float
    over_s: float = WINDOW_S


class FlownSetpoints:
    """One vehicle's states within the window, and how often it fell short."""

    def __init__(
        self,
        vehicle: Vehicle,
        model: AutopilotModel,
        sigma: tuple[float, float, float],
        prompt_share: float,
    ) -> None:
        """Predict changes by `model`.

        Args:
            vehicle: the vehicle to check.
            model: its autopilot model.
            sigma: standard deviations of the telemetry noise of each channel.
            prompt_share: share of an airspeed change that is prompt; the autopilot's integrator does the rest slowly.
        """
        self.vehicle, self.model = vehicle, model
        self.min_change = [floor + SIGMAS * each for floor, each in zip(MIN_CHANGE, sigma, strict=True)]
        self.min_change[AIRSPEED] /= prompt_share
        self.carried_m = _carried_m(model)
        self.reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        self.since: Instant | None = None
        """Start of its present period of setpoints; None while it has none."""
        self.past, self.stamps = list[FlightState](), list[int]()
        """Its states at the last checks, at most `WINDOW_CHECKS`, and their times."""
        self.climbed = False
        """Whether it was climbing or descending when it was first commanded."""
        self.off_at = Instant(-round(OFF_S * NANOSECONDS))
        """When its airspeed was last far off its setpoint."""
        self.air_variance = 0.0
        """Variance of the vertical air motion that would explain its heights, (m/s)²."""
        self.highest_m, self.highest_at, self.sinks = -math.inf, 0, False
        """Its greatest height since it was commanded to climb, the time of that, and whether it is sinking."""
        self.stuck = 0
        """Number of consecutive checks in which it hardly climbed although commanded to at its limit."""
        self.bad, self.good, self.broken, self.missed = [0, 0, 0], 0, False, AIRSPEED
        """Consecutive misses of each channel; consecutive checks without a miss; whether it isn't following, and in
        which channel."""

    @property
    def worst(self) -> int:
        """The channel with the most consecutive misses."""
        speed, heading, height = self.bad[AIRSPEED], self.bad[HEADING], self.bad[HEIGHT]
        if speed >= heading and speed >= height:
            return AIRSPEED
        return HEADING if heading >= height else HEIGHT

    @property
    def doubted(self) -> bool:
        """Whether it isn't following, or has just missed two checks in a row."""
        return self.broken or self.bad[self.worst] >= CHECKS_DOUBTED

    def check(
        self, stamp: int, seen: FlightState, history: SetpointHistory, now: Instant, *, saturated: bool = False
    ) -> NonConformance | None:
        """Compare its newest state, of time `stamp`, with the prediction; return a newly found failure to follow.

        One that is `saturated` needn't become faster.
        """
        commanded_s = 0.0 if self.since is None else seconds_between(self.since, now)
        if commanded_s < CHECK_S:
            self.climbed = abs(seen.climb_mps) > CLIMBING_MPS
        self._remember(stamp, seen)
        commanded_m = self._commanded(stamp, seen, history, now)
        by_speed, by_heading, by_height = self._settled(now)
        sunk = self._sunk(stamp, seen, commanded_m if by_height else math.nan)
        if len(self.past) < WINDOW_CHECKS or not (by_speed or by_heading or by_height):
            self.bad, self.good, self.stuck = [0, 0, 0], 0, 0
            return None
        before, since = self.past[0], self.stamps[0]
        end = before.copy()
        history.respond(end, since, max(stamp, since), self.vehicle.index, self.model)
        levels_out = self.climbed and commanded_s < LEVELS_OUT_S
        fast = max(seen.airspeed_mps, before.airspeed_mps) > FAST_SHARE * self.model.speed_max_mps
        by_speed = by_speed and not levels_out and not saturated
        trades = seconds_between(self.off_at, now) < OFF_S
        by_height = by_height and not levels_out and not trades and not (fast and end.height_m > before.height_m)
        expected, flown = _changes(before, end, seen, hovers=self.model.may_hover)
        judged = by_speed, by_heading, by_height
        channel = self._judge(expected, self._less_initial_motion(expected, flown), seen.airspeed_mps, judged)
        above_m = commanded_m - seen.height_m if by_height and not fast else math.nan
        sunk = sunk or self._stuck(above_m, flown[HEIGHT])
        if sunk is not None:
            self.good = 0
            if channel is not None or not self.broken:
                self.broken, self.missed = True, HEIGHT
                return sunk
        return None if channel is None else NonConformance(CHANNELS[channel], expected[channel], flown[channel])

    def _remember(self, stamp: int, seen: FlightState) -> None:
        if len(self.past) == WINDOW_CHECKS:
            self.past.pop(0)
            self.stamps.pop(0)
        self.past.append(seen)
        self.stamps.append(stamp)

    def _less_initial_motion(self, expected: Vector3, flown: Vector3) -> Vector3:
        """Return the changes flown, without the part that an aircraft makes by continuing its motion at the start.

        That part is taken off where it is opposite to the expected change: a turn or a change of speed that was under
        way must first end before the commanded one can begin.
        """
        before, after_s = self.past[0], max((self.stamps[1] - self.stamps[0]) / NANOSECONDS, CHECK_S)
        faster_mps, turned_rad, _ = _changes(before, before, self.past[1], hovers=False)[1]
        speed_mps = _less_if_opposite(expected[AIRSPEED], flown[AIRSPEED], CONTINUES_S * faster_mps / after_s)
        heading_rad = _less_if_opposite(expected[HEADING], flown[HEADING], CONTINUES_S * turned_rad / after_s)
        return speed_mps, heading_rad, flown[HEIGHT]

    def _commanded(self, stamp: int, seen: FlightState, history: SetpointHistory, now: Instant) -> float:
        """Return the height setpoint, NaN without setpoints; note when the airspeed is far off."""
        if self.since is None:
            return math.nan
        commanded_mps, _, commanded_m = history.commanded(stamp, self.vehicle.index)
        if not self.model.may_hover and abs(commanded_mps - seen.airspeed_mps) > OFF_MPS:
            self.off_at = now
        return commanded_m

    def _sunk(self, stamp: int, seen: FlightState, commanded_m: float) -> NonConformance | None:
        """Return the height lost if it sinks although commanded to climb; NaN in `commanded_m`: not judged.

        Height setpoints stay within its reach, and so sink with it: within one window it hardly falls short of them.
        """
        climbs = commanded_m - seen.height_m > CLIMBS_SHARE * self.reach_m
        if not climbs or seen.height_m - self.past[0].height_m > MIN_CHANGE[HEIGHT]:
            self.highest_m, self.sinks = -math.inf, False
        elif seen.height_m > self.highest_m:
            self.highest_m, self.highest_at = seen.height_m, stamp
        lost_m, air_mps = self.highest_m - seen.height_m, AIR_SIGMAS * math.sqrt(self.air_variance)
        self.sinks = self.sinks or lost_m > max(SUNK_M, air_mps * self.carried_m)
        if not self.sinks:
            return None
        return NonConformance(CHANNELS[HEIGHT], 0.0, -lost_m, (stamp - self.highest_at) / NANOSECONDS)

    def _stuck(self, commanded_m: float, risen_m: float) -> NonConformance | None:
        """Return the climb that it fails to fly with a setpoint `commanded_m` above it, after enough checks."""
        full_m = self.model.climb_max_mps * WINDOW_S
        stuck = commanded_m > AT_LIMIT_SHARE * self.reach_m and risen_m < CLIMBS_MIN_SHARE * full_m
        self.stuck = self.stuck + 1 if stuck else 0
        self.good = 0 if stuck else self.good
        return None if self.stuck < CHECKS_STUCK else NonConformance(CHANNELS[HEIGHT], full_m, risen_m)

    def _settled(self, now: Instant) -> Judged:
        """Return for which channels setpoints have been sent, and acknowledged, for long enough."""
        latest = after(now, -SETTLED_S)
        if self.since is None or self.since > latest:
            return False, False, False
        channels = self.vehicle.setpoint_channels
        if channels:
            speed, heading, height = channels[AIRSPEED], channels[HEADING], channels[HEIGHT]
            return speed.known_since(latest, now), heading.known_since(latest, now), height.known_since(latest, now)
        # Without acknowledgements, answers to TIMESYNC show that it receives. In hover a multirotor may have any
        # course.
        receives = self.vehicle.receives
        return receives, receives and not self.vehicle.autopilot.hovers, receives

    def _judge(self, expected: Vector3, flown: Vector3, airspeed_mps: float, judged: Judged) -> int | None:
        """Evaluate the changes in the window; return the channel that newly isn't followed, of those `judged`.

        A gust from the side turns the course by less at a higher `airspeed_mps`.
        """
        by_speed, by_heading, by_height = judged
        faster_mps, turned_rad, risen_m = expected
        flown_mps, flown_rad, flown_m = flown
        gust_mps, slowest_mps = AIR_SIGMAS * math.sqrt(self.air_variance), self.model.speed_min_mps
        if by_height:
            air_mps = (risen_m - flown_m) / self.carried_m
            self.air_variance += CHECK_S / AIR_MEMORY_S * (air_mps * air_mps - self.air_variance)
        if not self.model.may_hover:
            flown_mps = _by_energy(faster_mps, flown_mps, flown_m - risen_m, max(airspeed_mps, slowest_mps))
        min_mps = max(gust_mps, MIN_AIRSPEED_MPS)
        drift_rad = gust_mps / max(airspeed_mps, min_mps)
        carried_m = max(RISING_AIR_MPS, gust_mps) * self.carried_m
        keeps_speed = self._keeps_up(AIRSPEED, faster_mps, flown_mps, 0.0, judged=by_speed)
        keeps_heading = self._keeps_up(HEADING, turned_rad, flown_rad, drift_rad, judged=by_heading)
        keeps_height = self._keeps_up(HEIGHT, risen_m, flown_m, carried_m, judged=by_height)
        worst = self.worst
        self.good = self.good + 1 if judged[self.missed] and keeps_speed and keeps_heading and keeps_height else 0
        self.broken = self.broken and self.good < CHECKS_MENDED
        if self.bad[worst] < CHECKS_BROKEN or self.broken:
            return None
        self.broken, self.missed = True, worst
        return worst

    def _keeps_up(self, channel: int, change: float, flown: float, by_air: float, *, judged: bool) -> bool:
        """Return whether a channel's change is flown, explained by the air or not judged; count misses."""
        short = change - flown if change > 0.0 else flown - change
        large = abs(change) >= self.min_change[channel]
        missed = judged and large and short > max(MISSED_SHARE * abs(change), by_air)
        self.bad[channel] = self.bad[channel] + 1 if missed else 0
        return not missed


def _by_energy(expected_mps: float, flown_mps: float, above_m: float, speed_mps: float) -> float:
    """Return an aircraft's change of airspeed without the part traded for being `above_m` above its expected height.

    Total energy control holds the sum of both energies by throttle, and distributes it slowly by pitch. So a vehicle
    that is too low by h may be too fast by g h / v (ArduPilot documentation, "TECS (Total Energy Control System) for
    speed and height tuning").
    """
    traded_mps = flown_mps + GRAVITY_MPS2 * above_m / speed_mps
    return within(expected_mps, min(flown_mps, traded_mps), max(flown_mps, traded_mps))


def _changes(before: FlightState, end: FlightState, seen: FlightState, *, hovers: bool) -> tuple[Vector3, Vector3]:
    """Return the expected changes of airspeed, heading and height until `end`, and the actual ones until `seen`."""
    turn_rad, turned_rad = end.heading_rad - before.heading_rad, seen.heading_rad - before.heading_rad
    faster_mps, flown_mps = end.airspeed_mps - before.airspeed_mps, seen.airspeed_mps - before.airspeed_mps
    if hovers:
        faster_mps, flown_mps = _change_of_velocity(before, end, seen)
    expected = faster_mps, turn_rad, end.height_m - before.height_m
    return expected, (flown_mps, turn_rad + wrap(turned_rad - turn_rad), seen.height_m - before.height_m)


def _change_of_velocity(before: FlightState, end: FlightState, seen: FlightState) -> tuple[float, float]:
    """Return the expected change of a multirotor's velocity, and the component of the actual change along it."""
    (north, east), (end_north, end_east), (seen_north, seen_east) = (each.ground_mps() for each in (before, end, seen))
    wanted_north, wanted_east = end_north - north, end_east - east
    wanted = max(math.hypot(wanted_north, wanted_east), MIN_NORM)
    return wanted, ((seen_north - north) * wanted_north + (seen_east - east) * wanted_east) / wanted


def _less_if_opposite(expected: float, flown: float, continued: float) -> float:
    """Return a change without the continued initial motion, if that is opposite to the expected change."""
    against = expected * continued < 0.0 and abs(flown) < abs(expected)
    return flown - continued if against else flown


def _carried_m(model: AutopilotModel) -> float:
    """Return the displacement in the window by air that rises at 1 m/s, against the height loop, m.

    The steady value is tau_ha + tau_hb; the model's response approaches it.
    """
    end_m = model.tau_ha_s + model.tau_hb_s
    state = FlightState(0.0, 0.0, -end_m, 1.0, 0.0, 0.0, 0.0, 0.0)
    respond(state, model, 0.0, 0.0, 0.0, WINDOW_S)
    return end_m + state.height_m
