"""Paths with stops: speeds between corners and stops, corners as fast as they have room, and legs flown whole."""

import math

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from flight_model.legs.deviation import deviation
from flight_model.legs.heights import Climbs
from flight_model.legs.turn import STEEPEST, TurnLimits
from flight_model.stops.corners import SLOWEST_MPS, Corners
from flight_model.stops.pacing import Rates, attainable, between
from flight_model.stops.path import PathWithStops, StopPlan
from flight_model.stops.timetable import SETTLE_S, Passage, Timetable

RATES = Rates(1.25, 1.2)
ACCEL_MPS2 = 1.75
CLIMBS = Climbs(0.3, 0.02)
speeds = st.floats(0.5, 12.0)


def limits_at(speed_mps):
    """Return turns with a lateral acceleration of `ACCEL_MPS2`, which begin within 1.5 s."""
    curvature = ACCEL_MPS2 / speed_mps**2
    return TurnLimits(curvature, STEEPEST * curvature / (1.5 * speed_mps))


def planned(waypoints, speed_mps=5.0, stops=(), max_m=100.0):
    flat = np.array([complex(north, east) for north, east, _ in waypoints])
    legs_mps = [speed_mps] * (len(waypoints) - 1)
    passes = Corners(flat, legs_mps, limits_at, RATES, max_m).chosen(set(stops), set())
    plan = StopPlan(passes, [CLIMBS] * len(legs_mps), [limits_at(each) for each in legs_mps], max_m)
    return PathWithStops(waypoints, plan)


@given(st.lists(speeds, min_size=2, max_size=6), st.data())
def test_what_is_attainable_can_be_connected_and_is_never_faster_than_allowed(allowed, data):
    rooms = data.draw(st.lists(st.floats(0.0, 80.0), min_size=len(allowed) - 1, max_size=len(allowed) - 1))
    found = attainable(allowed, rooms, RATES)
    assert all(a <= b + 1e-9 for a, b in zip(found[1:], allowed[1:], strict=True))
    for at in range(1, len(rooms)):
        assert RATES.length_m(found[at], found[at + 1]) <= rooms[at] + 1e-6
        cruise = between(found[at], found[at + 1], 15.0, rooms[at], RATES)
        needs = RATES.length_m(found[at], cruise) + RATES.length_m(cruise, found[at + 1])
        assert cruise == max(found[at], found[at + 1]) or needs == pytest.approx(min(needs, rooms[at]), abs=1e-6)


@settings(max_examples=25, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.lists(st.tuples(st.floats(15.0, 120.0), st.floats(0.0, 12.0), st.booleans()), max_size=5), speeds)
def test_a_timetable_is_smooth_bounded_and_stops_where_it_is_to(nodes, speed_mps):
    passages, at_m = [], 0.0
    for room_m, max_mps, stops in nodes:
        at_m += room_m
        long_m = 0.0 if stops else 8.0
        corner_mps = 0.0 if stops else max(max_mps, SLOWEST_MPS)
        passages.append(Passage(at_m, at_m + long_m, corner_mps, 3.0 if stops else 0.0))
        at_m += long_m
    # The first straight may be too short to brake on: that is the scenario's to avoid.
    first_m = 2.0 * RATES.length_m(speed_mps, 0.0)
    passages = [each._replace(begin_m=each.begin_m + first_m, end_m=each.end_m + first_m) for each in passages]
    table = Timetable(speed_mps, [speed_mps] * (len(passages) + 1), passages, at_m + first_m + 60.0, RATES)
    times = np.linspace(-1.0, table.end_s + 1.0, 1500)
    distance, speed, accel = np.array([table.after(each) for each in times.tolist()]).T
    step_s = times[1] - times[0]
    assert np.diff(distance).min() >= -1e-9
    assert speed.max() <= speed_mps + 1e-9
    assert np.abs(accel).max() <= RATES.accel_mps2 + 1e-6
    assert np.abs(np.diff(speed)).max() <= RATES.accel_mps2 * step_s + 1e-6
    assert np.diff(distance) == pytest.approx((speed[1:] + speed[:-1]) / 2.0 * step_s, abs=RATES.accel_mps2 * step_s**2)
    for pause in table.pauses:
        assert pause.end_s - pause.begin_s == pytest.approx(SETTLE_S + 3.0)
        middle = table.after((pause.begin_s + pause.end_s) / 2.0)
        assert middle == pytest.approx((pause.passage.begin_m, 0.0, 0.0), abs=1e-6)
        assert table.when_s(pause.passage.begin_m) == pytest.approx(pause.begin_s, abs=1e-3)
    for each, flown_mps in table.flown:
        assert each.stops or flown_mps <= each.max_mps
    some = np.linspace(1.0, table.end_s - 1.0, 50)
    moving = [each for each in some.tolist() if table.after(each)[1] > 0.1]
    assert [table.when_s(table.after(each)[0]) for each in moving] == pytest.approx(moving, abs=1e-3)


