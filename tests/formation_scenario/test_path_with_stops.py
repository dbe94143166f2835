"""Paths of legs of formations that hover: what a scenario's vehicles, slots and keys make of them."""

import json
import math

import numpy as np
import pytest

from flight_model.legs.deviation import deviation
from flight_model.stops.timetable import Timetable
from formation_scenario import ScenarioError, load_scenario
from formation_scenario.planned_progress import path_end_s, planned_m
from formation_scenario.sampled_path import with_turns
from gcs_formation.app.check_path import path_text
from gcs_formation.app.export_path import export_path

SQUARE = [[0, 0, 30], [150, 0, 30], [150, 100, 30], [0, 100, 30]]


def hovering(waypoints=SQUARE, spacing_m=12, vehicles=None, more=None, **path):
    return load_scenario(
        {
            "vehicles": vehicles or {"count": 4, "model": "arducopter", "autopilot": "arducopter"},
            "formation": {"shape": "diamond", "spacing_m": spacing_m},
            "path": {"kind": "legs", "speed_mps": 5.0, "waypoints_m": waypoints} | path,
            "safety": {"separation_m": 3, "clearance_m": 5},
        }
        | (more or {})
    )


def lanes(separation_m):
    ends = [[0.0, 150.0], [150.0, 0.0]]
    return [[north, lane * separation_m, 30.0] for lane in range(3) for north in ends[lane % 2]]


@pytest.mark.parametrize("separation_m", [10, 20, 40])
@pytest.mark.parametrize("speed_mps", [5, 9])
def test_lanes_nearer_than_two_radii_are_flown_whole_and_without_loops(separation_m, speed_mps):
    fast = {"hovers": True, "speed_min_mps": 0, "speed_max_mps": 15, "accel_max_mps2": 2.5, "tau_v_s": 0.6}
    model = fast | {"tau_psi_s": 0.6, "tau_ha_s": 0.7, "tau_hb_s": 0.7, "turn_rate_max_rps": 0.4, "climb_max_mps": 1.5}
    vehicles = {"count": 4, "model": model, "autopilot": "arducopter"}
    scenario = hovering(lanes(separation_m), vehicles=vehicles, speed_mps=speed_mps)
    assert deviation(scenario.written_path, lanes(separation_m)).off_legs_m < 1e-6
    assert scenario.written_path.length_m == pytest.approx(3 * 150 + 2 * separation_m)


def test_corners_with_room_are_flown_through_within_what_the_farthest_slot_can_accelerate():
    scenario = hovering()
    model = scenario.vehicles[0].model
    path = scenario.written_path
    assert [each.kind for each in path.passed] == ["turn", "turn"]
    points = path.at(np.linspace(0.0, path.length_m, 5000))
    speed = 5.0
    turn, change = speed * points.curvature_1pm, speed**2 * points.curvature_rate_1pm2
    for forward_m, right_m in ((-24.0, 0.0), (-12.0, 12.0), (-12.0, -12.0)):
        along = -change * right_m - turn**2 * forward_m
        across = speed * turn + change * forward_m - turn**2 * right_m
        assert np.hypot(along, across).max() <= 0.75 * model.accel_max_mps2


def test_the_planned_time_has_the_stops_holds_and_turns():
    through, stopped, held = (
        path_end_s(hovering(stops=each)) for each in ([], [{"waypoint": 1}], [{"waypoint": 1, "hold_s": 25}])
    )
    assert held == pytest.approx(stopped + 25.0)
    assert stopped > through + 5.0
    scenario = hovering(stops=[{"waypoint": 1, "hold_s": 25}])
    (pause,) = scenario.speeds.pauses
    times = np.array([pause.begin_s, (pause.begin_s + pause.end_s) / 2.0, pause.end_s])
    assert planned_m(scenario, times) == pytest.approx([150.0] * 3, abs=1e-6)


@pytest.mark.parametrize("turn", ["stop", "fly_over"])
def test_every_waypoint_is_stopped_at_where_that_is_asked(turn):
    assert [each.kind for each in hovering(turn=turn).written_path.passed] == ["stop", "stop"]


def test_speeds_of_legs_are_flown_and_what_is_too_short_is_said():
    scenario = hovering([[0, 0, 30], [150, 0, 30], [160, 0, 30], [400, 0, 30]], speed_mps=[4.0, 8.0, 3.0])
    at_m = np.array([50.0, 300.0])
    assert scenario.speeds.at_each(at_m) == pytest.approx([4.0, 3.0])
    assert list(scenario.short_legs) == [1]


def test_steep_legs_are_flown_more_slowly_where_circles_may_be_flown():
    steep = [[0, 0, 30], [100, 0, 30], [160, 0, 60], [260, 0, 60]]
    with pytest.raises(ScenarioError, match=r"climbs 30\.0 m"):
        hovering(steep)
    scenario = hovering(steep, climb="circle")
    assert scenario.speeds.at(130.0)[0] < 2.5
    assert deviation(scenario.written_path, steep).off_legs_m < 1e-6


