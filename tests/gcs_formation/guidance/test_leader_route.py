"""The leader's route to its path and back to it, and its speed along it: the limits by which it decides, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import NANOSECONDS, Instant, after
from flight_model.autopilot_model import AutopilotModel
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.legs.speeds import Change, SpeedProfile
from flight_model.spline import SplinePath
from gcs_formation.guidance.join_route import JoinRoute, join
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.guidance.tracking import height_setpoint_m

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
HOVERING = AutopilotModel(0.6, 0.6, 0.3, 0.3, 0.0, 9.0, 2.5, 0.5, 1.5)
SPEED, RADIUS_M, COURSE = 22.0, 220.0, 2.2
START_M = (400.0, -300.0)
NOW = Instant(5 * NANOSECONDS)


def guidance(**keys: Any) -> LeaderGuidance:
    """Return the guidance along 4 km to the south-east; turns before it have a radius of 220 m."""
    end = START_M[0] + 4000.0 * math.cos(COURSE), START_M[1] + 4000.0 * math.sin(COURSE)
    path = SplinePath([[*START_M, 100.0], [*end, 100.0]])
    plain = {"speed_mps": SPEED, "run_in_m": 300.0, "hold_speed_mps": SPEED, "hold_turn_rps": 0.1, "climb_max_mps": 3.0}
    return LeaderGuidance(path, **(plain | keys))


def at(along_m: float, right_m: float = 0.0, off_deg: float = 0.0, height_m: float = 100.0) -> FlightState:
    """Return a leader by its place along the path and to its right, and how far to the right of it it heads."""
    cos, sin = math.cos(COURSE), math.sin(COURSE)
    north_m, east_m = START_M[0] + along_m * cos - right_m * sin, START_M[1] + along_m * sin + right_m * cos
    return FlightState(north_m, east_m, height_m, 0.0, SPEED, COURSE + math.radians(off_deg), 0.0, 0.0)


def along_m(point: PathPoint) -> float:
    """Return how far along the path a point is."""
    return (point.north_m - START_M[0]) * math.cos(COURSE) + (point.east_m - START_M[1]) * math.sin(COURSE)


class Fence:
    """A fence into which no route fits; it keeps what it was asked for."""

    def __init__(self) -> None:
        self.routes, self.asked = list[JoinRoute](), (0.0, 0.0, 0.0)

    def roomiest(self, routes: Any, speed_mps: float, wind_north_mps: float, wind_east_mps: float) -> JoinRoute:
        self.routes, self.asked = list(routes), (speed_mps, wind_north_mps, wind_east_mps)
        return self.routes[-1]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("place", "follows"),
    [
        ((-300.0, 59.0, 0.0), True),
        ((-300.0, 61.0, 0.0), False),
        ((-300.0, 0.0, 29.0), True),
        ((-300.0, 0.0, 30.5), False),
        ((-45.0, 0.0, 0.0), True),
        ((-43.0, 0.0, 0.0), False),
        ((300.0, 0.0, 0.0), False),
        ((-450.0, 0.0, 0.0, 58.0), True),
        ((-430.0, 0.0, 0.0, 58.0), False),
        ((-450.0, 0.0, 0.0, 142.0), True),
        ((-430.0, 0.0, 0.0, 142.0), False),
    ],
)
def test_from_the_paths_extension_it_follows_it_at_once(place: tuple[float, ...], follows: bool, side: float) -> None:
    """Up to 60 m and 30 degrees off it, with 2 s left before the path, and with room to climb at 0.7 of the limit.

    At 2.1 m/s and 22 m/s, 42 m take 440 m.
    """
    leads, (ahead_m, right_m, off_deg, *height_m) = guidance(), place
    leads.steer(at(ahead_m, side * right_m, side * off_deg, *height_m), MODEL, assembled=True)
    assert leads.on_path == follows
    assert not leads.started
    assert leads.distance_m == pytest.approx(ahead_m if follows else 0.0, abs=1e-6)


def test_one_that_can_hover_needs_no_room_before_the_path() -> None:
    leads = guidance(hovers=True)
    leads.steer(at(-0.5, height_m=50.0), HOVERING, assembled=True)
    assert leads.on_path


@pytest.mark.parametrize(
    ("ahead_m", "assembled", "turns_away"),
    [(-45.0, False, False), (-43.0, False, True), (-0.1, False, True), (0.1, False, False), (-43.0, True, False)],
)
def test_two_seconds_before_the_path_it_turns_away_unless_all_are_there(
    ahead_m: float, assembled: bool, turns_away: bool
) -> None:
    leads = guidance()
    leads.route, leads.distance_m = leads.path, ahead_m
    leads.steer(at(ahead_m), MODEL, assembled=assembled)
    assert (leads.rounds, leads.on_path) == ((1, False) if turns_away else (0, True))
    assert leads.distance_m == pytest.approx(0.0 if turns_away else ahead_m, abs=1e-6)
    assert leads.started == (ahead_m > 0.0)


@pytest.mark.parametrize(
    ("rounds", "run_in_m", "straights_m"),
    [
        (1, 300.0, [660, 495, 330]),
        (1, 1500.0, [1500, 1320, 660, 495, 330]),
        (2, 300.0, [1320, 660, 495, 330]),
        (3, 300.0, [1980, 1320, 660, 495, 330]),
        (9, 300.0, [2640, 1980, 1320, 660, 495, 330]),
    ],
)
def test_a_holding_pattern_has_the_longest_straight_that_the_fence_leaves_room_for(
    rounds: int, run_in_m: float, straights_m: list[float]
) -> None:
    """Multiples of 30 s of flight, at 22 m/s: one more with each round up to four, and fewer down to a half."""
    fence: Any = Fence()
    leads = guidance(run_in_m=run_in_m, fence=fence, rounds=rounds)
    flown = leads.holding_pattern(PathPoint(*START_M, 60.0, COURSE), 3.0, -4.0)
    assert flown is fence.routes[-1]
    assert fence.asked == (SPEED, 3.0, -4.0)
    found_m = [-along_m(route.at(route.length_m)) for route in fence.routes]
    assert list(dict.fromkeys(round(each, 3) for each in found_m)) == straights_m
    for route in fence.routes:
        assert max(abs(leg.curvature_1pm) for leg in route.legs) == pytest.approx(1.0 / (RADIUS_M + 50.0))
        assert route.slope == pytest.approx(0.7 * 3.0 / SPEED)
        assert (route.begin_height_m, route.end_height_m) == (60.0, 100.0)
    first = [route.length_m for route, each in zip(fence.routes, found_m, strict=True) if each > straights_m[0] - 1e-3]
    assert first == sorted(first)
    leads.fence = None
    assert leads.holding_pattern(PathPoint(*START_M, 60.0, COURSE), 3.0, -4.0).length_m == fence.routes[0].length_m


@pytest.mark.parametrize("climb_m", [0.0, 170.0, -170.0])
@pytest.mark.parametrize("first_straight_s", [15.0, 40.0])
def test_the_first_route_is_the_shortest_of_those_that_take_long_enough(
    climb_m: float, first_straight_s: float
) -> None:
    """With 80 s to join up, more where the straight takes more than 15 s, and the path's height before the straight."""
    fence: Any = Fence()
    leads = guidance(fence=fence, first_straight_s=first_straight_s)
    begin = at(-1500.0, 250.0, 40.0, 100.0 - climb_m)
    leads.first_route(PathPoint(begin.north_m, begin.east_m, begin.height_m, begin.heading_rad), 0.0, 0.0)
    straight_m = [-along_m(route.at(route.length_m)) for route in fence.routes]
    multiples = {1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0}
    expected_m = {330.0, 495.0, 660.0} | {each * first_straight_s * SPEED for each in multiples}
    assert {round(each, 3) for each in straight_m} == expected_m
    enough = [
        route.length_m + each >= (65.0 + first_straight_s) * SPEED
        and route.length_m >= abs(climb_m) / (0.7 * 3.0 / SPEED)
        and each >= first_straight_s * SPEED - 1e-6
        for route, each in zip(fence.routes, straight_m, strict=True)
    ]
    whole_m = [route.length_m + each for route, each in zip(fence.routes, straight_m, strict=True)]
    count = sum(enough)
    assert 0 < count < len(enough)
    assert all(enough[:count]), "those that lack nothing come first"
    assert whole_m[:count] == sorted(whole_m[:count])


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("right_m", "off_deg", "follows"),
    [(9.8, 0.0, True), (10.2, 0.0, False), (0.0, 9.8, True), (0.0, 10.2, False), (0.0, 180.0, False)],
)
def test_within_ten_metres_and_ten_degrees_of_the_path_it_needs_no_route_back(
    right_m: float, off_deg: float, follows: bool, side: float
) -> None:
    leads = guidance(centroid_m=(500.0, 2000.0))
    leads.steer(at(1000.0, side * right_m, side * off_deg), MODEL, assembled=False)
    assert leads.on_path == follows
    assert leads.distance_m == pytest.approx(1000.0 if follows else 0.0, abs=0.01)


