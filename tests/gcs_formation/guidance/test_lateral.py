"""The leader's lateral guidance, in a closed loop with model (7): bends exactly, gusts quickly and without a jerk."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.autopilot_model import AutopilotModel, advance, crab_rad
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.legs.heights import Climbs
from flight_model.legs.joining import TurnRules
from flight_model.legs.path import LegPlan, LegsPath
from flight_model.legs.turn import TurnLimits
from flight_model.path import Route
from flight_model.spline import SplinePath
from gcs_formation.guidance.lateral import (
    BEND_MAX_RPS2,
    DELAYED_RADPS,
    ROUGH_NOISE_RATIO,
    ROUGH_RATIO,
    LateralGuidance,
    TurnBounds,
    bend_max_rps2,
    route_turn,
)
from gcs_formation.guidance.tracking import project

SPEED_MPS, DT_S = 22.0, 0.1
TURN_RPS = 0.25
MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, TURN_RPS, 3.0)
STRAIGHT = SplinePath([[0, 0, 100], [4000, 0, 100]])
BENDS = SplinePath([[0, 0, 100], [900, 0, 100], [1700, 500, 120], [2300, 1300, 110], [3300, 1500, 100]])
FOLLOWED_RPS2 = 0.035
"""Change of the turn rate that slots 30 m beside the leader can keep up with."""


class Flown(NamedTuple):
    """The vehicle at one tick."""

    t_s: float
    right_m: float
    setpoint_rad: float
    setpoint_rps: float
    turn_rps: float
    """Mean over the tick before."""


def tight(share: float) -> Route:
    """Return a path of legs whose turns take a share of the turn rate's limit."""
    curvature_1pm = share * TURN_RPS / SPEED_MPS
    limits = TurnLimits(curvature_1pm, 1.5 * curvature_1pm / (3.0 * SPEED_MPS))
    corners = [[0, 0, 100], [500, 0, 100], [500, 500, 100], [1000, 500, 100], [900, -100, 100], [1500, -300, 100]]
    count = len(corners) - 1
    rules = TurnRules((limits,) * count, 1e4)
    return LegsPath(corners, LegPlan(rules, (Climbs(0.1, 1e-4),) * count))


def fly(
    route: Route,
    seconds: float,
    *,
    tau_s: float = 1.5,
    wind: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0),
    bend_rps2: float = BEND_MAX_RPS2,
) -> Iterator[Flown]:
    """Fly the model, whose heading has a lag of its own, from the route's start; the wind of each tick is known."""
    loop, flies = LateralGuidance(DT_S), AutopilotModel(4.0, tau_s, 1.0, 3.0, 16.0, 28.0, 1.5, TURN_RPS, 3.0)
    start, at_m = route.at(0.0), 0.0
    state = FlightState(start.north_m, start.east_m, 100.0, 0.0, SPEED_MPS, start.course_rad, 0.0, 0.0)
    state.heading_rad -= crab_rad(FlightState(0, 0, 0, 0, SPEED_MPS, 0, *wind(0.0)), start.course_rad)
    before_rad = state.heading_rad
    for tick in range(int(seconds / DT_S)):
        state.wind_north_mps, state.wind_east_mps = wind(tick * DT_S)
        at_m = project(route, state.north_m, state.east_m, at_m)
        point = route.at(at_m)
        setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(bend_rps2))
        right_m, _ = point.lateral_and_up_m(state.north_m, state.east_m, 0.0)
        turn_rps = math.remainder(state.heading_rad - before_rad, math.tau) / DT_S
        yield Flown(tick * DT_S, right_m, setpoint_rad, loop.setpoint_rps, turn_rps)
        before_rad = state.heading_rad
        advance(state, flies, SPEED_MPS, setpoint_rad, 100.0, DT_S)


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize(("tau_s", "max_m"), [(1.5, 0.15), (1.05, 4.2), (1.95, 4.2)])
def test_turns_up_to_nine_tenths_of_the_limit_are_flown_on_the_path(share: float, tau_s: float, max_m: float) -> None:
    """0.15 m; with a lag that is 30 % off and isn't learnt, 4.2 m."""
    assert max(abs(each.right_m) for each in fly(tight(share), 110.0, tau_s=tau_s)) < max_m


