"""Paths of legs of a scenario: turns that every slot can fly, and what is refused."""

import math

import numpy as np
import pytest

from flight_model.legs.deviation import deviation
from formation_scenario import load_scenario
from formation_scenario.planned_progress import path_end_s, planned_m
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.turn_limits import SPEED_SHARE, TURN_SHARE, turn_limits
from gcs_formation.app.check_path import far_from_legs, path_figures, path_text, short_legs, widened_circles

CORNER = "path.waypoints_m=[[0, 0, 100], [3000, 0, 100], [3000, 3000, 130]]"
STEEP = "path.waypoints_m=[[0, 0, 100], [3000, 0, 100], [3500, 0, 200], [6000, 0, 200]]"
LEGS = "path.kind=legs"


def limits_of(scenario):
    return turn_limits(scenario, slot_schedule(scenario), scenario.path.begin_mps, scenario.wind.speed_mps)


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
    needs = slot_needs(flight, SlotMotion.at_rest(step.positions_m[1:]), frame)
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


@pytest.mark.parametrize("degrees", [10, 20, 40, 60, 90, 150])
@pytest.mark.parametrize("speed_mps", [18, 22, 26])
def test_a_corner_of_any_angle_is_flown_at_any_speed(load, degrees, speed_mps):
    north_m, east_m = 3000.0 * math.cos(math.radians(degrees)), 3000.0 * math.sin(math.radians(degrees))
    corner = f"path.waypoints_m=[[0, 0, 100], [3000, 0, 100], [{3000.0 + north_m}, {east_m}, 100]]"
    assert load(corner, LEGS, f"path.speed_mps={speed_mps}").written_path.tightest_m < math.inf


def test_the_speed_of_each_leg_makes_the_planned_time_and_the_turns(load):
    one, other = (load(CORNER, LEGS, f"path.speed_mps={speed}") for speed in ("22", "[22, 18]"))
    slow_m = other.leader_path.length_m - other.path.waypoints_m[1][0]
    longer_s = path_end_s(other) - path_end_s(one)
    assert longer_s == pytest.approx(slow_m / 18.0 - slow_m / 22.0, rel=0.15)
    assert planned_m(other, np.array([path_end_s(other)])) == pytest.approx(other.leader_path.length_m, abs=0.1)
    assert other.written_path.tightest_m == one.written_path.tightest_m  # the turn is flown at the speed before it


def test_speeds_that_do_not_fit_the_legs_or_the_vehicles_are_refused(refusal):
    assert refusal(CORNER, LEGS, "path.speed_mps=[22, 20, 18]") == [
        "path.speed_mps: found 3 speeds; 2, one a leg, or a number"
    ]
    (kind,) = refusal(CORNER, "path.speed_mps=[22, 20]")
    assert kind == "path.speed_mps: found a list, one a leg; a number, or kind: legs"
    (fast,) = refusal(CORNER, LEGS, "path.speed_mps=[22, 40]")
    assert "found 40 m/s; 16 to 28 m/s" in fast


def test_a_leg_too_short_for_its_speed_is_said(load):
    short = "path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [2200, 0, 100], [4000, 0, 100]]"
    (said,) = short_legs(load(short, LEGS, "path.speed_mps=[18, 26, 18]"))
    assert said.startswith("path.speed_mps.1: 26 m/s isn't reached on so short a leg")


def test_turns_after_short_legs_are_planned_for_the_speed_that_is_reached():
    scenario = load_scenario(
        {
            "vehicles": {"count": 4, "model": "arduplane", "autopilot": "arduplane"},
            "formation": {"shape": "diamond", "spacing_m": 20},
            "path": {
                "kind": "legs",
                "speed_mps": [24, 17, 20],
                "waypoints_m": [[0, 0, 50], [1500, 0, 50], [1900, 400, 50], [4000, 400, 50]],
            },
        }
    )
    assert 17.0 < scenario.short_legs[1] < 24.0