def lanes(spacing_m, count=4, length_m=200.0):
    ends = [[0.0, length_m], [length_m, 0.0]]
    return [[north, lane * spacing_m, 30.0] for lane in range(count) for north in ends[lane % 2]]


@pytest.mark.parametrize("spacing_m", [1.5, 10.0, 20.0, 40.0])
@pytest.mark.parametrize("speed_mps", [5.0, 10.0])
def test_lanes_however_near_are_flown_whole_without_a_loop(spacing_m, speed_mps):
    waypoints = lanes(spacing_m)
    path = planned(waypoints, speed_mps)
    assert deviation(path, waypoints).off_legs_m < 8.0
    assert path.length_m <= 4 * 200.0 + 3 * spacing_m + 1e-6
    stopped = [each for each in path.passed if each.kind == "stop"]
    if spacing_m < 5.0:
        assert len(stopped) == 6
        assert deviation(path, waypoints).off_legs_m < 1e-6
        assert [each.by_rad for each in path.turns_in_place] == pytest.approx(
            [math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, math.pi / 2, math.pi / 2]
        )


def test_the_radius_of_a_corner_follows_from_its_speed_and_the_acceleration():
    for speed_mps in (3.0, 5.0, 8.0):
        path = planned([[0, 0, 30], [400, 0, 30], [400, 400, 30]], speed_mps)
        assert path.tightest_m == pytest.approx(speed_mps**2 / ACCEL_MPS2)


def test_a_corner_between_short_legs_is_slower_and_one_too_sharp_is_a_stop():
    roomy, short = ([[0, 0, 30], [leg, 0, 30], [leg, leg, 30]] for leg in (200, 30))
    fast, slow = (planned(each, 8.0).passes[0].speed_mps for each in (roomy, short))
    assert fast == 8.0
    assert SLOWEST_MPS <= slow < 8.0
    (back,) = planned([[0, 0, 30], [200, 0, 30], [20, 10, 30]], 5.0, max_m=5.0).passed
    assert back.kind == "stop"


def test_a_path_passes_its_stops_exactly_and_its_course_jumps_there():
    path = planned([[0, 0, 30], [100, 0, 30], [100, 80, 40], [0, 80, 40]], stops=[1])
    (turn,) = path.turns_in_place
    assert turn == pytest.approx((100.0, 0.0, math.pi / 2))
    before, after = path.at(100.0 - 1e-9), path.at(100.0)
    assert (before.north_m, before.east_m, before.course_rad) == pytest.approx((100.0, 0.0, 0.0), abs=1e-6)
    assert (after.north_m, after.east_m, after.course_rad) == pytest.approx((100.0, 0.0, math.pi / 2), abs=1e-6)
    assert path.waypoints_at_m[1] == pytest.approx(100.0)
    assert [each.kind for each in path.passed] == ["stop", "turn"]
    assert deviation(path, [[0, 0, 30], [100, 0, 30], [100, 80, 40], [0, 80, 40]]).outside_heights_m < 1e-6


def test_another_speed_keeps_stops_and_corners():
    passages = [Passage(100.0, 110.0, 3.0), Passage(200.0, 200.0, 0.0, 5.0)]
    table = Timetable(6.0, [6.0] * 3, passages, 300.0, RATES)
    slower, faster = table.at_speed(2.0), table.at_speed(8.0)
    assert slower.end_s > table.end_s > faster.end_s
    assert [speed for _, speed in slower.flown] == [2.0, 0.0]
    assert [speed for _, speed in faster.flown] == [3.0, 0.0]
    assert slower.pauses[0].end_s - slower.pauses[0].begin_s == pytest.approx(SETTLE_S + 5.0)