def test_turns_in_a_steady_wind_too() -> None:
    """A crab angle that changes with the course is part of the turn that is fed forward."""
    flown = fly(tight(0.6), 100.0, wind=lambda _: (4.0, -5.0))
    assert max(abs(each.right_m) for each in flown) < 0.3


def gust(t_s: float) -> tuple[float, float]:
    """Return a step of wind of 5 m/s across the path."""
    return 0.0, 5.0 if t_s >= 5.0 else 0.0


@pytest.mark.parametrize("bend_rps2", [BEND_MAX_RPS2, FOLLOWED_RPS2])
def test_a_step_of_wind_is_over_within_twenty_seconds(bend_rps2: float) -> None:
    flown = list(fly(STRAIGHT, 60.0, wind=gust, bend_rps2=bend_rps2))
    assert 3.0 < max(abs(each.right_m) for each in flown) < 15.0
    assert max(abs(each.right_m) for each in flown if each.t_s > 25.0) < 1.0


def test_a_step_of_wind_changes_the_turn_rate_no_faster_than_followers_can() -> None:
    flown = list(fly(STRAIGHT, 60.0, wind=gust, bend_rps2=FOLLOWED_RPS2))
    changes = [abs(after.turn_rps - before.turn_rps) / DT_S for before, after in pairwise(flown)]
    assert 0.9 * FOLLOWED_RPS2 < max(changes) < 1.01 * FOLLOWED_RPS2


def test_a_leader_with_far_slots_still_comes_back_without_swinging() -> None:
    """Its loop is slower where followers allow little: it overshoots by an eighth at most."""
    flown = [each.right_m for each in fly(STRAIGHT, 120.0, wind=gust, bend_rps2=0.005)]
    assert min(flown) > -0.125 * max(flown)
    assert abs(flown[-1]) < 1.0


def test_the_rate_of_the_setpoint_is_its_derivative() -> None:
    """Followers lead their own setpoints by it."""
    flown = list(fly(BENDS, 120.0))
    for before, after in pairwise(flown):
        mean_rps = (before.setpoint_rps + after.setpoint_rps) / 2.0
        turned_rad = math.remainder(after.setpoint_rad - before.setpoint_rad, math.tau)
        assert turned_rad / DT_S == pytest.approx(mean_rps, abs=2e-3)


@settings(max_examples=60, deadline=None)
@given(st.floats(1000.0, 2500.0), st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0)))
def test_the_route_turn_is_that_of_the_heading_along_it(at_m: float, wind_mps: tuple[float, float]) -> None:
    def heading_and_speed(from_m: float) -> tuple[float, float]:
        point = BENDS.at(from_m)
        state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, *wind_mps)
        state.heading_rad = point.course_rad - crab_rad(state, point.course_rad)
        return state.heading_rad, math.hypot(*state.ground_mps())

    def turn(from_m: float) -> tuple[float, float]:
        heading_rad, _ = heading_and_speed(from_m)
        found = route_turn(BENDS.at(from_m), FlightState(0, 0, 0, 0, SPEED_MPS, heading_rad, *wind_mps), 0.0)
        return found.turn_rps, found.bend_rps2

    (before_rad, _), (after_rad, _), (_, over_mps) = (heading_and_speed(at_m + each) for each in (-0.1, 0.1, 0.0))
    turn_rps, bend_rps2 = turn(at_m)
    assert turn_rps == pytest.approx(math.remainder(after_rad - before_rad, math.tau) / 0.2 * over_mps, abs=1e-5)
    bends_rps2 = (turn(at_m + 0.1)[0] - turn(at_m - 0.1)[0]) / 0.2 * over_mps
    assert bend_rps2 == pytest.approx(bends_rps2, abs=1e-4)


@given(st.floats(950.0, 2200.0), st.floats(-20.0, 20.0))
def test_who_stands_faces_along_the_route_however_far_beside_it(at_m: float, right_m: float) -> None:
    """It comes no closer by turning, and all slots would turn with its nose."""
    point = BENDS.at(at_m)
    north_m = point.north_m - right_m * math.sin(point.course_rad)
    east_m = point.east_m + right_m * math.cos(point.course_rad)
    state = FlightState(north_m, east_m, 100.0, 0.0, 0.0, point.course_rad, 0.0, 0.0)
    loop = LateralGuidance(DT_S)
    assert loop.setpoint_rad(point, state, MODEL, 0.0, TurnBounds()) == point.course_rad
    assert loop.setpoint_rps == 0.0