@pytest.mark.parametrize("separation_m", [40, 100, 300])
def test_a_detour_between_near_lanes_may_stay_half_as_far_off_them(load, separation_m):
    lanes = f"path.waypoints_m=[[0, 0, 100], [1500, 0, 100], [1500, {separation_m}, 100], [0, {separation_m}, 100]]"
    shortest, nearest = (load(lanes, LEGS, f"path.detour={which}") for which in ("shortest", "nearest"))
    off_m = [deviation(each.written_path, each.path.waypoints_m).off_legs_m for each in (shortest, nearest)]
    assert off_m[1] < 0.65 * off_m[0]
    assert nearest.written_path.length_m > shortest.written_path.length_m
    for scenario in (shortest, nearest):  # both lanes are flown whole
        (detour,) = scenario.written_path.passed
        assert detour.begin_m == pytest.approx(1500.0)
        assert scenario.written_path.length_m - detour.begin_m - detour.length_m == pytest.approx(1500.0)


def test_what_limits_a_steep_leg_is_said(refusal):
    (steep,) = refusal("path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [2120, 0, 148], [4000, 0, 148]]", LEGS)
    assert "found a leg of 120 m that climbs 48.0 m, 8.8 m/s; up to 3 m/s, vehicle 1's climb_max_mps" in steep
    (short,) = refusal("path.waypoints_m=[[0, 0, 100], [2000, 0, 100], [2120, 0, 108], [4000, 0, 108]]", LEGS)
    assert "found a leg of 120 m that climbs 8.0 m; 125 m or more for that height: 59 m at 3 m/s" in short
    assert "and 66 m to round its ends" in short


@pytest.mark.parametrize(("gap_m", "height_m"), [(3.0, 100.8), (100.0, 103.0)])
def test_all_heights_of_waypoints_that_one_turn_passes_are_flown(load, height_m, gap_m):
    corner = [[0, 0, 100], [2000, 0, 100], [2000 + gap_m, gap_m, height_m], [2000 + gap_m, 3000, height_m]]
    path = load(f"path.waypoints_m={corner}", LEGS).written_path
    assert [(each.first, each.last) for each in path.passed] == [(1, 2)]
    for at_m, (_, _, wanted_m) in zip(path.waypoints_at_m, corner, strict=True):
        assert path.at(float(at_m)).height_m == pytest.approx(wanted_m, abs=0.5)


@pytest.mark.parametrize(
    "waypoints", ["[[0, 0, 100], [2500, 0, 100], [5000, 0, 100]]", "[[0, 0, 100], [2500, 0, 100], [2900, 0, 100]]"]
)
def test_circles_that_are_asked_for_are_not_off_the_legs(load, waypoints):
    """Those around a waypoint, and those that touch one that is too near to the next."""
    scenario = load(f"path.waypoints_m={waypoints}", LEGS, "path.circles=[{waypoint: 1, turns: 2, radius_m: 500}]")
    assert scenario.written_path.circle_radii_m[1] == pytest.approx(500.0)
    assert deviation(scenario.written_path, scenario.path.waypoints_m).off_legs_m < 1.0


LOITER = "path.waypoints_m=[[0, 0, 100], [2500, 0, 100], [2500, 2500, 100]]"


