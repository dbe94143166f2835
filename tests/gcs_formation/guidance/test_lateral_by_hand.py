"""The leader's lateral guidance at single instants: its three gains, its courses back and its bounds, by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel, advance, crab_rad
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from gcs_formation.guidance.lateral import LateralGuidance, TurnBounds, bend_max_rps2, route_turn

SPEED_MPS, DT_S, TAU_S, TURN_RPS = 22.0, 0.1, 1.5, 0.25
MODEL = AutopilotModel(4.0, TAU_S, 1.0, 3.0, 16.0, 28.0, 1.5, TURN_RPS, 3.0)
SIDES = pytest.mark.parametrize("side", [1.0, -1.0])


def beside(
    right_m: float, off_rad: float, course_rad: float = 0.0, wind_mps: tuple[float, float] = (0.0, 0.0)
) -> tuple[PathPoint, FlightState]:
    """Return a point of a straight route, and a vehicle abreast of it whose course is `off_rad` to the right of it."""
    point = PathPoint(300.0, -200.0, 100.0, course_rad)
    north_m, east_m = 300.0 - right_m * math.sin(course_rad), -200.0 + right_m * math.cos(course_rad)
    state = FlightState(north_m, east_m, 100.0, 0.0, SPEED_MPS, 0.0, *wind_mps)
    state.heading_rad = course_rad + off_rad - crab_rad(state, course_rad + off_rad)
    return point, state


def begun(right_m: float, off_rad: float, bounds: TurnBounds, course_rad: float = 0.0) -> float:
    """Return how fast the turn rate of a vehicle that flies straight begins to change, by the setpoint's rate."""
    loop = LateralGuidance(DT_S)
    loop.setpoint_rad(*beside(right_m, off_rad, course_rad), MODEL, SPEED_MPS, bounds)
    return loop.setpoint_rps / TAU_S


@SIDES
def test_the_gains_are_those_of_butterworths_polynomial(side: float) -> None:
    """s³ + 2 p s² + 2 p² s + p³: the turn rate changes by -p³ y / v at y from the route, by -2 p² psi at psi off it."""
    p = 0.65
    assert begun(0.1 * side, 0.0, TurnBounds()) == pytest.approx(-(p**3) * 0.1 * side / SPEED_MPS, rel=1e-4)
    assert begun(0.0, 0.01 * side, TurnBounds()) == pytest.approx(-2.0 * p**2 * 0.01 * side)


@SIDES
def test_a_turn_rate_is_taken_back_by_twice_the_bandwidth(side: float) -> None:
    """It turns at 0.02 rad/s by a setpoint that leads by as much times its time constant."""
    loop, (point, state) = LateralGuidance(DT_S), beside(0.0, 0.0)
    loop.go_on_from(0.02 * side * TAU_S, 0.0, state, MODEL)
    loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
    assert loop.setpoint_rps == pytest.approx(0.02 * side * (1.0 - TAU_S * 2.0 * 0.65))


