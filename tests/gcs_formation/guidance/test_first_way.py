"""The leader's first way to its path is long enough for the others to join up, and no longer."""

from __future__ import annotations

import math

import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation import from_scenario
from gcs_formation.guidance.join_route import JoinRoute, Leg
from gcs_formation.guidance.leader_guidance import JOINED_S, SETTLE_S, LeaderGuidance
from tests.flights.conftest import scenario

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
HOVERING = AutopilotModel(0.6, 0.6, 0.3, 0.3, 0.0, 9.0, 2.5, 0.5, 1.5)
SPEED = 22.0


def set_out(north_m: float, east_m: float, height_m: float = 100.0, heading_deg: float = 0.0) -> tuple[float, float]:
    """Return the lengths of the way to the straight before the path, and of this straight, m; the path leads north."""
    leads = from_scenario.leader_guidance(load_scenario(scenario(start={"in_air": False})))
    state = FlightState(north_m, east_m, height_m, 0.0, SPEED, math.radians(heading_deg), 0.0, 0.0)
    leads.steer(state, MODEL, assembled=False)
    assert leads.route is not None
    assert leads.route is not leads.path
    return leads.route.length_m, -leads.route.at(leads.route.length_m).north_m


@pytest.mark.parametrize("place", [(300.0, 0.0), (0.0, 200.0), (-500.0, -400.0), (-900.0, 300.0), (50.0, -900.0)])
def test_it_takes_as_long_as_joining_up_takes_wherever_it_begins(place: tuple[float, float]) -> None:
    way_m, straight_m = set_out(*place)
    assert JOINED_S * SPEED <= way_m + straight_m < 1.5 * JOINED_S * SPEED


def test_one_that_must_fly_back_flies_back_no_farther_than_it_must() -> None:
    """It used to fly back to a run-in of 60 s: 65 s longer."""
    _, straight_m = set_out(300.0, 0.0)
    assert straight_m == pytest.approx(0.5 * SETTLE_S * SPEED)


@pytest.mark.parametrize(("frame", "spacing_m", "longer"), [("leader_heading", 22, 1), ("follower_heading", 22, 8 / 3)])
def test_the_straight_is_longer_where_heading_loops_are_slower(frame: str, spacing_m: float, longer: float) -> None:
    """At the side by 1 s of flight a heading loop has 0.6 / (0.6 + 1) of its bandwidth, in the follower's own frame."""
    keys = {"formation": {"shape": "line", "spacing_m": spacing_m, "frame": frame}, "vehicles": {"count": 2}}
    leads = from_scenario.leader_guidance(load_scenario(scenario(start={"in_air": False}, **keys)))
    assert leads.speed_mps == SPEED
    assert leads.first_straight_s == pytest.approx(0.5 * SETTLE_S * longer)


def test_it_is_as_high_as_its_path_before_the_straight() -> None:
    """From 55 m below it at 2.1 m/s."""
    way_m, _ = set_out(-900.0, 300.0, 45.0)
    assert way_m >= 55.0 / (0.7 * 3.0) * SPEED


def hovering(north_m: float) -> tuple[LeaderGuidance, FlightState]:
    keys = scenario(
        vehicles={"count": 3, "model": "arducopter"},
        start={"in_air": True, "run_in_s": 1},
        path={"speed_mps": 5, "waypoints_m": [[0, 0, 100], [1000, 0, 100]]},
        formation={"shape": "diamond", "spacing_m": 12},
    )
    leads = from_scenario.leader_guidance(load_scenario(keys))
    return leads, FlightState(north_m, 0.0, 100.0, 0.0, 5.0, 0.0, 0.0, 0.0)


def test_one_that_hovers_waits_before_its_path_until_the_others_are_there() -> None:
    """It used to fly an aircraft's lap of 143 m radius."""
    leads, state = hovering(-5.0)
    assert leads.steer(state, HOVERING, assembled=False).speed_mps == 0.0
    state.north_m = 1.0
    assert leads.steer(state, HOVERING, assembled=False).speed_mps == 0.0, "it has stopped beyond the start"
    assert (leads.started, leads.rounds) == (False, 0)
    assert leads.steer(state, HOVERING, assembled=True).speed_mps == pytest.approx(5.0)
    assert leads.started
    state.north_m = 3.0
    assert leads.steer(state, HOVERING, assembled=False).speed_mps == pytest.approx(5.0), "it has begun"


@pytest.mark.parametrize(("north_m", "stops"), [(-13.1, False), (-12.9, True)])
def test_one_that_waits_stops_far_enough_before_its_path_to_begin_it_at_its_speed(north_m: float, stops: bool) -> None:
    """At 5 m/s and 2.5 m/s^2: 5 m to stop, 3 m by its time constant of 0.6 s, and 5 m to have its speed again."""
    leads, state = hovering(north_m)
    assert leads.steer(state, HOVERING, assembled=False).speed_mps == (0.0 if stops else pytest.approx(5.0))


def test_an_order_of_speed_is_flown_after_the_wait() -> None:
    leads, state = hovering(-5.0)
    leads.steer(state, HOVERING, assembled=False)
    leads.fly_at(3.0)
    assert leads.steer(state, HOVERING, assembled=False).speed_mps == 0.0
    assert leads.steer(state, HOVERING, assembled=True).speed_mps == pytest.approx(3.0)


def test_a_way_that_is_half_a_metre_too_short_ranks_after_a_longer_one_that_is_not() -> None:
    """80 s at 22 m/s, with a straight of 15 s."""
    leads = from_scenario.leader_guidance(load_scenario(scenario(start={"in_air": False})))
    straight_m = leads.first_straight_s * SPEED
    short, long_enough = (
        JoinRoute((Leg(PathPoint(0.0, 0.0, 100.0, 0.0), length_m, 0.0),), 100.0, 100.0, 0.1)
        for length_m in (JOINED_S * SPEED - straight_m - 0.5, JOINED_S * SPEED - straight_m + 200.0)
    )
    assert leads._by_use((long_enough, straight_m)) < leads._by_use((short, straight_m))