@pytest.mark.parametrize(("radius_m", "left", "quarters"), [(400, False, 9), (-400, True, 11), (0, False, 9)])
def test_circles_are_around_their_waypoint_with_their_radius_and_turns_to_their_side(load, radius_m, left, quarters):
    path = load(LOITER, LEGS, f"path.circles=[{{waypoint: 1, turns: 2, radius_m: {radius_m}}}]").written_path
    (passed,) = path.passed
    assert passed.kind == "circle"
    points = path.at(np.linspace(passed.begin_m, passed.begin_m + passed.length_m, 5000))
    arc = np.abs(points.curvature_1pm) > np.abs(points.curvature_1pm).max() * (1.0 - 1e-6)
    from_m = np.hypot(points.north_m - 2500.0, points.east_m)[arc]
    assert np.ptp(from_m) < 0.1
    assert from_m[0] == pytest.approx(abs(radius_m) or path.tightest_m, abs=0.1)
    assert (points.curvature_1pm[arc] < 0.0).all() == left
    # The next leg is a quarter to the right of the first; both are tangents, a little off these.
    turned = np.unwrap(points.course_rad)
    assert abs(turned[-1] - turned[0]) == pytest.approx(quarters * math.pi / 2.0, abs=0.4)
    assert points.height_m == pytest.approx(100.0)
    begin, end = path.at(passed.begin_m - 1.0), path.at(passed.begin_m + passed.length_m + 1.0)
    for point, other in ((begin, (0.0, 0.0)), (end, (2500.0, 2500.0))):
        bearing = math.atan2(point.east_m - other[1], point.north_m - other[0])
        assert abs(math.sin(point.course_rad - bearing)) < 1e-6


def test_a_path_may_end_with_circles_and_go_from_circles_to_circles(load):
    circles = "path.circles=[{waypoint: 1, turns: 1, radius_m: 300}, {waypoint: 2, turns: 3, radius_m: -350}]"
    scenario = load(LOITER, LEGS, circles)
    path = scenario.written_path
    assert [(each.first, each.kind) for each in path.passed] == [(1, "circle"), (2, "circle")]
    assert len(path.waypoints_at_m) == 3
    begin_m = path.passed[1].begin_m
    points = path.at(np.linspace(begin_m, path.length_m, 5000))
    assert np.hypot(points.north_m - 2500.0, points.east_m - 2500.0).min() == pytest.approx(350.0, abs=0.5)
    turned = np.unwrap(points.course_rad)
    assert turned[-1] - turned[0] == pytest.approx(-6.0 * math.pi, abs=1e-3)


def test_circles_where_the_leg_begins_inside_them_touch_their_waypoint(load):
    near = "path.waypoints_m=[[0, 0, 100], [2500, 0, 100], [2600, 0, 100], [2600, 2500, 100]]"
    path = load(near, LEGS, "path.circles=[{waypoint: 1, turns: 1, radius_m: 300}]").written_path
    assert "circle" not in {each.kind for each in path.passed}
    assert path.length_m > 2600.0 + 2500.0 + math.tau * 300.0 - 1000.0


def test_circles_too_tight_for_the_slots_are_widened_which_is_said(load):
    scenario = load(LOITER, LEGS, "path.circles=[{waypoint: 1, turns: 1, radius_m: 50}]")
    (said,) = widened_circles(scenario)
    radius_m = 1.0 / limits_of(scenario).curvature_1pm
    assert said.startswith(f"path: circles at waypoint 1 have a radius of {radius_m:.0f} m, not 50")


def test_circles_climb_to_their_waypoint_where_no_turns_are_asked_for(load):
    steep = "path.waypoints_m=[[0, 0, 100], [2500, 0, 500], [2500, 2500, 500]]"
    assert load(steep, LEGS, "path.circles=[{waypoint: 1, turns: 0}]").leader_path.length_m > 5000.0


def test_circles_without_legs_waypoint_or_room_are_refused(refusal):
    one = "path.circles=[{waypoint: 1}]"
    assert refusal(LOITER, one) == ["path.circles.0: found circles; with path.kind: legs"]
    assert refusal(LOITER, LEGS, "path.circles=[{waypoint: 3}]") == [
        "path.circles.0.waypoint: found 3; 1 to 2, once each"
    ]
    short = "path.waypoints_m=[[0, 0, 100], [300, 0, 100], [300, 2500, 100]]"
    (found,) = refusal(short, LEGS, "path.circles=[{waypoint: 1, radius_m: 2000}]")
    assert "found no room for circles on the leg to it" in found
