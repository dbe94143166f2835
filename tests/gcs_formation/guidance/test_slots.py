"""Moving slots, and how they wait for vehicles that can't keep up."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.arrays import Array
from flight_model.autopilot_model import rotated
from formation_scenario import load_scenario
from formation_scenario.fields import Frame
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, Transition, slot_needs
from gcs_formation.guidance.slots import FormationPlan
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
    """30 s altogether (docs/formations.md), and as long again in the next change."""
    plan.at(108.0, begun=False)
    for _ in range(round(60.0 / TICK_S)):
        plan.wait(0.0, TICK_S)
    assert not plan.settled(149.9)
    assert plan.settled(150.1)
    goal_m = plan.goal_m + np.array([0.0, 10.0, 0.0])
    still = SlotMotion.at_rest(plan.goal_m)
    plan.adopt(plan.arrangement, Transition(200.0, DURATION_S, still, goal_m, np.zeros(len(goal_m)), 0.0))
    for _ in range(200):
        plan.wait(0.5, TICK_S)
    assert not plan.settled(229.9)
    assert plan.settled(230.1)


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


def over_ground(slots_m: Array, heading_rad: float) -> Array:
    """Return the positions north, east and up of the first vehicle, for a leader that heads there."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    turned = np.stack((slots_m[:, 0] * cos - slots_m[:, 1] * sin, slots_m[:, 0] * sin + slots_m[:, 1] * cos), axis=1)
    return np.column_stack((turned - turned[0], slots_m[:, 2] - slots_m[0, 2]))


@pytest.mark.parametrize("now_s", [90.0, 107.3, 130.0])
@pytest.mark.parametrize(("begun", "swing_rad"), [(True, 0.4), (True, -2.0), (False, 0.0), (False, 0.4), (False, -2.0)])
def test_another_leader_changes_no_position_over_ground(now_s: float, begun: bool, swing_rad: float) -> None:
    """Nor any velocity; its own slot is where it is, however much its heading differs."""
    plan = FormationPlan(load_scenario(scenario(start={"in_air": True, "run_in_s": 6, "offset_m": [8, 6, 4]})))
    start = SlotMotion.at_rest(plan.goal_m + np.array([[0.0, 0.0, 0.0], [20.0, 5.0, 0.0], [-9.0, 0.0, 3.0]]))
    plan.adopt(plan.arrangement, Transition(100.0, DURATION_S, start, plan.goal_m, np.zeros(3), 0.0))
    before, goal_m = plan.at(now_s, begun=begun), plan.goal_m
    seen = plan.seen_from(2, swing_rad, now_s)
    plan.hand_over(2, swing_rad)
    after = plan.at(now_s, begun=begun)
    assert plan.leader == 2
    assert after.position_m[2] == pytest.approx(np.zeros(3))
    assert over_ground(after.position_m, 0.7 + swing_rad) == pytest.approx(over_ground(before.position_m, 0.7))
    assert over_ground(after.velocity_mps, 0.7 + swing_rad) == pytest.approx(over_ground(before.velocity_mps, 0.7))
    assert over_ground(plan.goal_m, 0.7 + swing_rad) == pytest.approx(over_ground(goal_m, 0.7))
    assert seen.position_m == pytest.approx(plan.at(now_s, begun=True).position_m)
    assert plan.settled(now_s) == (now_s >= 120.0)


@pytest.mark.parametrize("pace", [1.0, 0.6, 0.25])
def test_velocity_and_acceleration_are_the_derivatives_of_the_position_at_any_pace(pace: float) -> None:
    """While all slots wait alike: a second of theirs takes 1 / pace."""
    step_s, now_s, moved = 0.05, 104.0, FormationPlan(load_scenario(scenario()))
    start = moved.goal_m + np.array([[0.0, 0.0, 0.0]] * (len(moved.goal_m) - 1) + [[30.0, 0.0, 0.0]])
    at_rest, lifts_m = SlotMotion.at_rest(start), np.zeros(len(start))

    def later(by_s: float) -> SlotMotion:
        moved.adopt(moved.arrangement, Transition(100.0, DURATION_S, at_rest, moved.goal_m, lifts_m, 0.0))
        moved.wait(pace, by_s)
        return moved.at(now_s + by_s, begun=True)

    before, here, after = later(0.0), later(step_s), later(2.0 * step_s)
    velocity = (after.position_m - before.position_m) / (2.0 * step_s)
    acceleration = (after.velocity_mps - before.velocity_mps) / (2.0 * step_s)
    assert np.abs(velocity).max() > 0.2 * pace
    assert np.abs(acceleration).max() > 0.2 * pace**2
    assert here.velocity_mps == pytest.approx(velocity, abs=2e-3)
    assert here.acceleration_mps2 == pytest.approx(acceleration, abs=2e-2 * pace**2)


def test_each_slot_may_be_asked_for_at_a_time_of_its_own(plan: FormationPlan) -> None:
    """Between moments 0.05 s apart slots go on at constant acceleration: a jerk of 0.3 m/s³ is off by 1 µm then."""
    for each_s in ([106.0, 107.02, 105.983], [99.9, 103.0, 119.99], [107.49, 107.5, 118.74], [130.0, 131.0, 132.0]):
        found = plan.at_each(each_s, begun=True)
        for index, at_s in enumerate(each_s):
            exact = plan.at(at_s, begun=True)
            assert found.position_m[index] == pytest.approx(exact.position_m[index], abs=1e-6)
            assert found.velocity_mps[index] == pytest.approx(exact.velocity_mps[index], abs=2e-4)
            assert found.acceleration_mps2[index] == pytest.approx(exact.acceleration_mps2[index], abs=2e-2)


