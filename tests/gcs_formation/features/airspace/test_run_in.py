"""The run-in where the scenario doesn't say how long it is."""

import pytest

AHEAD = "path.waypoints_m=[[0, 0, 100], [4000, 0, 100]]"


def fenced(back_m):
    return f"safety.fence={{corners_m: [[{-back_m}, -900], [{-back_m}, 900], [5000, 900], [5000, -900]]}}"


def test_a_fence_with_room_for_it_leaves_the_run_in_as_it_is(load):
    assert load(AHEAD, fenced(2000)).start.run_in_s == 60.0


@pytest.mark.parametrize("back_m", [500.0, 900.0, 1400.0])
def test_a_run_in_is_as_long_as_every_slot_has_room_to_turn_away_from_the_fence(load, refusal, back_m):
    run_in_s = load(AHEAD, fenced(back_m)).start.run_in_s
    # Where the last slot of a diamond of 30 m begins, a circle at 70 % of the turn rate has 25 m to the fence's side.
    assert 10.0 < run_in_s < (back_m - 25.0) / 22.0
    load(AHEAD, fenced(back_m), f"start.run_in_s={run_in_s}")
    assert refusal(AHEAD, fenced(back_m), f"start.run_in_s={run_in_s + 1.0}")


def test_a_run_in_that_is_given_is_kept_and_one_without_room_is_refused(load, refusal):
    assert load(AHEAD, fenced(900), "start.run_in_s=12").start.run_in_s == 12.0
    assert "outside the fence" in refusal(AHEAD, fenced(120))[0]
