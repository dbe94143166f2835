"""Predicted ways and how near they come: closed forms, symmetry, and limits from both of their sides."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.arrays import Array
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from gcs_formation.features.separation.approach import (
    CarriedOn,
    Manoeuvre,
    MinimumDistance,
    approach,
    fly,
    fly_level,
    may_come_near,
    reach_m,
)
from gcs_formation.features.separation.broad_phase import BroadPhase
from gcs_formation.features.separation.traffic import TrafficPicture, bound, courses, free_heights, take_height
from tests.gcs_formation import tables
from tests.gcs_formation.features.separation.encounters import MODEL, Vehicles, model, picture, wanted
from tests.gcs_formation.features.separation.test_reach import random_scene, wanted_by_all

TIMES_S = np.array((0.0, 0.5, 1.5, 3.5))
NORTH: list[float] = [0, 0, 100, 22, 0, 0]


def straight(begin_m: tuple[float, ...], mps: tuple[float, ...]) -> Array:
    """Return the positions of one vehicle that flies straight on, (3, S, 1)."""
    return (np.array(begin_m)[:, None] + np.array(mps)[:, None] * TIMES_S)[:, :, None]


def kept(distance_m: float, timing_s: float = 0.0) -> MinimumDistance:
    return MinimumDistance(np.array([distance_m]), np.array([timing_s]))


def scene(*rows: list[float], **changed: Any) -> TrafficPicture:
    vehicles = Vehicles(list(rows))
    return replace(picture(vehicles, vehicles.state, wanted(vehicles, 0.0)), **changed)


def test_two_that_pass_are_nearest_at_the_foot_of_the_perpendicular_between_samples() -> None:
    """At 5 m/s, 10 m ahead and 3 m sideways: 3 m after 2 s; the samples at 1.5 s and 3.5 s are 3.9 m and 8.1 m apart.

    10 m are undercut by 7 m in the step from 1.5 s to 3.5 s, and by 10 - hypot(2.5, 3) m for 1 s before that.
    """
    ours, theirs = straight((0.0, 0.0, 0.0), (5.0, 0.0, 0.0)), straight((10.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    near = approach(ours, theirs, kept(10.0), TIMES_S)
    assert (near.nearest_m[0], near.in_s[0]) == pytest.approx((3.0, 2.0))
    first_m = 10.0 - math.hypot(7.5, 3.0)
    assert near.deficit_m_s[0] == pytest.approx(2.0 * 7.0 + 10.0 - math.hypot(2.5, 3.0) + 0.5 * first_m)
    assert approach(ours, theirs, kept(2.9), TIMES_S).deficit_m_s[0] == 0.0
    assert approach(ours, theirs, kept(1.0, 0.41), TIMES_S).deficit_m_s[0] == pytest.approx(2.0 * 0.05)


@given(st.lists(st.floats(-50.0, 50.0), min_size=12, max_size=12), st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_an_approach_is_the_same_for_both_and_wherever_and_however_they_are_turned(
    values: list[float], turn_rad: float
) -> None:
    one, other = straight(tuple(values[:3]), tuple(values[3:6])), straight(tuple(values[6:9]), tuple(values[9:]))
    near = approach(one, other, kept(20.0, 0.1), TIMES_S)
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    moved = [np.einsum("ij,jsp->isp", turn, each) + 7.0 for each in (other, one)]
    again = approach(moved[0], moved[1], kept(20.0, 0.1), TIMES_S)
    assert again.nearest_m == pytest.approx(near.nearest_m, abs=1e-6)
    assert again.deficit_m_s == pytest.approx(near.deficit_m_s, abs=1e-6)
    fine = np.linalg.norm(
        [np.interp(np.linspace(0.0, 3.5, 800), TIMES_S, each) for each in (other - one)[:, :, 0]], axis=0
    )
    assert near.nearest_m[0] == pytest.approx(fine.min(), abs=0.5)
    assert near.nearest_m[0] <= fine.min() + 1e-9


def test_a_share_of_a_distance_is_that_of_its_room_for_timing_too() -> None:
    assert kept(10.0, 0.5).times(1.1) == (pytest.approx([11.0]), pytest.approx([0.55]))


@pytest.mark.parametrize(("east_m", "near"), [(9.9, True), (10.1, False), (-9.9, True), (-10.1, False)])
@pytest.mark.parametrize("along", [0, 1])
def test_ways_beside_each_other_come_near_within_the_distance(east_m: float, near: bool, along: int) -> None:
    """Both move by 3 m/s along either axis: boxes overlap that way, and are as far apart as the ways the other."""
    ours, theirs = np.zeros((2, 4, 1)), np.zeros((2, 4, 1))
    ours[along, :, 0] = theirs[along, :, 0] = 3.0 * TIMES_S
    theirs[1 - along] += east_m
    assert may_come_near(ours, theirs, kept(10.0), TIMES_S).tolist() == [near]
    assert may_come_near(theirs, ours, kept(4.0, 1.0), TIMES_S).tolist() == [near], "6 m/s of both, at most, for 1 s"


def flown(hovers: bool = False, **changed: Any) -> Array:
    """Return a fixed wing's or multirotor's way, (3, S); 4 m/s of wind from the north and the west."""
    row = np.array(
        [[10.0], [20.0], [100.0], [0.0], [20.0], [0.0], [0.0 if hovers else -4.0], [0.0 if hovers else 4.0], [0.0]]
    )
    made = scene(NORTH)
    traffic = replace(
        made.traffic, state=FlightStates.of(row), hovers=hovers, lead_s=np.array([changed.get("lead_s", 0.0)])
    )
    traffic = replace(traffic, turn_rps=np.array([changed.get("turn_rps", 0.0)]))
    to = [np.array([each]) for each in changed.get("to", (20.0, 0.0, 100.0))]
    then = [np.array([each]) for each in changed.get("then", changed.get("to", (20.0, 0.0, 100.0)))]
    trails = np.array([changed.get("trails_m", 0.0)])
    times_s = np.array(changed.get("times_s", TIMES_S))
    level = fly_level(traffic, Manoeuvre(Setpoints(*to), *then), times_s)
    every = fly(traffic, Manoeuvre(Setpoints(*to), *then), times_s, trails)
    np.testing.assert_array_equal(every[:2], level)
    return every[:, :, 0]


def test_one_that_flies_on_moves_by_its_velocity_and_the_wind() -> None:
    """Also with setpoints that aren't known: NaN continues as it flies."""
    unknown = math.nan, math.nan, math.nan
    for to in ((20.0, 0.0, 100.0), unknown):
        way = flown(to=to, lead_s=0.25)
        np.testing.assert_allclose(way[0], 10.0 + 16.0 * (TIMES_S + 0.25))
        np.testing.assert_allclose(way[1], 20.0 + 4.0 * (TIMES_S + 0.25))
        np.testing.assert_allclose(way[2], 100.0)