@pytest.mark.parametrize(("right_m", "off_deg"), [(3000.0, 0.0), (700.0, 80.0), (-350.0, 150.0), (-900.0, -90.0)])
def test_the_way_back_is_the_nearest_one_that_leads_back_by_little_more_than_it_goes_on(
    right_m: float, off_deg: float
) -> None:
    """Up to eight radii ahead: the first way of less than one radius more, else the one with least more."""
    leads = guidance(centroid_m=(500.0, 2000.0))
    state = at(1000.0, right_m, off_deg)
    leads.steer(state, MODEL, assembled=False)
    begin = PathPoint(state.north_m, state.east_m, 100.0, state.heading_rad)
    to_m = [1000.0 + RADIUS_M * ahead for ahead in range(1, 9)]
    more_m = [join(begin, leads.path.at(each), RADIUS_M, 0.1).length_m - (each - 1000.0) for each in to_m]
    little = [each for each, more in zip(to_m, more_m, strict=True) if more < RADIUS_M]
    best_m = little[0] if little else to_m[more_m.index(min(more_m))]
    assert leads.joins_m == pytest.approx(best_m, abs=0.01)
    assert leads.route is not None
    assert leads.route.length_m == pytest.approx(more_m[to_m.index(best_m)] + best_m - 1000.0, abs=0.05)


