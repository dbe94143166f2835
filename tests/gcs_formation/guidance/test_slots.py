"""Moving slots, and how they wait for vehicles that can't keep up."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.autopilot_model import rotated
from formation_scenario import load_scenario
from formation_scenario.fields import Frame
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, Transition, slot_needs
from gcs_formation.guidance.slots import WAITS_S, FormationPlan
from tests.flights.conftest import scenario

DURATION_S, TICK_S = 20.0, 0.1


@pytest.fixture
def plan() -> FormationPlan:
    """Return slots of which the last one moves 30 m back from 100 s on."""
    made = FormationPlan(load_scenario(scenario()))
    start = made.goal_m + np.array([[0.0, 0.0, 0.0]] * (len(made.goal_m) - 1) + [[30.0, 0.0, 0.0]])
    rest, lifts_m = SlotMotion.at_rest(start), np.zeros(len(start))
    made.adopt(made.arrangement, Transition(100.0, DURATION_S, rest, made.goal_m, lifts_m, 0.0))
    return made


def forward(plan: FormationPlan, now_s: float) -> tuple[float, float]:
    """Return how far ahead of its goal the last slot is, and how fast it moves."""
    slots = plan.at(now_s, begun=False)
    return float(slots.position_m[-1, 0] - plan.goal_m[-1, 0]), float(slots.velocity_mps[-1, 0])


def test_followers_begin_displaced_from_their_slots_and_the_leader_does_not() -> None:
    """Once the path has begun, no slot is displaced."""
    plan = FormationPlan(load_scenario(scenario(start={"in_air": True, "run_in_s": 6, "offset_m": [8, 6, 4]})))
    before, after = (plan.at(100.0, begun=begun).position_m for begun in (False, True))
    assert (before - after).tolist() == [[0.0, 0.0, 0.0], [8.0, 6.0, 4.0], [8.0, 6.0, 4.0]]
    assert after.tolist() == plan.goal_m.tolist()


def test_slots_that_wait_stand_and_go_on_where_they_were(plan: FormationPlan) -> None:
    at_m, mps = forward(plan, 108.0)
    assert mps < -1.0
    for tick in range(1, 51):
        plan.wait(0.0, TICK_S)
        assert forward(plan, 108.0 + tick * TICK_S) == pytest.approx((at_m, 0.0), abs=1e-9)
    plan.wait(1.0, TICK_S)
    assert forward(plan, 113.0) == pytest.approx((at_m, mps), abs=1e-9)
    assert not plan.settled(124.9)
    assert plan.settled(125.1)


def test_slots_at_half_their_pace_move_half_as_fast_as_they_say(plan: FormationPlan) -> None:
    _, mps = forward(plan, 108.0)
    plan.wait(0.5, 0.0)
    before_m, said_mps = forward(plan, 108.0)
    assert said_mps == pytest.approx(mps / 2)
    plan.wait(0.5, TICK_S)
    after_m, _ = forward(plan, 108.0 + TICK_S)
    assert (after_m - before_m) / TICK_S == pytest.approx(said_mps, rel=0.02)


def test_while_slots_move_their_distances_are_the_least_of_the_way_and_afterwards_none_is_planned() -> None:
    """The first two pass each other at 12 m on the way; of the third nothing is planned."""
    plan = FormationPlan(load_scenario(scenario()))
    rest, way_m = SlotMotion.at_rest(plan.goal_m), np.full((3, 3), np.inf)
    way_m[0, 1] = way_m[1, 0] = 12.0
    assert plan.separation_m(50.0) is None
    plan.adopt(plan.arrangement, Transition(100.0, DURATION_S, rest, plan.goal_m, np.zeros(3), 0.0, way_m))
    goal_m = np.linalg.norm(plan.goal_m[:, None] - plan.goal_m, axis=-1)
    moving_m = plan.separation_m(110.0)
    assert moving_m is not None
    assert moving_m[0, 1] == moving_m[1, 0] == 12.0 < goal_m[0, 1]
    assert moving_m[0, 2] == goal_m[0, 2]
    assert plan.separation_m(111.0) is moving_m
    assert plan.separation_m(100.0 + DURATION_S) is None
    plan.fly_alongside(np.array([False, True, False]), plan.goal_m)
    assert plan.separation_m(100.0 + DURATION_S) == pytest.approx(goal_m)


def test_slots_wait_for_no_longer_than_they_may(plan: FormationPlan) -> None:
    plan.at(108.0, begun=False)
    for _ in range(round(2 * WAITS_S / TICK_S)):
        plan.wait(0.0, TICK_S)
    assert not plan.settled(120.0 + WAITS_S - 0.1)
    assert plan.settled(120.0 + WAITS_S + 0.1)


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
def test_who_flies_beside_a_turning_leader_keeps_its_place_over_ground_at_the_leaders_own_speed(
    plan: FormationPlan, frame: Frame
) -> None:
    speed_mps, turn_rps = 22.0, 0.1
    last = np.arange(len(plan.goal_m)) == len(plan.goal_m) - 1
    positions_m = plan.goal_m + np.array([-30.0, 110.0, 5.0])
    plan.turn(200.0, turn_rps)
    plan.fly_alongside(last, np.where(last[:, None], positions_m, plan.goal_m))
    still = np.zeros(1)
    for elapsed_s in np.arange(0.0, 31.4, TICK_S):
        plan.turn(200.0 + elapsed_s, turn_rps)
        slots = plan.at(200.0 + elapsed_s, begun=True)
        north_east = rotated(-turn_rps * elapsed_s, slots.position_m[-1, 0], slots.position_m[-1, 1])
        assert north_east == pytest.approx(positions_m[-1, :2], abs=1e-6)
        assert slots.position_m[-1, 2] == positions_m[-1, 2]
        assert not plan.settled(200.0 + elapsed_s)
        needs = slot_needs(LeaderFlight(speed_mps, np.array([turn_rps]), still, still, still), slots, frame)
        assert needs.speed_mps[0, -1] == pytest.approx(speed_mps, abs=1e-6)
        assert needs.relative_heading_rad[0, -1] == pytest.approx(0.0, abs=1e-6)
        assert needs.accel_mps2[0, -1] == pytest.approx(0.0, abs=1e-6)
    plan.adopt(plan.arrangement, Transition.standing(plan.goal_m))
    assert not plan.alongside.any()
    assert plan.settled(240.0)