def test_one_that_turns_steadily_flies_a_circle() -> None:
    """Of 80 m at 0.25 rad/s and 20 m/s, less the wind; by steps of 0.05 s to a centimetre."""
    times_s = np.linspace(0.0, 6.0, 121)
    way = flown(turn_rps=0.25, to=(20.0, math.nan, 100.0), times_s=times_s)
    np.testing.assert_allclose(way[0], 10.0 + 80.0 * np.sin(0.25 * times_s) - 4.0 * times_s, atol=0.02)
    np.testing.assert_allclose(way[1], 20.0 + 80.0 * (1.0 - np.cos(0.25 * times_s)) + 4.0 * times_s, atol=0.02)


def test_a_change_of_speed_lags_and_the_lasting_setpoint_follows_the_first() -> None:
    """Towards 22 m/s with 4 s: 2 (t - 4 (1 - e^(-t / 4))) m are gained; back from 0.5 s on, what was gained decays."""
    times_s = np.linspace(0.0, 8.0, 161)
    gained = flown(to=(22.0, 0.0, 100.0), times_s=times_s)[0] - 10.0 - 16.0 * times_s
    np.testing.assert_allclose(gained, 2.0 * (times_s - 4.0 * (1.0 - np.exp(-times_s / 4.0))), atol=0.01)
    times_s = np.concatenate(([0.0], np.linspace(0.5, 8.5, 161)))
    back = flown(to=(22.0, 0.0, 100.0), then=(20.0, 0.0, 100.0), times_s=times_s)[0] - 10.0 - 16.0 * times_s
    rest_mps, begun_m = 2.0 * (1.0 - math.exp(-0.125)), 2.0 * (0.5 - 4.0 * (1.0 - math.exp(-0.125)))
    np.testing.assert_allclose(
        back[1:], begun_m + rest_mps * 4.0 * (1.0 - np.exp(-(times_s[1:] - 0.5) / 4.0)), atol=0.01
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("trails_m", [0.0, 3.0])
def test_heights_are_reached_within_the_climb_limit_and_with_what_trails_behind(sign: float, trails_m: float) -> None:
    times_s = np.concatenate(([0.0], np.arange(0.5, 60.0, 0.5)))
    to = 20.0, 0.0, 100.0
    heights_m = flown(to=to, then=(20.0, 0.0, 100.0 + 60.0 * sign), times_s=times_s, trails_m=trails_m)[2]
    assert heights_m[-1] == pytest.approx(100.0 + 60.0 * sign - trails_m, abs=0.05)
    rates = np.diff(heights_m) / np.diff(times_s)
    assert np.abs(rates).max() <= 3.0 + 1e-6
    assert np.abs(rates).max() > 2.8, "its limit is nearly used"
    assert (sign * np.diff(heights_m[10:]) >= -0.01).all()


def test_a_height_setpoint_is_in_reach_that_the_climb_limit_attains_within_the_time_constants() -> None:
    """3 m/s and 1 s + 3 s: 12 m to both sides."""
    assert reach_m(model(2)).tolist() == [12.0, 12.0]
    made = scene(NORTH)
    first = take_height(made, 0, np.array((150.0, 111.0, 30.0)))
    assert first.first.height_m.reshape(3, -1)[:, 0].tolist() == [112.0, 111.0, 88.0]
    assert first.height_m.reshape(3, -1)[:, 0].tolist() == [150.0, 111.0, 30.0]


def test_an_acceleration_that_fades_adds_half_of_what_it_would_hold() -> None:
    """3 m/s² north more than wanted takes 0.6 s at 5 m/s³: 0.9 m/s in all; half way a quarter of it is left.

    What is left makes 0.9 * 0.6 / 3 = 0.18 m in all, and by half way 7/8 of that.
    """
    models = AutopilotModels(
        *(np.array([value]) for value in (MODEL | {"tau_v_s": 2.0, "accel_max_mps2": 2.0}).values())
    )
    on = CarriedOn.of(np.array([[4.0], [0.0]]), np.zeros((2, 1)), np.array([[2.0], [0.0]]), models)
    assert on.change_mps2[:, 0] == pytest.approx([3.0, 0.0])
    assert on.lasts_s == pytest.approx([0.6])
    assert on.all_mps[:, 0] == pytest.approx([0.9, 0.0])
    assert on.left_mps(np.array([[0.0], [0.3], [0.6], [9.0]]))[0, :, 0] == pytest.approx([0.9, 0.225, 0.0, 0.0])
    assert [on.behind_m(np.array([at_s]))[0, 0] for at_s in (0.0, 0.3, 0.6, 9.0)] == pytest.approx(
        [0.0, 0.1575, 0.18, 0.18]
    )
    limited = CarriedOn.of(np.zeros((2, 1)), np.zeros((2, 1)), np.array([[30.0], [-40.0]]), models)
    assert limited.change_mps2[:, 0] == pytest.approx([-1.2, 1.6]), "2 m/s² of the limit, in the error's direction"


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.sampled_from((0.0, 0.01, 0.3, 1.0)), st.booleans())
def test_both_tests_have_the_same_bounds(seed: int, count: int, unlike: float, hovers: bool) -> None:
    """On plain numbers and on arrays: where each may be, how far from there, and how fast."""
    made = random_scene(seed, count, 100.0, unlike, hovers=hovers)
    made = replace(made, commanded=np.ones(count, dtype=bool), setpoints=wanted_by_all(made))
    states, setpoints = tables.states(made.traffic.state), tables.setpoints(made.setpoints)
    look = BroadPhase(tables.models(made.traffic.model), float(made.times_s[1]), float(made.times_s[-1]), hovers=hovers)
    look.begin_test(states[0], setpoints[0][0], setpoints[0][1])
    accel = np.hypot(*made.traffic.accel_mps2).tolist()
    for at, (state, (mps, rad, _)) in enumerate(zip(states, setpoints, strict=True)):
        look.see(at, state, (0.0, 0.0, 0.0), mps, rad, float(made.traffic.lead_s[at]), 0.1, accel[at])
    bounds, seen = bound(made), look._vehicles
    np.testing.assert_allclose([each.far_m for each in seen], bounds.far_m, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose([each.fast_mps for each in seen], bounds.fast_mps, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose([(each.north_m, each.east_m) for each in seen], bounds.position_m.T, atol=1e-9)


def test_bounds_of_an_error_of_speed_by_hand() -> None:
    """The second is 1 m/s slower: 1 (0.3 + 4 + 0.5) + 1 / (2 * 1.5) m, until its speed is that of the reference.

    Its own setpoint, 1.5 m/s off, adds up to 1.5 / 4 * 0.3 m/s to that error: 1.1125 m/s.
    """
    made = scene(NORTH, [0, 50, 100, 21, 0, 0])
    same = replace(made, setpoints=Setpoints(np.array((22.0, 21.0)), np.zeros(2), np.full(2, 100.0)))
    off = replace(made, setpoints=Setpoints(np.array((22.0, 22.5)), np.zeros(2), np.full(2, 100.0)))
    for each, error in ((same, 1.0), (off, 1.1125)):
        bounds = bound(each)
        assert bounds.fast_mps == pytest.approx([0.0, error])
        assert bounds.far_m == pytest.approx([0.0, error * 4.8 + error * error / 3.0])


def test_a_manoeuvre_has_a_first_and_a_lasting_setpoint() -> None:
    first = Setpoints(np.array((20.0, 21.0)), np.array((0.1, 0.2)), np.array((90.0, 91.0)))
    made = Manoeuvre(first, np.array((22.0, 23.0)), np.array((0.3, 0.4)), np.array((92.0, 93.0)))
    assert made.first.table.tolist() == first.table.tolist()
    assert (made.speed_mps.tolist(), made.heading_rad.tolist()) == ([22.0, 23.0], [0.3, 0.4])
    assert (made.air_motion.tolist(), made.height_m.tolist()) == ([[22.0, 23.0], [0.3, 0.4]], [92.0, 93.0])


def test_a_fixed_wing_has_four_courses_and_a_multirotor_may_stop_or_evade_in_eight_directions() -> None:
    """As commanded, then along the reference or straight on; along it or straight on at once."""
    made = scene(NORTH, [0, 50, 100, 24, 0.5, 0])
    made = replace(made, setpoints=Setpoints(np.array((23.0, 25.0)), np.array((0.1, 0.6)), np.full(2, 100.0)))
    on = math.nan, math.nan
    expected = [((25.0, 0.6), (22.0, 0.0)), ((25.0, 0.6), on), ((22.0, 0.0), (22.0, 0.0)), ((24.0, 0.5), on)]
    np.testing.assert_allclose(courses(made, 1), expected)
    hovers = courses(replace(made, traffic=replace(made.traffic, hovers=True)), 1)
    assert len(hovers) == 13
    np.testing.assert_allclose(hovers[3], [(0.0, 0.1)] * 2)
    np.testing.assert_allclose(hovers[4], ((24.0, 0.5), on))
    evades = [first for first, then in hovers[5:] if first == then]
    degrees = [math.degrees(rad - 0.1) for _, rad in evades]
    assert degrees == pytest.approx([90, -90, 135, -135, 180, 45, -45, 0])
    assert {mps for mps, _ in evades} == {28.0}


@pytest.mark.parametrize(("lasted_s", "farther_m"), [(8.0, 0.0), (12.0, 1.0), (47.0, 9.75), (48.0, 10.0), (90.0, 10.0)])
def test_a_margin_grows_by_a_metre_in_four_seconds_after_eight(lasted_s: float, farther_m: float) -> None:
    made = scene(NORTH, NORTH, manoeuvring_s=np.array((0.0, lasted_s)))
    assert (made.farther_m(0), made.farther_m(1)) == (0.0, farther_m)
    assert scene(NORTH).farther_m(0) == 0.0
    heights_m = free_heights(made, 1, np.array([0]), np.array([100.0]), 1.0)
    assert heights_m.tolist() == pytest.approx([111.0 + farther_m, 89.0 - farther_m])


def test_heights_trail_behind_a_climbing_reference_by_the_difference_of_their_time_constants() -> None:
    """4 s and 6 s at 2 m/s: 4 m. Not while it avoids another, nor behind one that isn't commanded."""
    made = scene(NORTH, NORTH)
    made.traffic.state.climb_mps[:] = 2.0, 1.0
    made.traffic.model.tau_hb_s[1] = 5.0
    assert made.trails_m.tolist() == [0.0, 4.0]
    assert replace(made, evades=True).trails_m.tolist() == [0.0, 0.0]
    assert replace(made, commanded=np.array((False, True))).trails_m.tolist() == [0.0, 0.0]
    assert replace(made, commanded=np.array((True, False))).trails_m.tolist() == [0.0, 0.0]