@pytest.mark.parametrize(("speed_mps", "slope"), [(22.0, 2.1 / 22.0), (0.5, 2.1)])
def test_a_way_back_climbs_at_seven_tenths_of_the_limit(speed_mps: float, slope: float) -> None:
    leads = guidance(centroid_m=(500.0, 2000.0), speed_mps=speed_mps)
    state = at(1000.0, 300.0, height_m=50.0)
    leads.steer(state, MODEL, assembled=False)
    assert leads.route is not None
    assert leads.route.at(1.0).slope == pytest.approx(slope)
    assert leads.route.at(0.0).height_m == 50.0


def test_a_wind_widens_turns_before_the_path() -> None:
    """A tailwind of 5 m/s adds to 22 m/s, at 0.1 rad/s."""
    assert guidance().hold_radius_m() == pytest.approx(220.0)
    assert guidance().hold_radius_m(3.0, -4.0) == pytest.approx(270.0)


@pytest.mark.parametrize("carried_mps", [0.0, 5.0])
def test_its_setpoint_leads_a_planned_change_of_speed_by_the_time_constant(carried_mps: float) -> None:
    """By (7) with 4 s, where the plan changes from 22 to 18 m/s over 400 m, and how fast it passes that over ground."""
    plan = SpeedProfile(SPEED, [Change(1000.0, 400.0, 22.0, 18.0)])
    for at_m in (900.0, 1100.0, 1200.0, 1350.0, 1500.0):
        leads, state = guidance(speeds=plan), at(at_m)
        leads.route, leads.distance_m = leads.path, at_m
        state.wind_north_mps, state.wind_east_mps = carried_mps * math.cos(COURSE), carried_mps * math.sin(COURSE)
        per_metre = (plan.at(at_m + 0.1)[0] - plan.at(at_m - 0.1)[0]) / 0.2
        expected_mps = plan.at(at_m)[0] + 4.0 * per_metre * (SPEED + carried_mps)
        assert leads.steer(state, MODEL, assembled=True).speed_mps == pytest.approx(expected_mps, abs=1e-3)
        assert leads.speed_mps == pytest.approx(plan.at(at_m)[0])
    leads = guidance(speeds=plan)
    assert leads.steer(at(-900.0, 500.0, 90.0), MODEL, assembled=True).speed_mps == SPEED, "on the way to its path"


