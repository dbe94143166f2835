"""Vertical spreading at the end of a flight: heights, and when it no longer matters whether all vehicles hear."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.endpoint import VehicleId
from gcs_formation.features.ending.holding_stack import FlyingVehicle, HoldingStack
from gcs_formation.fleet.circle_heights import STACK_M, Band, loiter_heights, may_meet
from gcs_formation.vehicle.reported_motion import ReportedMotion

GAP_M = 10.0


def at(height_m: float, north_m: float = 0.0) -> ReportedMotion:
    return ReportedMotion(0.0, north_m, 0.0, height_m, 22.0, 0.0, 0.0, height_m)


def obeys(height_m: float, commanded_m: float = 100.0, north_m: float = 0.0) -> FlyingVehicle:
    return FlyingVehicle(at(height_m, north_m), commanded_m, steered=True)


def deaf(height_m: float, commanded_m: float) -> FlyingVehicle:
    return FlyingVehicle(at(height_m), commanded_m, (min(height_m, commanded_m), max(height_m, commanded_m)))


def named(*fliers: FlyingVehicle) -> dict[VehicleId, FlyingVehicle]:
    return {VehicleId(1, number): flier for number, flier in enumerate(fliers, 1)}


def heights(stack: HoldingStack) -> list[float]:
    return [stack.heights_m[each] for each in sorted(stack.heights_m)]


def test_everyone_gets_a_height_of_their_own_and_those_out_of_reach_may_share_one() -> None:
    stack = HoldingStack(GAP_M)
    stack.assign(named(obeys(100.0), obeys(100.0, north_m=30.0), obeys(100.0, north_m=500.0), obeys(90.0)))
    assert heights(stack) == [105.0, 120.0, 100.0, 90.0]


def test_where_more_than_15_m_are_to_be_kept_circles_are_5_m_farther_apart_than_that() -> None:
    stack = HoldingStack(20.0)
    stack.assign(named(obeys(100.0), obeys(100.0)))
    assert heights(stack) == [100.0, 125.0]


def test_in_air_that_moves_them_circles_are_four_standard_deviations_of_their_distance_farther_apart() -> None:
    stack = HoldingStack(GAP_M, sway_m=3.0)
    stack.assign(named(obeys(100.0), obeys(100.0)))
    assert heights(stack) == pytest.approx([100.0, 110.0 + 4.0 * math.hypot(3.0, 3.0)])
    calm = HoldingStack(GAP_M, sway_m=0.5)
    calm.assign(named(obeys(100.0), obeys(100.0)))
    assert heights(calm) == [100.0, 115.0]


def test_all_heights_between_which_one_that_receives_nothing_may_be_are_left_to_it() -> None:
    """It flies at 100 m, or at the 112 m that it was commanded when it may no longer have received."""
    stack = HoldingStack(GAP_M)
    stack.assign(named(deaf(100.0, 112.0), obeys(95.0), obeys(100.0)))
    assert heights(stack) == [112.0, 127.0, 142.0]


def test_others_make_room_for_one_that_stops_receiving_and_nothing_changes_when_that_is_over() -> None:
    stack = HoldingStack(GAP_M)
    stack.assign(named(obeys(100.0), obeys(100.0), obeys(100.0)))
    assert heights(stack) == [100.0, 115.0, 130.0]
    stack.assign(named(obeys(100.0), obeys(108.0), deaf(108.0, 120.0)))
    assert heights(stack) == [135.0, 150.0, 120.0]
    stack.assign(named(obeys(101.0), obeys(110.0), obeys(108.0)))
    assert heights(stack) == [135.0, 150.0, 120.0]


def test_who_is_clear_of_one_that_receives_nothing_keeps_a_height() -> None:
    stack = HoldingStack(GAP_M)
    stack.assign(named(obeys(100.0), obeys(100.0), obeys(100.0)))
    stack.assign(named(obeys(100.0), obeys(114.0), deaf(124.0, 130.0)))
    assert heights(stack) == [100.0, 145.0, 130.0]


ONE, TWO, THREE = (VehicleId(1, number) for number in (1, 2, 3))


def test_one_that_follows_again_climbs_above_those_that_land_before_it() -> None:
    """It was passed over: left at 98 m, it would circle lowest, and none could land."""
    stack = HoldingStack(GAP_M, together=True, first={THREE: frozenset({ONE}), TWO: frozenset({ONE})})
    stack.assign(named(obeys(100.0), obeys(100.0), obeys(90.0)))
    assert heights(stack) == [100.0, 130.0, 115.0]
    assert stack.assign(named(obeys(100.0), obeys(108.0), deaf(94.0, 98.0)))
    assert heights(stack) == [113.0, 130.0, 98.0]
    assert stack.assign(named(obeys(101.0), obeys(110.0), obeys(95.0)))
    assert heights(stack) == [113.0, 130.0, 145.0]
    assert not stack.assign(named(obeys(103.0), obeys(112.0), obeys(97.0)))


def test_two_that_follow_again_at_one_height_are_separated() -> None:
    stack = HoldingStack(GAP_M)
    stack.assign(named(deaf(100.0, 100.0), deaf(100.0, 100.0)))
    assert heights(stack) == [100.0, 100.0]
    for _ in range(2):
        stack.assign(named(obeys(100.0), obeys(100.0)))
    assert sorted(heights(stack)) == [100.0, 115.0]


def test_those_that_land_after_one_that_must_climb_higher_stay_above_it() -> None:
    stack = HoldingStack(GAP_M, together=True, first={TWO: frozenset({ONE}), THREE: frozenset({TWO})})
    stack.assign(named(obeys(100.0), obeys(100.0), obeys(100.0)))
    assert heights(stack) == [100.0, 115.0, 130.0]
    stack.assign(named(deaf(104.0, 104.0), obeys(100.0), obeys(112.0)))
    assert heights(stack) == [104.0, 119.0, 134.0]


def test_one_that_comes_late_circles_above_those_that_land_before_it() -> None:
    stack = HoldingStack(GAP_M, together=True, first={TWO: frozenset({ONE})})
    stack.assign(named(obeys(100.0)))
    stack.add({TWO: at(50.0)})
    assert heights(stack) == [100.0, 115.0]


@pytest.mark.parametrize(
    ("fliers", "apart"),
    [
        ((obeys(100.0, 100.0), obeys(111.0, 115.0)), True),
        ((obeys(100.0, 100.0), obeys(109.0, 115.0)), False),
        ((obeys(100.0, 100.0), obeys(111.0, 113.0)), False),
        ((obeys(100.0, 100.0), obeys(100.0, 100.0, north_m=500.0)), True),
        ((obeys(100.0, 100.0), obeys(116.0, 115.0, north_m=500.0)), False),
        ((deaf(100.0, 105.0), obeys(116.0, 120.0)), True),
        ((deaf(100.0, 107.0), obeys(116.0, 122.0)), False),
        ((obeys(100.0, 100.0),), True),
        ((deaf(100.0, 100.0), deaf(101.0, 101.0)), True),
    ],
    ids=[
        "clear",
        "still too near",
        "told another height last",
        "out of reach",
        "out of reach, told another height",
        "clear of a deaf one",
        "not of where it may climb to",
        "alone",
        "nobody can be moved",
    ],
)
def test_they_may_circle_once_it_no_longer_matters_who_receives(fliers: tuple[FlyingVehicle, ...], apart: bool) -> None:
    stack = HoldingStack(GAP_M)
    stack.assign(named(*fliers))
    assert stack.is_separated(named(*fliers)) is apart


def test_circles_at_one_place_are_all_apart() -> None:
    stack = HoldingStack(GAP_M, 150.0, together=True)
    fliers = named(obeys(100.0), obeys(100.0, north_m=1000.0))
    stack.assign(fliers)
    assert heights(stack) == [150.0, 165.0]
    assert not stack.is_separated(fliers)
    for height_m, apart in ((159.9, False), (160.0, True)):
        sent = named(obeys(150.0, 150.0), obeys(height_m, 165.0, north_m=1000.0))
        assert stack.is_separated(sent) is apart, "they are far from one another only now"


PLACES = st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 900.0))
BANDS = st.tuples(st.floats(0.0, 90.0), st.floats(0.0, 30.0)).map(lambda each: (each[0], each[0] + each[1]))


STEPS = st.lists(st.tuples(st.floats(0.0, 60.0), st.booleans()), min_size=4, max_size=4)
"""Heights of four vehicles in metres, and whether each can be moved."""


@given(st.lists(STEPS, min_size=1, max_size=6), st.permutations(range(4)))
def test_whoever_lands_before_others_is_lower_once_all_follow(
    steps: list[list[tuple[float, bool]]], order: list[int]
) -> None:
    """Whoever could not be moved meanwhile; none is sent below its present height, and nothing changes after that."""
    who = [VehicleId(1, number) for number in range(1, 5)]
    first = {who[order[each]]: frozenset(who[one] for one in order[:each]) for each in range(1, 4)}
    stack = HoldingStack(GAP_M, together=True, first=first)
    for step in [*steps, [(height_m, True) for height_m, _ in steps[-1]]]:
        fliers = named(*(obeys(height_m) if moves else deaf(height_m, height_m) for height_m, moves in step))
        before_m = dict(stack.heights_m)
        stack.assign(fliers)
        for identity, height_m in stack.heights_m.items():
            assert height_m == before_m.get(identity) or height_m >= fliers[identity].motion.height_m
    for _ in who:
        stack.assign(fliers)
    given_m = [stack.heights_m[who[each]] for each in order]
    assert all(above_m - below_m > STACK_M - 1e-9 for below_m, above_m in pairwise(given_m))
    assert not stack.assign(fliers)


@given(st.lists(PLACES, min_size=1, max_size=8), st.lists(BANDS, max_size=4), st.floats(-50.0, 80.0))
def test_heights_are_free_and_none_sinks(drawn: list[tuple[float, float]], taken: list[Band], floor_m: float) -> None:
    places = {VehicleId(1, number): at(*place) for number, place in enumerate(drawn, 1)}
    found = loiter_heights(places, floor_m, taken)
    for identity, height_m in found.items():
        assert height_m >= max(places[identity].height_m, floor_m)
        assert all(height_m <= low_m - STACK_M or height_m >= high_m + STACK_M for low_m, high_m in taken)
    for one, other in combinations(places, 2):
        if may_meet(places[one], places[other]):
            assert abs(found[one] - found[other]) > STACK_M - 1e-9