def test_far_slots_and_weak_vehicles_allow_less_change_of_the_turn_rate() -> None:
    unknown = (math.nan,) * 3
    weak = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 0.75, TURN_RPS, 3.0)
    wide, narrow = (-30.0, 60.0, 0.0), (-30.0, 30.0, 0.0)
    assert bend_max_rps2([], [MODEL]) == bend_max_rps2([unknown], [MODEL]) == BEND_MAX_RPS2
    assert bend_max_rps2([unknown, narrow], [MODEL, MODEL]) == pytest.approx(0.7 * 1.5 / 30.0)
    assert bend_max_rps2([unknown, narrow], [MODEL, weak]) == pytest.approx(0.7 * 0.75 / 30.0)
    assert bend_max_rps2([unknown, narrow, wide], [MODEL] * 3) == pytest.approx(0.7 * 1.5 / 60.0)


@pytest.mark.parametrize("bend_rps2", [BEND_MAX_RPS2, FOLLOWED_RPS2, 0.005])
@pytest.mark.parametrize(("right_m", "heading_deg"), [(20.0, 0.0), (50.0, 0.0), (200.0, 0.0), (500.0, 0.0)])
def test_from_far_off_the_route_it_comes_back_without_crossing_it_by_much(
    bend_rps2: float, right_m: float, heading_deg: float
) -> None:
    """However little its turn rate may change: it would swing from side to side if it turned back too late."""
    loop, rights_m = LateralGuidance(DT_S), list[float]()
    state = FlightState(0.0, right_m, 100.0, 0.0, SPEED_MPS, math.radians(heading_deg), 0.0, 0.0)
    for _ in range(1500):
        point = PathPoint(state.north_m, 0.0, 100.0, 0.0)
        setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(bend_rps2))
        advance(state, MODEL, SPEED_MPS, setpoint_rad, 100.0, DT_S)
        rights_m.append(state.east_m)
    assert min(rights_m) > -2.0
    assert abs(rights_m[-1]) < 1.0
    assert abs(math.remainder(state.heading_rad, math.tau)) < 0.02


def test_it_goes_on_from_a_setpoint_that_a_filter_corrected() -> None:
    """The turn that the filter began isn't undone at once: its next setpoint is nearly the same."""
    loop, point = LateralGuidance(DT_S), PathPoint(0.0, 0.0, 100.0, 0.0)
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    decided_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
    loop.go_on_from(0.2, decided_rad, state, MODEL)
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
    assert setpoint_rad == pytest.approx(0.2, abs=0.01)


