"""Paths of legs of a scenario: turns that every slot can fly, what is refused, and the distance to the fence."""

import math

import numpy as np
import pytest

from formation_scenario import load_scenario
from formation_scenario.ground_and_fence import fence_distances
from formation_scenario.path_limits import SampledPath
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.turn_limits import SPEED_SHARE, TURN_SHARE, turn_limits
from gcs_formation.app.check_path import far_from_legs, path_figures, path_text

CORNER = "path.waypoints_m=[[0, 0, 100], [3000, 0, 100], [3000, 3000, 130]]"
STEEP = "path.waypoints_m=[[0, 0, 100], [3000, 0, 100], [3500, 0, 200], [6000, 0, 200]]"
LEGS = "path.kind=legs"


def limits_of(scenario):
    return turn_limits(scenario, slot_schedule(scenario), scenario.path.speed_mps, scenario.wind.speed_mps)


def test_a_leader_alone_turns_at_its_share_of_the_turn_rate_over_ground(load):
    alone = load_scenario({"vehicles": {"count": 1}, "path": {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}})
    windy = alone.model_copy(update={"wind": alone.wind.model_copy(update={"velocity_mps": (6.0, 0.0, 0.0)})})
    assert limits_of(alone).curvature_1pm == pytest.approx(TURN_SHARE * 0.25 / 22.0)
    assert limits_of(windy).curvature_1pm == pytest.approx(TURN_SHARE * 0.25 / 28.0)


def test_the_outermost_slot_of_any_planned_shape_decides_how_tight_a_turn_is(load):
    # In a line of three followers 30 m apart the farthest is 60 m to the right; 6 m/s are above the path's 22.
    line = limits_of(load("formation.shape=line"))
    assert 22.0 * line.curvature_1pm == pytest.approx(SPEED_SHARE * 6.0 / 60.0, rel=0.02)
    later = limits_of(load("formation.shape=follower", "formation.changes=[{at_s: 60, shape: line}]"))
    assert later == line


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
@pytest.mark.parametrize("shape", ["diamond", "line", "echelon"])
def test_every_slot_keeps_its_limits_in_every_turn(load, shape, frame):
    scenario = load(CORNER, LEGS, f"formation.shape={shape}", f"formation.frame={frame}", "path.turn=fly_over")
    flight = LeaderFlight.along(SampledPath.along(scenario.leader_path).points, 22.0)
    (step,) = slot_schedule(scenario)
    needs = slot_needs(flight, SlotMotion.at_rest(step.places_m[1:]), frame)
    assert np.abs(needs.speed_mps - 22.0).max() <= SPEED_SHARE * 6.0 + 1e-6
    assert np.abs(needs.accel_mps2).max() <= 1.5
    assert np.abs(needs.turn_rate_rps).max() <= 0.25
    assert np.abs(flight.turn_rate_rps).max() > 0.04


def test_a_multirotor_turns_as_tightly_as_its_acceleration_allows_at_its_speed():
    model = {"hovers": True, "speed_min_mps": 0, "speed_max_mps": 15, "turn_rate_max_rps": 1.5, "accel_max_mps2": 3}
    plain = {"vehicles": {"count": 1, "model": model}, "path": {"waypoints_m": [[0, 0, 50], [400, 0, 50]]}}
    for speed_mps in (5.0, 10.0):
        limits = limits_of(load_scenario(plain, [f"path.speed_mps={speed_mps}"]))
        assert speed_mps**2 * limits.curvature_1pm == pytest.approx(0.7 * 3.0)


def test_a_leg_too_steep_is_refused_with_the_length_that_it_needs_and_that_length_is_flown(refusal, load):
    (line,) = refusal(STEEP, LEGS)
    assert line.startswith("path.waypoints_m.2: found a leg of 500 m that climbs 100.0 m")
    needed_m = float(line.split("climb_max_mps: ")[1].split(" m or more")[0])
    for length_m, flown in ((needed_m + 1.0, True), (needed_m - 30.0, False)):
        longer = f"path.waypoints_m=[[0,0,100],[3000,0,100],[{3000 + length_m},0,200],[{6000 + length_m},0,200]]"
        if flown:
            load(longer, LEGS)
        else:
            assert refusal(longer, LEGS)
    assert load(STEEP, LEGS, "path.climb=circle").leader_path.length_m > 7000.0


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


def test_check_says_how_far_a_path_is_from_its_legs_and_warns_of_a_spline_alone(load):
    curve, legs = load(CORNER), load(CORNER, LEGS)
    assert any("from the straight legs" in text for text in far_from_legs(curve))
    assert not list(far_from_legs(legs))
    assert path_figures(curve)["off_legs_m"] > 3.0 * path_figures(legs)["off_legs_m"]
    assert path_figures(legs)["outside_heights_m"] == pytest.approx(0.0, abs=1e-6)
    text = "\n".join(path_text(legs))
    assert "1 turns inside a waypoint" in text
    assert f"{path_figures(legs)['off_legs_m']:.1f} m from its legs" in text


def test_five_hundred_waypoints_are_no_other_path_after_the_gains_are_designed(load):
    ends = [[[0, lane * 60, 100], [900, lane * 60, 100]][:: 1 if lane % 2 == 0 else -1] for lane in range(250)]
    waypoints = [end for lane in ends for end in lane]
    scenario = load_scenario(
        {"vehicles": {"count": 4}, "path": {"kind": "legs", "waypoints_m": waypoints}}, ["law.gains=auto"]
    )
    assert math.isclose(scenario.leader_path.at(scenario.leader_path.length_m).east_m, 249 * 60.0, abs_tol=0.01)


def test_turns_to_the_side_on_which_a_slot_is_slow_decide_as_well():
    model = {"speed_min_mps": 20.0, "speed_max_mps": 28.0}
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2, "model": model}]
    formation = {"shape": "custom", "slots_m": {2: [0, -60, 0]}}
    path = {"waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
    # The slot to the left is inside left turns alone, where 2 m/s below the path's 22 are left.
    limits = limits_of(load_scenario({"vehicles": vehicles, "formation": formation, "path": path}))
    assert 22.0 * limits.curvature_1pm == pytest.approx(SPEED_SHARE * 2.0 / 60.0, rel=0.02)