def test_its_height_is_that_of_its_route_at_the_nearest_point() -> None:
    """Led by the climb of 2.1 m/s times both time constants of (7), 1 s and 3 s."""
    leads = guidance(centroid_m=(500.0, 2000.0))
    leads.steer(at(1000.0, 300.0, height_m=50.0), MODEL, assembled=False)
    assert leads.route is not None
    here = leads.route.at(40.0)
    state = FlightState(here.north_m, here.east_m, 20.0, 0.0, SPEED, here.course_rad, 0.0, 0.0)
    setpoint = leads.steer(state, MODEL, assembled=False)
    assert leads.distance_m == pytest.approx(40.0)
    assert setpoint.height_m == pytest.approx(here.height_m + 4.0 * 2.1)
    assert setpoint.height_m == pytest.approx(height_setpoint_m(here, state, MODEL))


@pytest.mark.parametrize(("off_m", "stops"), [(-2.1, False), (-1.9, True)])
def test_even_a_slow_one_decides_two_seconds_before_its_path(off_m: float, stops: bool) -> None:
    """At 1 m/s it would stop within 1 m."""
    leads = guidance(hovers=True, speed_mps=1.0)
    leads.route, leads.distance_m = leads.path, off_m
    assert leads.steer(at(off_m), HOVERING, assembled=False).speed_mps == (0.0 if stops else 1.0)
    assert leads.waits == stops


def test_it_waits_again_if_one_is_missing_again_before_its_path_but_not_after_its_start() -> None:
    leads = guidance(hovers=True, speed_mps=5.0)
    leads.route, leads.distance_m = leads.path, -5.0
    for off_m, assembled, speed_mps in ((-5.0, True, 5.0), (-4.0, False, 0.0), (-3.0, True, 5.0), (0.5, True, 5.0)):
        assert leads.steer(at(off_m), HOVERING, assembled=assembled).speed_mps == speed_mps
        assert leads.started == (off_m >= 0.0)
    assert leads.steer(at(1.0), HOVERING, assembled=False).speed_mps == 5.0
    assert leads.rounds == 0


def test_a_flight_is_resumed_at_its_speed_and_as_it_faced() -> None:
    plan = SpeedProfile(SPEED)
    leads = guidance(speeds=plan, hovers=True)
    leads.resume(SPEED, NOW, 0.7, None)
    assert leads.follows_plan
    assert leads.turn is not None
    assert leads.facing_rad(at(0.0)) == leads.turn.goal_rad == 0.7
    assert [leads.turn.over(after(NOW, each)) for each in (3.9, 4.1)] == [False, True]
    leads.resume(15.0, NOW, None, (900.0, 1100.0))
    assert (leads.speed_mps, leads.follows_plan, leads.turn) == (15.0, False, None)
    leads.steer(at(1000.0), HOVERING, assembled=False)
    assert leads.started
    assert not leads.waits
    assert leads.distance_m == pytest.approx(1000.0, abs=0.01)