def test_corrected_a_little_at_every_tick_it_still_comes_back_to_its_route() -> None:
    """A turn rate that began at none again at each tick could never grow."""
    loop = LateralGuidance(DT_S)
    state = FlightState(0.0, 40.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    for tick in range(400):
        point = PathPoint(state.north_m, 0.0, 100.0, 0.0)
        decided_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
        filtered_rad = decided_rad + (0.01 if tick % 2 else -0.01)
        advance(state, MODEL, SPEED_MPS, filtered_rad, 100.0, DT_S)
        loop.go_on_from(filtered_rad, decided_rad, state, MODEL)
    assert abs(state.east_m) < 2.0


@pytest.mark.parametrize("bends_1pm", [0.0, 0.002])
def test_the_turn_of_a_manoeuvre_is_not_continued(bends_1pm: float) -> None:
    """As fast as a vehicle can turn, and braked as gently as followers like, it would lead the vehicle round."""
    loop, point = LateralGuidance(DT_S), PathPoint(0.0, 0.0, 100.0, 0.0, bends_1pm)
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    for _ in range(20):  # it is commanded round to the right
        decided_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
        advance(state, MODEL, SPEED_MPS, 1.0, 100.0, DT_S)
        loop.go_on_from(1.0, decided_rad, state, MODEL)
    turned_rad = state.heading_rad
    assert turned_rad > 0.3
    setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
    assert setpoint_rad == pytest.approx(turned_rad + MODEL.tau_psi_s * bends_1pm * SPEED_MPS, abs=0.02)
    for _ in range(100):
        setpoint_rad = loop.setpoint_rad(point, state, MODEL, SPEED_MPS, TurnBounds(FOLLOWED_RPS2))
        advance(state, MODEL, SPEED_MPS, setpoint_rad, 100.0, DT_S)
        assert state.heading_rad < turned_rad + 0.1


def test_a_noisy_course_is_followed_slower() -> None:
    """Half a degree's noise leaves a fifth of what an exact course gives; so do followers that keep up with less."""
    assert TurnBounds().radps(SPEED_MPS) == TurnBounds(course_sigma_rad=1e-4).radps(SPEED_MPS) == 0.65
    assert TurnBounds(course_sigma_rad=math.radians(0.5)).radps(SPEED_MPS) == pytest.approx(0.185, abs=0.01)
    assert TurnBounds(0.005).radps(SPEED_MPS) == pytest.approx(0.235, abs=0.01)


@pytest.mark.parametrize("round_trip_s", [0.0, 0.1, 0.2])
def test_a_wind_that_grows_leads_as_far_off_with_delay_as_without(round_trip_s: float) -> None:
    """Known late, it is answered by a higher bandwidth; one for ever late, by no more than the highest."""
    radps = TurnBounds(FOLLOWED_RPS2, round_trip_s=round_trip_s).radps(SPEED_MPS)
    off_s2 = 2.0 / radps**2 + 2.0 * round_trip_s / radps + round_trip_s**2 / 2.0
    assert off_s2 == pytest.approx(2.0 / TurnBounds(FOLLOWED_RPS2).radps(SPEED_MPS) ** 2)
    assert 0.62 <= radps <= DELAYED_RADPS == TurnBounds(FOLLOWED_RPS2, round_trip_s=60.0).radps(SPEED_MPS)


def test_a_leader_whose_setpoints_are_held_up_turns_slower() -> None:
    """What a hold-up leaves undone is no more than that: p^2 falls with the root of the share of time in hold-ups."""
    assert TurnBounds(held_up=0.01).radps(SPEED_MPS) == 0.65
    twentieth, bursts = (TurnBounds(held_up=share).radps(SPEED_MPS) for share in (0.05, 0.2 * 5.0))
    assert twentieth == pytest.approx(0.447, abs=0.005)
    assert bursts**4 == pytest.approx(0.05 * twentieth**4)


def test_in_rough_air_the_bandwidth_is_higher_unless_hold_ups_bound_it() -> None:
    for round_trip_s in (0.0, 0.6):
        calm, rough = (TurnBounds(FOLLOWED_RPS2, round_trip_s=round_trip_s).radps(SPEED_MPS, each) for each in (0, 1))
        assert rough == ROUGH_RATIO * calm
    noisy = TurnBounds(course_sigma_rad=math.radians(0.5))
    assert noisy.radps(SPEED_MPS, 1.0) == pytest.approx(math.sqrt(ROUGH_NOISE_RATIO) * noisy.radps(SPEED_MPS))
    held_up = TurnBounds(held_up=0.05)
    assert held_up.radps(SPEED_MPS, 1.0) == held_up.radps(SPEED_MPS)


def test_a_vehicle_that_turned_meanwhile_is_steered_from_where_it_heads() -> None:
    """Its setpoint is no farther from its heading than what it turns by within its lag, at its limit."""
    loop, point = LateralGuidance(DT_S), PathPoint(0.0, 0.0, 100.0, 0.0)
    loop.setpoint_rad(point, FlightState(0, 0, 100, 0, SPEED_MPS, 0.0, 0, 0), MODEL, SPEED_MPS, TurnBounds())
    turned = FlightState(0, 0, 100, 0, SPEED_MPS, math.radians(90.0), 0, 0)
    setpoint_rad = loop.setpoint_rad(point, turned, MODEL, SPEED_MPS, TurnBounds())
    assert abs(math.remainder(setpoint_rad - turned.heading_rad, math.tau)) < 1.1 * 1.5 * TURN_RPS
