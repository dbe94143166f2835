"""Starts, steps of height and detours are planned inside the fence, or refused with time and place."""

from __future__ import annotations

import numpy as np
import pytest

from formation_scenario.fence_distances import fence_distances
from tests.formation_scenario.test_path_of_legs import LEGS
from tests.formation_scenario.test_steps import LOW, step


def test_detours_stay_inside_a_fence_that_leaves_them_room_on_one_side(load):
    lanes = "path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [2000, 60, 100], [0, 60, 100]]"
    fence = "safety.fence={corners_m: [[-900, -700], [-900, 700], [2600, 700], [2600, -700]], height_max_m: 130}"
    scenario = load(lanes, LEGS, fence, "start.run_in_s=10", "start.in_air=true")
    each = fence_distances(scenario)
    assert len(each) == 4
    assert min(slot.least_m for slot in each) > 25.0
    assert [slot.height_m for slot in each] == sorted(slot.height_m for slot in each)
    assert {slot.height_m for slot in each} == {30.0}
    leader = next(slot for slot in each if slot.who == "the leader")
    points = scenario.leader_path.at(np.linspace(0.0, scenario.leader_path.length_m, 4000))
    sides = np.stack((2600.0 - points.north_m, points.north_m + 900.0, 700.0 - np.abs(points.east_m)))
    assert leader.least_m == pytest.approx(sides.min(), abs=0.5)


def test_steps_stay_within_the_heights_of_the_fence(refusal):
    fence = "safety.fence={height_min_m: 20, height_max_m: 60}"
    (low,) = refusal(LOW, fence, f"path.steps=[{{{step(height_m=-25)}}}]")
    assert low.endswith("the leader is 15.0 m high; 20 m or more (safety.fence.height_min_m)")
    above = "formation={shape: custom, slots_m: {2: [-30, 0, 10], 3: [-60, 0, 0], 4: [-90, 0, 5]}}"
    (high,) = refusal(LOW, fence, above, f"path.steps=[{{{step(height_m=15)}}}]")
    assert high.endswith("the highest slot is 65.0 m high; 60 m or less (safety.fence.height_max_m)")


@pytest.mark.parametrize(
    ("offset_m", "fence", "line"),
    [
        ("[0, 0, 80]", "{height_max_m: 150}", "vehicle 2 begins at 180.0 m; 150 m or less (safety.fence.height_max_m)"),
        ("[0, 0, -40]", "{height_min_m: 70}", "vehicle 2 begins at 60.0 m; 70 m or more (safety.fence.height_min_m)"),
        (
            "[0, 900, 0]",
            "{corners_m: [[-900, -800], [9000, -800], [9000, 800], [-900, 800]]}",
            "vehicle 3 begins 130 m outside the fence; inside it (safety.fence.corners_m)",
        ),
    ],
)
def test_a_start_in_the_air_is_inside(refusal, offset_m, fence, line):
    for in_air in ("true", "false"):  # not in the air they assemble after a take-off
        start = f"start={{in_air: {in_air}, offset_m: {offset_m}, run_in_s: 10}}"
        assert refusal(start, f"safety.fence={fence}") == [f"start.offset_m: {line}"]