@SIDES
@pytest.mark.parametrize("course_rad", [0.0, -2.6])
@pytest.mark.parametrize("wind_mps", [(0.0, 0.0), (5.0, -7.0)])
@pytest.mark.parametrize(
    ("right_m", "bend_rps2", "course_back_rad"),
    [
        (2.0, 0.15, math.atan(0.65 / 2.0 * 2.0 / SPEED_MPS)),
        (200.0, 0.005, 0.5 * (200.0 * math.sqrt(0.005) / SPEED_MPS) ** (2.0 / 3.0)),
        (3000.0, 0.15, math.radians(60.0)),
    ],
)
def test_on_the_course_that_leads_back_it_flies_straight_on(
    right_m: float,
    bend_rps2: float,
    course_back_rad: float,
    side: float,
    course_rad: float,
    wind_mps: tuple[float, float],
) -> None:
    """Near the route an arctangent, farther off half of what can be turned back in time, 60 degrees at most.

    An angle a is turned back at b rad/s² in 2 (a/b)^1/2, on v a (a/b)^1/2 of the distance: a = (y b^1/2 / v)^2/3.
    """
    loop = LateralGuidance(DT_S)
    point, state = beside(right_m * side, -course_back_rad * side, course_rad, wind_mps)
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(bend_rps2))
    assert math.remainder(setpoint_rad - state.heading_rad, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert loop.setpoint_rps == pytest.approx(0.0, abs=1e-6)


@SIDES
def test_without_followers_the_turn_rate_changes_by_no_more_than_015_and_with_them_as_they_allow(side: float) -> None:
    assert begun(500.0 * side, 0.0, TurnBounds()) == pytest.approx(-0.15 * side)
    assert begun(500.0 * side, 0.0, TurnBounds(0.02)) == pytest.approx(-0.02 * side)


@SIDES
def test_a_large_angle_is_turned_by_at_the_rate_that_can_be_braked_from(side: float) -> None:
    """(b a)^1/2 leaves the angle a/2 for braking at b, and as much for gaining the rate."""
    off_rad, bend_rps2 = 0.3, 0.005
    turn_rps = math.sqrt(bend_rps2 * off_rad)
    assert turn_rps < math.sqrt(bend_rps2 * SPEED_MPS / 2.0) * off_rad
    loop, (point, state) = LateralGuidance(DT_S), beside(0.0, off_rad * side)
    commanded_rad = state.heading_rad - TAU_S * turn_rps * side
    loop.go_on_from(commanded_rad, state.heading_rad, state, MODEL)
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(bend_rps2))
    assert loop.setpoint_rps == pytest.approx(-turn_rps * side, abs=1e-6)
    assert setpoint_rad == pytest.approx(state.heading_rad - MODEL.held(DT_S).tau_psi_s * turn_rps * side)


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-400.0, 400.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0), st.tuples(st.floats(-6, 6), st.floats(-6, 6))
)
def test_it_steers_alike_in_every_direction_and_mirrored_to_the_other_side(
    right_m: float, off_rad: float, course_rad: float, wind_mps: tuple[float, float]
) -> None:
    """`wind_mps`: along the route and to its right."""

    def steered(mirror: float, course_rad: float) -> tuple[float, float]:
        along_mps, across_mps = wind_mps[0], mirror * wind_mps[1]
        cos, sin = math.cos(course_rad), math.sin(course_rad)
        wind = along_mps * cos - across_mps * sin, along_mps * sin + across_mps * cos
        point, state = beside(mirror * right_m, mirror * off_rad, course_rad, wind)
        point.curvature_1pm, point.curvature_rate_1pm2 = 0.001 * mirror, 1e-6 * mirror
        loop = LateralGuidance(DT_S)
        setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
        return mirror * math.remainder(setpoint_rad - course_rad, math.tau), mirror * loop.setpoint_rps

    assert steered(1.0, course_rad) == pytest.approx(steered(1.0, 0.0), abs=1e-6)
    assert steered(-1.0, 0.0) == pytest.approx(steered(1.0, 0.0), abs=1e-6)


@SIDES
def test_it_turns_no_faster_than_the_vehicle_can_and_reaches_that(side: float) -> None:
    """Each tick, the setpoint turns the vehicle by the mean of the rates at its ends, by (7)."""
    loop, (point, state) = LateralGuidance(DT_S), beside(0.0, 2.5 * side)
    turned_rps, before_rad = list[float](), state.heading_rad
    for _ in range(40):
        setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
        advance(state, MODEL, SPEED_MPS, setpoint_rad, 100.0, DT_S)
        state.north_m, state.east_m = point.north_m, point.east_m
        turned_rps.append(-side * math.remainder(state.heading_rad - before_rad, math.tau) / DT_S)
        before_rad = state.heading_rad
    assert turned_rps[:4] == pytest.approx([0.0075, 0.0225, 0.0375, 0.0525], abs=1e-6)
    assert 0.98 * TURN_RPS < max(turned_rps) <= TURN_RPS


