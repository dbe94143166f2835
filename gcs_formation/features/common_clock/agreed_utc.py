# Compiled by mypyc: it runs every tick.

"""UTC minus the station's clock by the vote of all vehicles, and whose stamps are mapped by it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median
from typing import Final, NamedTuple

from airlink.clock import Instant, seconds_between
from airlink.endpoint import VehicleId
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.link.utc_slack import UTC_SLACK_S
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle

UTC_IN_USE_S: Final = 10e-3
"""The same for UTC already in use. Tuned: s; more than `UTC_SLACK_S`, 6e-3 to 20e-3; shown by `python -m
benchmarks.gnss_grid`."""
UTC_AGAIN_S: Final = 10.0
"""UTC that was rejected is used again once it has been consistent for this long. Tuned: s; 5 to 60; shown by `pytest
tests/gcs_formation/features/common_clock`."""
UTC_SLEW: Final = 0.01
"""Rate at which the mapping of stamps changes in flight, s a second. Tuned: s/s; 0.002 to 0.02; shown by `python -m
benchmarks.gnss_grid`."""
UTC_LOOKED_AT: Final = 12
"""Number of round trips (3 s) after which a vehicle whose UTC isn't used is reported. Tuned: round trips; 8 to 40; by
judgement."""


class UtcBounds(NamedTuple):
    """Bounds on UTC minus our clock by one vehicle, s; by causality `middle_s` plus or minus `half_round_trip_s`."""

    middle_s: float
    """The value for equal delays up and down."""
    half_round_trip_s: float
    """Half of the shortest round trip."""

    def allows(self, utc_s: float, slack_s: float = UTC_SLACK_S) -> bool:
        """Return whether no datagram would arrive before it was sent."""
        return abs(utc_s - self.middle_s) <= self.half_round_trip_s + slack_s


def agreed_s(bounds: Sequence[UtcBounds], before_s: float = math.nan) -> float:
    """Return the value of UTC minus our clock that most vehicles allow; NaN if no value has a majority.

    The earlier value is kept while most allow it. Otherwise it's the median of those that agree, within their bounds.
    """
    if not bounds:
        return math.nan
    if 2 * sum(each.allows(before_s) for each in bounds) > len(bounds):
        return before_s
    edges = [each.middle_s + sign * each.half_round_trip_s for each in bounds for sign in (-1.0, 1.0)]
    maximum = max(edges, key=lambda edge_s: sum(each.allows(edge_s) for each in bounds))
    agreeing = [each for each in bounds if each.allows(maximum)]
    if 2 * len(agreeing) <= len(bounds):
        return math.nan
    low_s = max(each.middle_s - each.half_round_trip_s for each in agreeing)
    high_s = min(each.middle_s + each.half_round_trip_s for each in agreeing)
    if low_s > high_s:  # they agree by the slack alone
        return (low_s + high_s) / 2.0
    return max(low_s, min(high_s, median(each.middle_s for each in agreeing)))


class CommonClock(Stage):
    """Decides whose UTC is used, and estimates UTC minus our clock, before samples are taken by their stamps."""

    name = "common_clock"
    after = ("heartbeats",)

    def __init__(self, cycle: Cycle) -> None:
        """Start without UTC; if our clock is set to UTC, that is known."""
        self._vehicles = [vehicle for vehicle in cycle.each if vehicle.round_trips.gnss is not None]
        self._known_s, self._log_event = cycle.utc_at_0_s, cycle.log_event
        self._utc_s = math.nan
        """UTC minus our clock as used; NaN before the first estimate."""
        self._reported: dict[VehicleId, tuple[bool, bool]] = {}
        self._given_up: dict[VehicleId, tuple[Instant, str]] = {}
        """Vehicles whose UTC was in use and was rejected: when it was last inconsistent, and how."""
        self._last: Instant | None = None

    def run(self, cycle: Cycle) -> None:
        """Check all clocks: estimate UTC, and use or reject each vehicle's."""
        if not self._vehicles:
            return
        now = cycle.now
        elapsed_s = 0.0 if self._last is None else seconds_between(self._last, now)
        self._last = now
        bounds = {each.identity: _bounds(each) for each in self._vehicles}
        known = [each for each in bounds.values() if each is not None]
        flying = any(each.member is Member.FLYING for each in self._vehicles)
        found_s = self._known_s if self._known_s is not None else agreed_s(known, self._utc_s if flying else math.nan)
        self._move(found_s, UTC_SLEW * elapsed_s if flying else math.inf)
        for vehicle in self._vehicles:
            self._judge(vehicle, bounds[vehicle.identity], now, UTC_SLEW * elapsed_s)

    def _move(self, found_s: float, max_s: float) -> None:
        if not math.isnan(found_s):
            change_s = 0.0 if math.isnan(self._utc_s) else found_s - self._utc_s
            self._utc_s = found_s - change_s + max(-max_s, min(max_s, change_s))

    def _judge(self, vehicle: Vehicle, bounds: UtcBounds | None, now: Instant, slew_s: float) -> None:
        why = self._still(vehicle, self._why_not(vehicle, bounds), now)
        flies = vehicle.member is Member.FLYING
        vehicle.round_trips.stamps.use_utc(None if why else self._utc_s, now, slew_s if flies else math.inf)
        jump_s = vehicle.round_trips.gnss.jump_s if vehicle.round_trips.gnss else 0.0
        state = (why is None, bool(jump_s))
        if vehicle.clock.samples >= UTC_LOOKED_AT and state != self._reported.get(vehicle.identity):
            self._reported[vehicle.identity] = state
            went_on = f"its UTC jumped by {jump_s:+.3f} s in flight; its clock goes on as before"
            found = went_on if jump_s else "its stamps are mapped by its UTC"
            self._log_event(now, "clock", f"UTC isn't used: {why}" if why else found, vehicle)

    def _still(self, vehicle: Vehicle, why: str | None, now: Instant) -> str | None:
        """Return why a vehicle's UTC isn't used; after rejection it must be consistent for `UTC_AGAIN_S`."""
        given_up = self._given_up.get(vehicle.identity)
        if why is not None and (given_up or vehicle.round_trips.stamps.by_utc):
            self._given_up[vehicle.identity] = now, why
        elif given_up and seconds_between(given_up[0], now) < UTC_AGAIN_S:
            return given_up[1]
        elif given_up:
            del self._given_up[vehicle.identity]
        return why

    def _why_not(self, vehicle: Vehicle, bounds: UtcBounds | None) -> str | None:
        stamps = vehicle.round_trips.stamps
        if bounds is None:
            return stamps.gnss.why_not(used=stamps.by_utc) if stamps.gnss else None
        if math.isnan(self._utc_s):
            return "vehicles disagree about it, and no majority is right"
        if bounds.allows(self._utc_s, UTC_IN_USE_S if stamps.by_utc else UTC_SLACK_S):
            return None
        min_s = abs(bounds.middle_s - self._utc_s) - bounds.half_round_trip_s
        return f"it is {min_s:.3f} s or more off the others', as nothing arrives before it was sent"


def _bounds(vehicle: Vehicle) -> UtcBounds | None:
    clock = vehicle.round_trips.gnss
    if clock is None or clock.why_not(used=vehicle.round_trips.stamps.by_utc) is not None:
        return None
    return UtcBounds(clock.station_utc_s(), clock.half_round_trip_s)
