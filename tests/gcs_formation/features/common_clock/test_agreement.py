"""Which UTC is agreed on and used, by bounds that are given: properties of the vote, and its stage without a flight."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.features.common_clock.agreed_utc import CommonClock, UtcBounds, agreed_s
from gcs_formation.features.common_clock.feature import FEATURE
from gcs_formation.link.utc_slack import UTC_SLACK_S
from gcs_formation.vehicle.member import Member
from tests.gcs_formation.event_log import EventLog

BOUNDS = st.lists(
    st.builds(
        UtcBounds,
        st.integers(-400, 400).map(lambda number: number * 1.031e-3),
        st.integers(1, 150).map(lambda number: number * 1.0137e-3),
    ),
    min_size=1,
    max_size=6,
)
"""Multiples that hardly ever differ by the slack exactly."""


def most_at_once(bounds: list[UtcBounds]) -> int:
    """Return the largest number of intervals with a common value; one of their edges is in all of them."""
    edges = [each.middle_s + sign * each.half_round_trip_s for each in bounds for sign in (-1.0, 1.0)]
    return max(sum(each.allows(edge) for each in bounds) for edge in edges)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(bounds=BOUNDS, shift_s=st.integers(-1000, 1000))
def test_a_majority_allows_what_is_agreed_on_and_without_one_nothing_is(bounds: list[UtcBounds], shift_s: int) -> None:
    """The result shifts with the bounds."""
    found = agreed_s(bounds)
    assert math.isnan(found) is (2 * most_at_once(bounds) <= len(bounds))
    if math.isnan(found):
        return
    assert 2 * sum(each.allows(found, UTC_SLACK_S + 1e-9) for each in bounds) > len(bounds)
    shifted = [UtcBounds(each.middle_s + shift_s, each.half_round_trip_s) for each in bounds]
    assert agreed_s(shifted) == pytest.approx(found + shift_s, abs=1e-6)


@settings(deadline=None, max_examples=25, derandomize=True)
@given(bounds=BOUNDS, before_ms=st.integers(-400, 400))
def test_an_earlier_value_is_kept_exactly_while_a_majority_allows_it(bounds: list[UtcBounds], before_ms: int) -> None:
    before_s = before_ms * 1e-3
    keeps = 2 * sum(each.allows(before_s) for each in bounds) > len(bounds)
    fresh = agreed_s(bounds)
    assert agreed_s(bounds, before_s) == pytest.approx(before_s if keeps else fresh, nan_ok=True, abs=0.0)


def test_those_that_agree_by_the_slack_alone_agree_on_the_middle() -> None:
    """-0.05, 0.058 and -0.046 s, each by 0.05: one ends at 0, another begins at 0.008; all three allow 0.004."""
    middles_s = -0.05, 0.058, -0.046, 5.0, 9.0
    bounds = [UtcBounds(each, 0.05) for each in middles_s]
    assert agreed_s(bounds) == pytest.approx(0.004)
    assert sum(each.allows(agreed_s(bounds)) for each in bounds) == 3


def test_of_two_both_must_agree() -> None:
    near, far = UtcBounds(0.0, 0.1), UtcBounds(0.5, 0.1)
    assert math.isnan(agreed_s([near, far], 0.0))
    assert math.isnan(agreed_s([near, far]))
    assert agreed_s([near, UtcBounds(0.1, 0.1)], 0.05) == 0.05
    assert math.isnan(agreed_s([]))


@pytest.mark.parametrize(("off_s", "allowed"), [(0.1049, True), (0.1051, False)])
def test_bounds_allow_half_a_round_trip_and_five_milliseconds(off_s: float, allowed: bool) -> None:
    for sign in (-1.0, 1.0):
        assert UtcBounds(7.0, 0.1).allows(7.0 + sign * off_s) is allowed


class Clock:
    """Vehicles whose UTC minus our clock is within bounds that are given, at a check each quarter of a second."""

    def __init__(self, *middles_s: float, known_s: float | None = None, flies: bool = True) -> None:
        self.logged, self.now = EventLog(), Instant(0)
        self.each = [self.vehicle(1 + index, each, flies) for index, each in enumerate(middles_s)]
        cycle: Any = SimpleNamespace(each=self.each, utc_at_0_s=known_s, log_event=self.logged, now=self.now)
        self.cycle, self.clock = cycle, CommonClock(cycle)

    @staticmethod
    def vehicle(number: int, middle_s: float, flies: bool) -> Any:
        own = SimpleNamespace(middle_s=middle_s, why=None, jump_s=0.0, half_round_trip_s=0.1)
        gnss = SimpleNamespace(
            station_utc_s=lambda: own.middle_s,
            half_round_trip_s=0.1,
            why_not=lambda *, used: own.why,
            jump_s=0.0,
        )
        stamps = SimpleNamespace(by_utc=False, gnss=gnss, used=list[tuple[float | None, float]]())

        def use_utc(utc_s: float | None, _: Instant, max_s: float) -> None:
            stamps.by_utc = utc_s is not None
            stamps.used.append((utc_s, max_s))

        stamps.use_utc = use_utc
        return SimpleNamespace(
            identity=VehicleId(1, number),
            own=own,
            round_trips=SimpleNamespace(gnss=gnss, stamps=stamps),
            member=Member.FLYING if flies else Member.STARTING,
            clock=SimpleNamespace(samples=100),
        )

    def run(self, seconds: float) -> list[tuple[float | None, float]]:
        """Return what the first vehicle's stamps are mapped by at each check, and how fast that may change."""
        used = self.each[0].round_trips.stamps.used
        begun = len(used)
        for _ in range(round(seconds * 4)):
            self.cycle.now = self.now
            self.clock.run(self.cycle)
            self.now = after(self.now, 0.25)
        return list(used[begun:])