def test_what_the_model_does_not_know_is_forgotten_at_a_fifth_per_second() -> None:
    """A vehicle that turned by 0.1 rad by itself, along with its route: after 5 s 1/e of that is left."""
    loop = LateralGuidance(DT_S)
    loop.setpoint_rad(*beside(0.0, 0.0), MODEL, SPEED_MPS, TurnBounds())
    ahead_rad = [loop.setpoint_rad(*beside(0.0, 0.0, 0.1), MODEL, SPEED_MPS, TurnBounds()) - 0.1 for _ in range(51)]
    assert ahead_rad[0] == pytest.approx(-0.1)
    assert ahead_rad[50] == pytest.approx(-0.1 / math.e, rel=0.02)


@SIDES
def test_a_vehicle_that_turned_by_much_leads_by_no_more_than_its_lag_at_its_limit(side: float) -> None:
    loop = LateralGuidance(DT_S)
    loop.setpoint_rad(*beside(0.0, 0.0), MODEL, SPEED_MPS, TurnBounds())
    point, state = beside(0.0, 0.0, 1.0 * side)
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
    assert setpoint_rad - state.heading_rad == pytest.approx(-side * TAU_S * TURN_RPS)


@SIDES
@pytest.mark.parametrize(("by_deg", "continued"), [(14.5, True), (15.5, False)])
def test_what_replaces_a_setpoint_by_up_to_fifteen_degrees_is_continued(
    by_deg: float, continued: bool, side: float
) -> None:
    """Also through south, where headings jump by a whole turn."""
    loop, (point, state) = LateralGuidance(DT_S), beside(0.0, 0.0, math.pi)
    decided_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
    commanded_rad = decided_rad + side * math.radians(by_deg)
    loop.go_on_from(math.remainder(commanded_rad, math.tau), decided_rad, state, MODEL)
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(1e-6))
    turn_rps = side * math.radians(by_deg) / TAU_S if continued else 0.0
    expected_rad = MODEL.held(DT_S).tau_psi_s * turn_rps
    assert math.remainder(setpoint_rad - math.pi, math.tau) == pytest.approx(expected_rad, abs=1e-4)


def test_a_replaced_setpoint_turns_it_no_faster_than_it_can() -> None:
    slow = AutopilotModel(4.0, TAU_S, 1.0, 3.0, 16.0, 28.0, 1.5, 0.05, 3.0)
    for side in (1.0, -1.0):
        loop, (point, state) = LateralGuidance(DT_S), beside(0.0, 0.0)
        loop.go_on_from(0.2 * side, 0.0, state, slow)
        loop.setpoint_rad(point, state, slow, SPEED_MPS, TurnBounds(1e-6))
        assert loop.setpoint_rps == pytest.approx(0.05 * side, abs=1e-4)


@SIDES
@pytest.mark.parametrize(("right_m", "radius_m"), [(0.0, 200.0), (40.0, 160.0), (-50.0, 250.0), (160.0, 40.0)])
def test_beside_a_bend_the_route_turn_is_that_of_the_concentric_circle(
    right_m: float, radius_m: float, side: float
) -> None:
    """Without wind at v / R; nearer to the centre than a fifth of the radius it is no faster than there."""
    point = PathPoint(0.0, 0.0, 100.0, 0.5, side / 200.0)
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.5, 0.0, 0.0)
    turn = route_turn(point, state, side * right_m)
    assert (turn.turn_rps, turn.bend_rps2) == pytest.approx((side * SPEED_MPS / radius_m, 0.0))
    if radius_m == 40.0:
        assert route_turn(point, state, side * 190.0).turn_rps == turn.turn_rps


