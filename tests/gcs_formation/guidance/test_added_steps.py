"""Steps of the leader's heading, in a closed loop with model (7) and the guidance."""

import math

import pytest

from flight_model.autopilot_model import AutopilotModel, advance
from flight_model.flight_state import FlightState, Setpoint
from flight_model.spline import SplinePath
from formation_scenario.formation import Step
from gcs_formation.guidance.added_steps import AddedSteps
from gcs_formation.guidance.lateral import LateralGuidance, TurnBounds
from gcs_formation.guidance.tracking import project

DT_S, SPEED_MPS = 0.1, 20.0
MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.4, 3.0)
PATH = SplinePath([[0, 0, 100], [4000, 0, 100]])
DOUBLET = (Step(at_s=5, for_s=9, heading_deg=15), Step(at_s=14, for_s=9, heading_deg=-15))


def flown(steps: tuple[Step, ...], seconds: float, course_rad: float = 0.0) -> list[tuple[float, float]]:
    """Return the heading setpoint and the distance to the right of a straight path, at each tick."""
    lateral, added_steps = LateralGuidance(DT_S), AddedSteps(steps, DT_S)
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, course_rad, 0.0, 0.0)
    distance_m, commanded = 0.0, []
    for tick in range(round(seconds / DT_S)):
        steered = added_steps.without(state)
        distance_m = project(PATH, steered.north_m, steered.east_m, distance_m)
        heading = lateral.setpoint_rad(PATH.at(distance_m), steered, MODEL, SPEED_MPS, TurnBounds())
        wanted = Setpoint(SPEED_MPS, heading, 100.0)
        added_steps.add(wanted, tick * DT_S, state, MODEL)
        commanded.append((wanted.heading_rad, state.east_m))
        advance(state, MODEL, wanted.speed_mps, wanted.heading_rad, wanted.height_m, DT_S)
    return commanded


def test_a_step_of_heading_is_commanded_as_it_is_and_the_opposite_one_leads_back() -> None:
    commanded = flown(DOUBLET, 60.0)
    assert [heading for heading, _ in commanded[51:139]] == pytest.approx([math.radians(15)] * 88, abs=1e-3)
    assert [heading for heading, _ in commanded[141:229]] == pytest.approx([-math.radians(15)] * 88, abs=1e-3)
    # By (7) the heading is back at 0, where the distance is largest, tau ln 2 after the opposite step.
    to_side_m = SPEED_MPS * math.sin(math.radians(15)) * (9.0 - MODEL.tau_psi_s * math.log(2.0))
    assert max(right_m for _, right_m in commanded) == pytest.approx(to_side_m, rel=0.02)
    assert max(abs(right_m) for _, right_m in commanded[300:]) < 0.6


def test_without_the_opposite_step_the_guidance_leads_back() -> None:
    commanded = flown(DOUBLET[:1], 90.0)
    assert max(right_m for _, right_m in commanded) > 40.0
    assert abs(commanded[-1][1]) < 0.5


def test_a_leader_off_its_path_comes_back_while_a_step_lasts() -> None:
    """What steps don't explain is still corrected: here a course 20 degrees off the path's."""
    steps = (Step(at_s=0, for_s=60, heading_deg=5),)
    off = [a[1] - b[1] for a, b in zip(flown(steps, 30.0, math.radians(20)), flown(steps, 30.0), strict=True)]
    assert max(off) > 5.0
    assert abs(off[-1]) < 0.5


def test_nothing_is_left_of_steps_that_something_else_replaced() -> None:
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    added_steps = AddedSteps(DOUBLET, DT_S)
    for _ in range(20):
        added_steps.add(Setpoint(SPEED_MPS, 0.0, 100.0), 6.0, state, MODEL)
    assert added_steps.without(state).heading_rad < -0.1
    added_steps.drop_state()
    assert added_steps.without(state).values() == state.values()


@pytest.mark.parametrize("course_rad", [0.0, 2.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turn_at_the_limit_leads_to_the_side_as_far_as_an_arc_does(course_rad: float, side: float) -> None:
    """Five seconds at 0.1 rad/s turn by 0.5 rad, and lead v (1 - cos 0.5) / 0.1 to the side, in any direction."""
    turns_slowly = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.1, 3.0)
    added_steps = AddedSteps((Step(at_s=0, for_s=60, heading_deg=45 * side),), DT_S)
    state = FlightState(500.0, -300.0, 100.0, 0.0, SPEED_MPS, course_rad + 0.5 * side, 0.0, 0.0)
    for tick in range(50):
        added_steps.add(Setpoint(SPEED_MPS, course_rad, 100.0), tick * DT_S, state, turns_slowly)
    steered, to_side_m = added_steps.without(state), side * SPEED_MPS * (1.0 - math.cos(0.5)) / 0.1
    assert steered.heading_rad == pytest.approx(course_rad)
    assert state.north_m - steered.north_m == pytest.approx(-to_side_m * math.sin(course_rad), abs=0.01)
    assert state.east_m - steered.east_m == pytest.approx(to_side_m * math.cos(course_rad), abs=0.01)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_response_to_a_step_is_over_at_half_a_degree(side: float) -> None:
    """By (7), 10 degrees have become half a degree after tau ln 20 = 4.49 s; a step of 5 degrees begins with less."""
    state = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    for size_deg, ticks in ((10.0, 45), (5.0, 35)):
        added_steps = AddedSteps((Step(at_s=0, for_s=20, heading_deg=size_deg * side),), DT_S)
        for tick in range(200):
            added_steps.add(Setpoint(SPEED_MPS, 0.0, 100.0), tick * DT_S, state, MODEL)
        assert added_steps.without(state).heading_rad == pytest.approx(-math.radians(size_deg) * side, abs=1e-4)
        for _ in range(ticks - 1):
            added_steps.add(Setpoint(SPEED_MPS, 0.0, 100.0), 30.0, state, MODEL)
        assert abs(added_steps.without(state).heading_rad) == pytest.approx(math.radians(0.5), abs=1e-3)
        added_steps.add(Setpoint(SPEED_MPS, 0.0, 100.0), 30.0, state, MODEL)
        assert added_steps.without(state).values() == state.values()


@pytest.mark.parametrize(("at_s", "share"), [(math.nan, 0.0), (4.0, 0.0), (6.0, 1.0), (9.0, 0.0)])
def test_all_three_setpoints_are_stepped_while_the_step_lasts(at_s: float, share: float) -> None:
    added_steps = AddedSteps((Step(at_s=5, for_s=3, speed_mps=2, heading_deg=-10, height_m=5),), DT_S)
    state, wanted = FlightState(0.0, 0.0, 100.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0), Setpoint(SPEED_MPS, 1.0, 100.0)
    added_steps.add(wanted, at_s, state, MODEL)
    expected = SPEED_MPS + 2.0 * share, 1.0 - math.radians(10.0) * share, 100.0 + 5.0 * share
    assert (wanted.speed_mps, wanted.heading_rad, wanted.height_m) == pytest.approx(expected)