def test_on_the_ground_the_common_clock_is_where_it_is_found_at_once() -> None:
    common = Clock(5.0, 5.0, 5.0, flies=False)
    assert common.run(0.5) == [(5.0, math.inf)] * 2
    for each in common.each:
        each.own.middle_s = 6.0
    assert common.run(0.25) == [(6.0, math.inf)]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_in_flight_it_slews_by_a_hundredth_of_a_second_each_second(sign: float) -> None:
    """From 5.0 to 0.3 beyond: each bound has moved by 0.3, and its middle is agreed on again."""
    common = Clock(5.0, 5.0, 5.0)
    assert common.run(0.25) == [(5.0, 0.0)], "no time has passed"
    common.run(1.75)
    for each in common.each:
        each.own.middle_s = 5.0 + sign * 0.104
    assert common.run(2.0)[-1] == (5.0, 0.0025), "still allowed"
    for each in common.each:
        each.own.middle_s = 5.0 + sign * 0.107
    (moved_s, per_check_s) = common.run(0.25)[-1]
    assert moved_s == pytest.approx(5.0 + sign * 0.0025)
    assert per_check_s == pytest.approx(0.0025)


def test_a_known_utc_is_used_whatever_the_vehicles_agree_on() -> None:
    assert Clock(5.05, 5.05, known_s=5.0).run(0.25)[0][0] == 5.0


def test_one_that_is_off_the_others_is_reported_by_how_much() -> None:
    """0.5 s off, of which half a round trip of 0.1 s may be the link's."""
    common = Clock(5.0, 5.0, 5.5)
    common.run(1.0)
    assert common.logged.of("clock", 3) == [
        "UTC isn't used: it is 0.400 s or more off the others', as nothing arrives before it was sent"
    ]
    assert common.logged.of("clock", 1) == ["its stamps are mapped by its UTC"]
    assert common.each[2].round_trips.stamps.used[-1][0] is None