@pytest.mark.parametrize("course_rad", [-2.0, 0.4, 1.9, 3.0])
@pytest.mark.parametrize("rate_1pm2", [0.0, 1e-4])
def test_in_a_strong_wind_a_bends_rates_are_the_derivatives_of_the_heading_along_it(
    course_rad: float, rate_1pm2: float
) -> None:
    """On a clothoid that begins with a radius of 100 m, by central differences over 2 cm of its length."""
    step_m = 0.01

    def flown(at_m: float) -> tuple[PathPoint, FlightState]:
        curvature_1pm = 0.01 + rate_1pm2 * at_m
        course = course_rad + (0.01 + rate_1pm2 * at_m / 2.0) * at_m
        state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 12.0, -9.0)
        state.heading_rad = course - crab_rad(state, course)
        return PathPoint(0.0, 0.0, 100.0, course, curvature_1pm, rate_1pm2), state

    before, point, after = (flown(each) for each in (-step_m, 0.0, step_m))
    over_mps = math.hypot(*point[1].ground_mps())
    turned_rad, found = after[1].heading_rad - before[1].heading_rad, route_turn(*point, 0.0)
    assert found.turn_rps == pytest.approx(turned_rad / (2.0 * step_m) * over_mps, rel=1e-6)
    bends_rps = route_turn(*after, 0.0).turn_rps - route_turn(*before, 0.0).turn_rps
    assert found.bend_rps2 == pytest.approx(bends_rps / (2.0 * step_m) * over_mps, rel=1e-5)


@pytest.mark.parametrize("wind_mps", [-22.0, -30.0])
def test_against_a_wind_that_it_cannot_outfly_a_vehicle_passes_no_bend(wind_mps: float) -> None:
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, wind_mps, 0.0)
    turn = route_turn(PathPoint(0.0, 0.0, 100.0, 0.0, 0.01, 1e-4), state, 0.0)
    assert (turn.turn_rps, turn.bend_rps2) == (0.0, 0.0)


@pytest.mark.parametrize("across_mps", [22.0, -25.0])
def test_a_crosswind_as_fast_as_the_vehicle_leaves_it_one_metre_a_second(across_mps: float) -> None:
    """With 3 m/s along the route it passes a bend of 100 m radius at 4 m/s, and turns by 1 + 3/1 times as much."""
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 3.0, across_mps)
    assert route_turn(PathPoint(0.0, 0.0, 100.0, 0.0, 0.01), state, 0.0).turn_rps == pytest.approx(0.01 * 4.0 * 4.0)


@SIDES
def test_who_is_to_hover_and_still_flies_turns_along_the_bend(side: float) -> None:
    """At 3 m/s through the air and with a wind of 2 m/s along a bend of 50 m radius: 0.1 rad/s, led by the lag."""
    point = PathPoint(0.0, 0.0, 100.0, 0.0, 0.02 * side)
    state = FlightState(0.0, 5.0, 100.0, 0.0, 3.0, 0.0, 2.0, 0.0)
    loop = LateralGuidance(DT_S)
    assert loop.setpoint_rad(point, state, MODEL, 0.0, TurnBounds()) == pytest.approx(0.1 * side * TAU_S)
    assert loop.setpoint_rps == pytest.approx(0.1 * side)
    state.wind_north_mps, state.wind_east_mps = 0.0, 1.5 * side
    assert loop.setpoint_rad(point, state, MODEL, 0.0, TurnBounds()) == pytest.approx(
        -side * math.asin(0.5) + 0.02 * side * 3.0 * TAU_S
    )


def test_who_hovered_flies_on_from_where_it_faces() -> None:
    loop = LateralGuidance(DT_S)
    loop.setpoint_rad(*beside(0.0, 0.0), MODEL, SPEED_MPS, TurnBounds())
    loop.setpoint_rad(*beside(0.0, 0.0), MODEL, 0.0, TurnBounds())
    setpoint_rad = loop.setpoint_rad(*beside(0.0, 0.0, 2.0), MODEL, SPEED_MPS, TurnBounds())
    assert setpoint_rad == pytest.approx(2.0)


