"""Heights of a holding stack over the ground that is flown over until vehicles circle, and what the climb takes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.endpoint import VehicleId
from formation_scenario.orders import End
from gcs_formation.features.ending.holding_stack import (
    FlyingVehicle,
    HoldingStack,
    climbed_out,
    home_of,
    limit_of_climb_s,
    stacked,
    stays,
)
from gcs_formation.fleet.circle_heights import HighestGround
from gcs_formation.vehicle.reported_motion import ReportedMotion
from tests.gcs_formation.features.ending.test_holding_stack import GAP_M, at, deaf, heights, named, obeys

ONE, TWO = VehicleId(1, 1), VehicleId(1, 2)
CLIMB_MPS = 3.0
NORTHWARD_M = 10.0
"""How far the formation flies in a second."""


class Ground:
    """A ground that is high from a place on, and notes where it is asked for."""

    def __init__(self, from_m: float = math.inf, height_m: float = -math.inf) -> None:
        self.from_m, self.height_m = from_m, height_m
        self.circles, self.legs = list[tuple[float, float]](), list[tuple[tuple[float, float], tuple[float, float]]]()

    def highest(self, begins: Any) -> HighestGround:
        found = list(begins)
        self.circles += found
        return HighestGround(max((self._at(each) for each in found), default=-math.inf), 0.0, 0.0)

    def over_leg(self, begin_m: tuple[float, float], home_m: tuple[float, float]) -> float:
        self.legs.append((begin_m, home_m))
        return self._at(begin_m)

    def _at(self, place: tuple[float, float]) -> float:
        return self.height_m if place[0] >= self.from_m else -math.inf


def north(seconds: float) -> list[tuple[float, float]]:
    """Return the places that the formation passes, a second apart."""
    return [(NORTHWARD_M * each, 0.0) for each in range(1 + math.ceil(seconds))]


def raised(ground: Any, manner: End = "loiter", homes: Any = None, *heights_m: float) -> tuple[float, list[float]]:
    """Return the time limit of vehicles at heights, 100 m if not said, and the heights that they get after it."""
    motions = {VehicleId(1, number): at(height_m) for number, height_m in enumerate(heights_m or (100.0,), 1)}
    stack = HoldingStack(GAP_M, together=True)
    limit_s = stacked(motions, stack, ground, manner, north, CLIMB_MPS, homes or {})
    stack.add(motions)
    return limit_s, heights(stack)


@pytest.mark.parametrize(
    ("climb_m", "limit_s"), [(-10.0, 30.0), (0.0, 30.0), (45.0, 30.0), (48.0, 31.0), (300.0, 115.0)]
)
def test_a_climb_may_take_its_time_and_15_s_more_but_30_s_at_least(climb_m: float, limit_s: float) -> None:
    assert limit_of_climb_s(climb_m, CLIMB_MPS) == pytest.approx(limit_s)


@pytest.mark.parametrize(("from_m", "lifted"), [(300.0, True), (301.0, False)])
def test_ground_that_is_reached_within_the_time_limit_lifts_the_stack(from_m: float, lifted: bool) -> None:
    """30 s at 10 m/s are 300 m. The climb by 60 m then takes 35 s, in which higher ground at 350 m is reached."""
    assert raised(Ground(from_m, 160.0)) == ((35.0, [160.0]) if lifted else (30.0, [100.0]))


def test_a_longer_climb_is_checked_over_all_the_ground_that_it_leads_over() -> None:
    class Stairs(Ground):
        """Each 50 m the ground is 15 m higher."""

        def _at(self, place: tuple[float, float]) -> float:
            return 100.0 + 15.0 * (place[0] // 50.0) if place[0] <= 400.0 else 100.0

    limit_s, (height_m,) = raised(Stairs())
    assert height_m == 100.0 + 15.0 * 8
    assert limit_s == pytest.approx(120.0 / CLIMB_MPS + 15.0)


def test_each_place_ahead_is_asked_for_once_as_it_is_for_vehicles_that_stay() -> None:
    ground = Ground(300.0, 160.0)
    raised(ground)
    assert sorted(ground.circles) == [*north(35.0)]
    assert ground.legs == []
    assert stays(1e3) == ((0.0, 0.0),)


def test_the_way_home_begins_where_vehicles_leave_at_the_earliest() -> None:
    """Of 41 vehicles the highest climbs by 600 m: 215 s at most, so none leaves before 185 s have passed."""
    ground, home = Ground(), (-200.0, 70.0)
    limit_s, given_m = raised(ground, "rtl", {ONE: home}, *[100.0] * 41)
    assert (limit_s, max(given_m)) == (215.0, 700.0)
    own = [begin for begin, home_m in ground.legs if home_m == home]
    assert own == north(215.0)[185:]
    assert {home_m for _, home_m in ground.legs} == {home, (0.0, 0.0)}, "an unknown home is at the origin"
    assert len(ground.legs) == 41 * len(own)
    assert set(ground.circles) == set(north(215.0)[:185])


def test_ground_on_the_way_home_lifts_the_stack_and_may_do_so_again_later() -> None:
    assert raised(Ground(200.0, 160.0), "rtl") == (35.0, [160.0])
    assert raised(Ground(340.0, 160.0), "land") == (30.0, [100.0])


def test_places_are_those_of_each_vehicle() -> None:
    ground = Ground()
    floor: Any = ground
    motions = {ONE: at(100.0, 40.0), TWO: ReportedMotion(0.0, 7.0, -30.0, 100.0, 22.0, 0.0, 0.0, 100.0)}
    stacked(motions, HoldingStack(GAP_M), floor, "loiter", lambda _: [(0.0, 0.0), (5.0, 9.0)], CLIMB_MPS)
    assert sorted(ground.circles) == [(7.0, -30.0), (12.0, -21.0), (40.0, 0.0), (45.0, 9.0)]


def test_a_floor_is_only_raised() -> None:
    stack = HoldingStack(GAP_M, 50.0)
    assert not stack.raise_floor(50.0)
    assert stack.raise_floor(120.0)
    assert not stack.raise_floor(80.0)
    stack.add({ONE: at(100.0)})
    assert heights(stack) == [120.0]


def test_the_longest_climb_is_that_to_the_highest_level_less_the_present_height() -> None:
    stack = HoldingStack(GAP_M)
    assert stack.climb_m({}) == 0.0
    assert stack.climb_m({ONE: at(100.0), TWO: at(108.0)}) == 7.0
    assert stack.climb_m({ONE: at(100.0), TWO: at(100.0)}) == 15.0
    assert stack.heights_m == {}, "none is assigned"


def test_what_hovers_keeps_its_height_and_is_apart_at_any() -> None:
    stack, fliers = HoldingStack(GAP_M, hover=True), named(obeys(100.0, 100.0), obeys(100.0, 100.0))
    stack.assign(fliers)
    assert heights(stack) == [100.0, 100.0]
    assert stack.is_separated(fliers)


@pytest.mark.parametrize(("off_m", "apart"), [(0.5, True), (-0.5, True), (0.51, False), (-0.51, False)])
def test_a_setpoint_within_half_a_metre_of_a_level_is_sent_there(off_m: float, apart: bool) -> None:
    fliers = named(obeys(100.0, 100.0), obeys(115.0, 115.0 + off_m))
    stack = HoldingStack(GAP_M)
    stack.assign(fliers)
    assert stack.is_separated(fliers) is apart
    alone = named(obeys(100.0, 100.0 + 9.0 * off_m))
    stack.assign(alone)
    assert stack.is_separated(alone), "one alone need not be sent anywhere"


@pytest.mark.parametrize(("gap_m", "apart"), [(10.0, True), (9.99, False)])
@pytest.mark.parametrize("swapped", [False, True])
def test_exactly_the_distance_that_is_to_be_kept_is_enough(gap_m: float, apart: bool, swapped: bool) -> None:
    low, high = obeys(100.0, 100.0), obeys(100.0 + gap_m, 115.0)
    stack = HoldingStack(GAP_M)
    stack.assign(named(obeys(100.0), obeys(100.0)))
    fliers = {ONE: low, TWO: high}
    assert stack.is_separated(dict(reversed(fliers.items())) if swapped else fliers) is apart


def test_one_that_cannot_be_moved_is_in_the_way_within_15_m_of_where_it_may_be_on_both_sides() -> None:
    """It may be at 120 to 130 m; a vehicle at 105 m or 145 m keeps its height, one nearer climbs to 145 m."""
    for height_m, kept in ((105.0, True), (105.1, False), (144.9, False), (145.0, True)):
        stack = HoldingStack(GAP_M)
        stack.assign({ONE: obeys(height_m)})
        stack.assign({ONE: obeys(height_m), TWO: deaf(120.0, 130.0)})
        assert stack.heights_m[ONE] == (height_m if kept else 145.0)


def test_a_band_grows_by_all_heights_at_which_one_was_possible_since_it_was_lost() -> None:
    stack = HoldingStack(GAP_M)
    for low_m, high_m in ((100.0, 110.0), (95.0, 105.0), (98.0, 120.0)):
        stack.assign({ONE: FlyingVehicle(at(100.0), 100.0, (low_m, high_m)), TWO: obeys(200.0)})
    for height_m, level_m in ((80.0, 80.0), (80.1, 135.0), (134.0, 135.0)):
        stack.heights_m.pop(TWO)
        stack.assign({ONE: FlyingVehicle(at(100.0), 100.0, (100.0, 100.0)), TWO: obeys(height_m)})
        assert stack.heights_m[TWO] == level_m


@pytest.mark.parametrize("one", [ONE, TWO])
def test_vehicles_that_cannot_be_moved_count_where_they_go_though_they_are_far_away(one: VehicleId) -> None:
    stack, far, other = HoldingStack(GAP_M), obeys(102.0, 102.0, north_m=900.0), TWO if one == ONE else ONE
    stack.assign({one: obeys(100.0, 100.0), other: far})
    assert stack.is_separated({one: obeys(100.0, 100.0), other: far})
    lost = FlyingVehicle(at(102.0, 900.0), 102.0, (102.0, 102.0))
    for order in ((one, other), (other, one)):
        fliers = {one: obeys(100.0, 117.0), other: lost}
        stack.assign({one: obeys(100.0), other: lost})
        assert stack.heights_m[one] == 117.0
        assert not stack.is_separated({each: fliers[each] for each in order})
        fliers[one] = obeys(112.0, 117.0)
        assert stack.is_separated({each: fliers[each] for each in order})


def test_a_home_is_where_the_vehicle_says_or_else_where_it_stood() -> None:
    stood = SimpleNamespace(north_m=3.0, east_m=4.0)
    for reported, stands, home in (((1.0, 2.0), stood, (1.0, 2.0)), (None, stood, (3.0, 4.0)), (None, None, None)):
        vehicle: Any = SimpleNamespace(
            telemetry=SimpleNamespace(home_m=reported), take_off=SimpleNamespace(stood=stands)
        )
        assert home_of(vehicle) == home


def test_a_take_off_ends_over_its_place_at_its_height_above_home_with_the_velocity_that_it_has() -> None:
    vehicle: Any = SimpleNamespace(autopilot=SimpleNamespace(take_off_m=45.0))
    done = climbed_out(ReportedMotion(7.0, 1.0, 2.0, 80.0, 20.0, 3.0, 2.5, 12.0), vehicle)
    assert vars_of(done) == (7.0, 1.0, 2.0, 80.0 - 12.0 + 45.0, 20.0, 3.0, 2.5, 12.0)


def vars_of(motion: ReportedMotion) -> tuple[float, ...]:
    place = motion.stamp_s, motion.north_m, motion.east_m, motion.height_m
    return *place, motion.north_mps, motion.east_mps, motion.climb_mps, motion.above_home_m