def test_samples_of_a_turn_in_place_stay_at_its_point_while_the_course_turns():
    path = hovering(stops=[{"waypoint": 1}]).written_path
    at_m, points = with_turns(path, np.array([0.0, 149.0, 151.0]))
    turned = at_m == 150.0
    assert turned.sum() > 10
    assert points.north_m[turned] == pytest.approx(150.0)
    assert points.course_rad[turned] == pytest.approx(np.linspace(0.0, math.pi / 2, int(turned.sum())))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"stops": [{"waypoint": 3}]}, "found 3; allowed: 1 to 2, once each"),
        ({"stops": [{"waypoint": 1}, {"waypoint": 1}]}, "found 1 again"),
        ({"kind": "spline", "stops": [{"waypoint": 1}]}, "found stops; allowed: with path.kind: legs"),
        ({"kind": "spline", "turn": "stop"}, "found stops; allowed: with path.kind: legs"),
    ],
)
def test_stops_that_can_not_be_made_are_refused(keys, said):
    with pytest.raises(ScenarioError, match=said):
        hovering(**keys)


def test_a_first_leg_too_short_to_brake_on_is_refused_with_the_length_that_would_do():
    with pytest.raises(ScenarioError, match="found 5 m to brake on from 5 m/s before a stop; allowed: 15 m or more"):
        hovering([[0, 0, 30], [5, 0, 30], [5, 100, 30]], turn="stop")
    hovering([[0, 0, 30], [15.1, 0, 30], [15.1, 100, 30]], turn="stop")


@pytest.mark.parametrize("keys", [{"turn": "stop"}, {"stops": [{"waypoint": 1}]}])
def test_aircraft_that_can_not_hover_do_not_stop(keys):
    with pytest.raises(ScenarioError, match="found stops of vehicles that can't hover"):
        load_scenario(
            {
                "vehicles": {"count": 2},
                "path": {"kind": "legs", "waypoints_m": [[0, 0, 100], [2000, 0, 100], [2000, 2000, 100]]} | keys,
            }
        )


MISSION = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t35.0\t125.0\t10\t1
1\t0\t3\t16\t0\t0\t0\t0\t35.0\t125.0\t30\t1
2\t0\t3\t16\t5\t0\t0\t0\t35.001\t125.0\t30\t1
3\t0\t3\t16\t0\t0\t0\t0\t35.001\t125.0005\t30\t1
4\t0\t3\t93\t7\t-1\t-1\t-1\t0\t0\t0\t1
5\t0\t3\t19\t8\t0\t20\t0\t35.0\t125.0005\t35\t1
6\t0\t3\t16\t9\t0\t0\t0\t35.0\t125.001\t35\t1
"""


def of_file(tmp_path, vehicles):
    (tmp_path / "m.waypoints").write_text(MISSION)
    (tmp_path / "m.yaml").write_text(
        json.dumps(
            {
                "vehicles": vehicles,
                "path": {"file": "m.waypoints", "speed_mps": 5 if "copter" in vehicles["model"] else 20},
                "formation": {"spacing_m": 12},
                "safety": {"separation_m": 3, "clearance_m": 5},
            }
        )
    )
    return load_scenario(tmp_path / "m.yaml", flown=True)


def test_times_at_points_of_a_mission_are_hovered(tmp_path):
    scenario = of_file(tmp_path, {"count": 3, "model": "px4_copter", "autopilot": "px4"})
    assert {each.waypoint: each.hold_s for each in scenario.path.stops} == {1: 5.0, 2: 7.0, 3: 8.0}
    assert not scenario.path.circles
    assert isinstance(scenario.speeds, Timetable)
    assert any("item 6: a stop where the path begins or ends isn't flown" in each for each in scenario.path.not_flown)
    export_path(scenario, tmp_path / "back.waypoints")
    holds = [float(line.split("\t")[4]) for line in (tmp_path / "back.waypoints").read_text().splitlines()[2:]]
    assert holds == [0.0, 5.0, 7.0, 8.0, 0.0]


def test_aircraft_circle_for_the_time_of_a_loiter_and_fly_on_at_waypoints(tmp_path):
    scenario = of_file(tmp_path, {"count": 3, "model": "arduplane", "autopilot": "arduplane"})
    assert not scenario.path.stops
    assert [each.waypoint for each in scenario.path.circles] == [3]
    assert any("vehicles that can't hover don't stop" in each for each in scenario.path.not_flown)


def test_check_says_how_long_the_stops_last_and_how_slow_corners_are():
    text = "\n".join(path_text(hovering(stops=[{"waypoint": 1, "hold_s": 10}])))
    assert "1 turns inside a waypoint, 1 stops" in text
    assert "its slowest corner is flown at 5 m/s" in text
    assert "of which it hovers for 10 s" in text