def test_slower_than_one_metre_a_second_it_steers_as_at_that() -> None:
    """Its distance to the route counts by the time that it takes to fly it, which would be for ever."""
    setpoints_rad = []
    for speed_mps in (0.01, 0.9, 1.0, 1.5):
        point, state = beside(0.4, 0.0)
        state.airspeed_mps = 1.0
        loop = LateralGuidance(DT_S)
        setpoints_rad.append(loop.setpoint_rad(point, state, MODEL, speed_mps, TurnBounds()))
    assert setpoints_rad[0] == setpoints_rad[1] == setpoints_rad[2] < 0.0
    assert setpoints_rad[3] != pytest.approx(setpoints_rad[2], rel=0.1), "a wider bandwidth suits higher speeds"


def test_in_air_that_has_been_rough_for_minutes_it_steers_more_firmly() -> None:
    """By p³ near the route, with p a quarter higher; another vehicle's air has been as rough."""
    loop = LateralGuidance(DT_S)
    for tick in range(3000):
        point, state = beside(0.0, 0.0)
        state.wind_north_mps = 0.5 * math.sin(DT_S * tick)
        loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
    loop.drop_state()
    loop.setpoint_rad(*beside(0.1, 0.0), MODEL, SPEED_MPS, TurnBounds())
    assert loop.setpoint_rps / TAU_S == pytest.approx(-((1.25 * 0.65) ** 3) * 0.1 / SPEED_MPS, rel=1e-3)


def test_the_airs_of_many_vehicles_that_lead_one_after_another_are_no_rough_air() -> None:
    """Each one's wind is estimated a little differently; none has led yet at first, and nothing turns."""
    loop = LateralGuidance(DT_S)
    assert loop.setpoint_rps == 0.0
    for count in range(400):
        point, state = beside(0.0, 0.0)
        state.wind_north_mps = 2.0 if count % 2 else -2.0
        loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds())
        loop.drop_state()
    loop.setpoint_rad(*beside(0.1, 0.0), MODEL, SPEED_MPS, TurnBounds())
    assert loop.setpoint_rps / TAU_S == pytest.approx(-(0.65**3) * 0.1 / SPEED_MPS, rel=1e-3)


def test_the_bandwidth_has_the_bounds_that_flights_have_shown() -> None:
    """docs/guidance.md: 0.65 rad/s without delay, 0.68 with, a quarter more in rough air, with thrice the noise."""
    assert TurnBounds().radps(SPEED_MPS) == 0.65
    assert TurnBounds(round_trip_s=0.6).radps(SPEED_MPS) == 0.68
    assert TurnBounds(round_trip_s=0.6).radps(SPEED_MPS, 1.0) == pytest.approx(1.25 * 0.68)
    assert TurnBounds().radps(SPEED_MPS, 0.5) == pytest.approx(1.125 * 0.65)
    quiet = [TurnBounds(course_sigma_rad=0.02).radps(SPEED_MPS, rough) for rough in (0.0, 0.5, 1.0)]
    assert [each**2 * 0.02 for each in quiet] == pytest.approx([3e-4, 6e-4, 9e-4])
    assert TurnBounds(0.01).radps(20.0) == pytest.approx(math.sqrt(0.01 * 20.0 / 2.0)), "a gust of 1 m/s"


def test_a_slot_to_either_side_takes_seven_tenths_of_its_vehicles_acceleration() -> None:
    """A slot nearer than 1 m counts as 1 m to the side."""
    weak = AutopilotModel(4.0, TAU_S, 1.0, 3.0, 16.0, 28.0, 0.2, TURN_RPS, 3.0)
    for right_m, at_m in ((20.0, 20.0), (-20.0, 20.0), (1.5, 1.5), (0.5, 1.0), (0.0, 1.0), (-0.5, 1.0)):
        assert bend_max_rps2([(-30.0, right_m, 0.0)], [weak]) == pytest.approx(0.7 * 0.2 / at_m)
