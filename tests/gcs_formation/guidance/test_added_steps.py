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