def test_without_a_majority_none_is_used() -> None:
    common = Clock(5.0, 6.0)
    assert common.run(0.5)[-1][0] is None
    assert common.logged.of("clock", 1) == ["UTC isn't used: vehicles disagree about it, and no majority is right"]


@pytest.mark.parametrize(("samples", "said"), [(11, 0), (12, 1)])
def test_it_is_said_from_twelve_round_trips_on_and_once(samples: int, said: int) -> None:
    common = Clock(5.0, 5.0)
    common.each[0].clock.samples = samples
    common.run(5.0)
    assert len(common.logged.of("clock", 1)) == said


@pytest.mark.parametrize(
    ("in_use", "off_s", "used"), [(False, 0.104, True), (False, 0.106, False), (True, 0.109, True)]
)
def test_utc_in_use_is_allowed_ten_milliseconds_instead_of_five(in_use: bool, off_s: float, used: bool) -> None:
    common = Clock(5.0, known_s=5.0)
    if in_use:
        common.run(1.0)
    common.each[0].own.middle_s = 5.0 + off_s
    assert (common.run(0.25)[0][0] is not None) is used
    common.each[0].own.middle_s = 5.111
    assert common.run(0.25)[0][0] is None


def test_given_up_utc_is_used_again_after_ten_seconds_in_order() -> None:
    common = Clock(5.0, known_s=5.0)
    common.run(1.0)
    common.each[0].own.why = "no fix"
    common.run(0.25)
    common.each[0].own.why = None
    found = [each is not None for each, _ in common.run(12.0)]
    assert found == [False] * 39 + [True] * 9
    assert common.logged.of("clock", 1)[1:] == ["UTC isn't used: no fix", "its stamps are mapped by its UTC"]


def test_after_each_contradiction_it_must_be_in_order_for_ten_seconds_again() -> None:
    common = Clock(5.0, known_s=5.0)
    common.run(1.0)
    for in_order_s in (5.0, 9.0, 12.0):
        common.each[0].own.why = "no fix"
        common.run(0.25)
        common.each[0].own.why = None
        found = [each is not None for each, _ in common.run(in_order_s)]
        assert found == [number >= 39 for number in range(round(4 * in_order_s))]


@pytest.mark.parametrize("member", [each for each in Member if each is not Member.FLYING])
def test_while_any_flies_in_formation_it_slews_for_all(member: Member) -> None:
    """Only what isn't in the formation may have its own stamps mapped by it at once."""
    common = Clock(5.0, 5.0, 5.0)
    common.each[0].member = common.each[1].member = member
    common.run(2.0)
    for each in common.each:
        each.own.middle_s = 5.107
    assert common.run(0.25) == [(pytest.approx(5.0025), math.inf)]
    assert common.each[2].round_trips.stamps.used[-1] == (pytest.approx(5.0025), pytest.approx(0.0025))


def test_utc_that_was_never_used_is_as_soon_as_it_is_in_order() -> None:
    common = Clock(5.0, known_s=5.0)
    common.each[0].own.why = "no fix"
    common.run(1.0)
    common.each[0].own.why = None
    assert common.run(0.25)[0][0] == 5.0


def test_a_jump_in_flight_is_reported() -> None:
    common = Clock(5.0, 5.0)
    common.run(1.0)
    common.each[1].round_trips.gnss.jump_s = -0.25
    common.run(1.0)
    assert common.logged.of("clock", 2)[1:] == ["its UTC jumped by -0.250 s in flight; its clock goes on as before"]


def test_without_clocks_by_utc_there_is_nothing_to_do() -> None:
    common = Clock(5.0)
    common.each[0].round_trips.gnss = None
    clock = CommonClock(common.cycle)
    clock.run(common.cycle)
    assert common.each[0].round_trips.stamps.used == []


def test_the_feature_is_this_stage() -> None:
    (stage,) = FEATURE.stages(Clock(5.0).cycle)
    assert isinstance(stage, CommonClock)