def test_slots_at_rest_are_the_same_object_until_something_changes(plan: FormationPlan) -> None:
    """What is computed from them need not be computed again."""
    plan.offset_m[1] = 5.0
    resting, waiting = plan.at(130.0, begun=True), plan.at(131.0, begun=False)
    assert waiting is plan.at(132.0, begun=False)
    assert (waiting.position_m - resting.position_m)[1].tolist() == [5.0] * 3
    again = plan.at(133.0, begun=True)
    assert again is plan.at(134.0, begun=True)
    assert again.position_m.tolist() == resting.position_m.tolist()
    moving = plan.at(105.0, begun=True)
    assert moving.position_m.tolist() != resting.position_m.tolist()
    plan.adopt(plan.arrangement, Transition.standing(plan.goal_m + 1.0))
    assert plan.at(135.0, begun=True).position_m == pytest.approx(resting.position_m + 1.0)


def test_a_flight_is_resumed_in_the_nearest_slots_with_the_changes_that_are_left() -> None:
    """Slots are assigned by where vehicles are; the change that was due at 300 s has been made."""
    changes = [{"at_s": 500, "spacing_m": 60}, {"at_s": 300, "spacing_m": 50}, {"at_s": 700, "spacing_m": 40}]
    keys = {"formation": {"shape": "arrow", "spacing_m": 30, "changes": changes}, "duration_s": 1000}
    made = load_scenario(scenario(start={"in_air": True, "run_in_s": 6, "offset_m": [8, 6, 4]}, **keys))
    plan = FormationPlan(made)
    assert [each.at_s for each in plan.scheduled] == [300, 500, 700]
    swapped = plan.goal_m[[0, 2, 1]]
    plan.resume(made, plan.arrangement, swapped, 300.0)
    assert [each.at_s for each in plan.scheduled] == [500, 700]
    assert plan.goal_m == pytest.approx(swapped)
    assert plan.settled(0.0)
    plan.resume(made, plan.arrangement._replace(leader=1), swapped, 499.0)
    assert [each.at_s for each in plan.scheduled] == [500, 700]
    displaced_m = plan.at(0.0, begun=False).position_m - plan.goal_m
    assert displaced_m.tolist() == [[-8.0, -6.0, -4.0], [0.0] * 3, [0.0] * 3]


@pytest.mark.parametrize(("frame", "turns"), [("leader_heading", True), ("north", False)])
def test_slots_alongside_turn_in_a_frame_that_turns_and_by_what_it_has_turned(frame: str, turns: bool) -> None:
    """Right at first, then left: what matters is the angle. Who joins later starts from where it is."""
    plan = FormationPlan(load_scenario(scenario(formation={"shape": "arrow", "spacing_m": 30, "frame": frame})))
    first, second = np.array([False, True, False]), np.array([False, False, True])
    start_m = plan.goal_m + np.array([[0.0, 0.0, 0.0], [0.0, 40.0, 5.0], [0.0, 40.0, -6.0]])
    plan.turn(10.0, 0.1)
    plan.fly_alongside(first, start_m)
    plan.turn(13.0, -0.2)
    plan.turn(14.0, -0.2)
    swing_rad = (0.3 - 0.2) if turns else 0.0
    plan.fly_alongside(second, start_m)
    assert plan.alongside.tolist() == [False, True, True]
    slots = plan.at(14.0, begun=True)
    assert slots.position_m[1, :2] == pytest.approx(rotated(swing_rad, *start_m[1, :2]))
    assert slots.position_m[2] == pytest.approx(start_m[2])
    assert slots.position_m[0] == pytest.approx(np.zeros(3))
    step_s = 1e-3
    after, before = plan.at(14.0 + step_s, begun=True), plan.at(14.0 - step_s, begun=True)
    assert slots.velocity_mps == pytest.approx((after.position_m - before.position_m) / (2.0 * step_s), abs=1e-6)
    assert slots.acceleration_mps2 == pytest.approx((after.velocity_mps - before.velocity_mps) / 2e-3, abs=1e-6)
    assert bool(slots.velocity_mps.any()) == turns


def test_who_flies_alongside_a_leader_that_has_not_turned_yet_stays_where_it_is() -> None:
    plan = FormationPlan(load_scenario(scenario()))
    start_m = plan.goal_m + np.array([[0.0, 0.0, 0.0], [0.0, 40.0, 5.0], [0.0, 0.0, 0.0]])
    plan.fly_alongside(np.array([False, True, False]), start_m)
    for now_s in (0.0, 10.0):
        assert plan.at(now_s, begun=True).position_m == pytest.approx(start_m)
    assert not plan.at(10.0, begun=True).velocity_mps.any()


def test_distances_of_goals_that_moved_are_computed_again_and_slots_before_their_goals_are_not_settled() -> None:
    plan = FormationPlan(load_scenario(scenario()))
    last = np.array([False, False, True])
    plan.fly_alongside(last, plan.goal_m)
    near_m = plan.separation_m(10.0)
    plan.goal_m = 2.0 * plan.goal_m
    far_m = plan.separation_m(10.0)
    assert near_m is not None
    assert far_m == pytest.approx(2.0 * near_m)
    still = SlotMotion.at_rest(plan.goal_m)
    plan.adopt(plan.arrangement, Transition(100.0, DURATION_S, still, plan.goal_m, np.zeros(3), 0.0, 0.5 * far_m))
    assert plan.separation_m(110.0) == pytest.approx(0.5 * far_m)
    plan.goal_m = plan.goal_m + np.array([0.0, 1.0, 0.0])
    assert plan.at_rest(120.0)
    assert not plan.settled(130.0)
    plan.goal_m = plan.goal_m - np.array([0.0, 1.0, 0.0])
    assert plan.settled(130.0), "equal to where they rest, though not the same array"