def test_only_one_that_keeps_hovering_holds_its_heading() -> None:
    leads = guidance()
    leads.resume(SPEED, NOW, 0.7, None)
    leads.fly_at(0.0)
    assert (leads.speed_mps, leads.turn is None) == (0.0, False)
    leads.fly_at(5.0)
    assert (leads.speed_mps, leads.turn) == (5.0, None)


def test_a_timetable_is_followed_on_the_path_alone_until_another_speed_is_ordered() -> None:
    orders, due = list[float](), SimpleNamespace(speed_mps=3.0, turn=None, setpoint_mps=lambda tau_s: 10.0 * tau_s)
    taken, asked = list[bool](), list[float]()
    timed: Any = SimpleNamespace(
        ordered=False,
        pauses=True,
        order=orders.append,
        part=lambda route, ahead=False: route,
        take_over=lambda: taken.append(True),
        advance=lambda distance_m, at, dt_s, turn: asked.append(dt_s) or due,
    )
    leads = guidance(timed=timed, dt_s=0.2)
    assert leads.follows_plan
    assert leads.steer(at(-900.0, 500.0, 90.0), HOVERING, assembled=True).speed_mps == SPEED
    assert not asked
    leads.route, leads.distance_m = leads.path, 10.0
    held_s = HOVERING.held(0.2).tau_v_s
    assert leads.steer(at(10.0), HOVERING, assembled=True, at=NOW).speed_mps == pytest.approx(10.0 * held_s)
    assert (leads.speed_mps, asked) == (3.0, [0.2])
    timed.ordered = True
    assert not leads.follows_plan
    leads.fly_at(2.0)
    leads.take_over(None, 0.0)
    assert (orders, taken) == ([2.0], [True])


def test_another_leader_is_guided_from_where_it_is_and_heads() -> None:
    leads = guidance(centroid_m=(500.0, 2000.0))
    leads.steer(at(1000.0), MODEL, assembled=True)
    leads.take_over(leads.path, 1500.0)
    state = at(1500.0)
    state.heading_rad += 0.5
    setpoint = leads.steer(state, MODEL, assembled=True)
    assert leads.distance_m == pytest.approx(1500.0, abs=0.01)
    assert setpoint.heading_rad == pytest.approx(state.heading_rad, abs=0.02), "not by the last one's heading"
    leads.take_over(None, 0.0)
    assert not leads.on_path
    assert not leads.at_end


def test_its_place_along_the_path_and_its_heading_along_it_are_those_abreast() -> None:
    """A crosswind of 11 m/s from the left takes 30 degrees to the left of the course."""
    leads = guidance(centroid_m=(500.0, 2000.0))
    state = at(1000.0, 0.0, -30.0)
    state.wind_north_mps, state.wind_east_mps = -11.0 * math.sin(COURSE), 11.0 * math.cos(COURSE)
    leads.steer(state, MODEL, assembled=True)
    assert leads.facing_rad(state) == pytest.approx(COURSE - math.radians(30.0))
    distance_m, point = leads.abreast(at(1040.0, 25.0).north_m, at(1040.0, 25.0).east_m)
    assert (distance_m, along_m(point)) == pytest.approx((1040.0, 1040.0))
    leads.turn = SimpleNamespace(goal_rad=1.0)  # type: ignore[assignment]
    assert leads.facing_rad(state) == 1.0
    assert not leads.at_end
    leads.distance_m = 4000.0 + 1e-6
    assert leads.at_end


def test_the_rate_of_its_heading_setpoint_is_that_of_the_path_s_turn() -> None:
    """It flies on from a setpoint that replaced its own one."""
    leads = guidance(centroid_m=(500.0, 2000.0))
    decided_rad = leads.steer(at(1000.0), MODEL, assembled=True).heading_rad
    assert leads.turn_rps == pytest.approx(0.0, abs=1e-6)
    leads.go_on_from(decided_rad + 0.15, decided_rad, at(1000.0), MODEL)
    leads.steer(at(1000.0), MODEL, assembled=True)
    assert leads.turn_rps == pytest.approx(0.1 - 1.5 * 2.0 * 0.65 * 0.1)
