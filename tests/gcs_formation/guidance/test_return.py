"""A leader off its path returns to it in turns in which followers keep their slots."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.path_offsets import DisplacedPath, Rise
from formation_scenario import load_scenario
from gcs_formation import from_scenario
from gcs_formation.guidance.lateral import TurnBounds
from gcs_formation.guidance.leader_guidance import SETTLE_S, LeaderGuidance
from tests.flights.conftest import scenario

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
SPEED = 22.0


def guidance() -> LeaderGuidance:
    """Return the guidance of a leader that is in the middle of a path to the north."""
    made = from_scenario.leader_guidance(load_scenario(scenario()))
    made.centroid_m = (0.0, 2000.0)
    return made


def state(north_m: float, east_m: float, heading_deg: float) -> FlightState:
    return FlightState(north_m, east_m, 100.0, 0.0, SPEED, math.radians(heading_deg), 0.0, 0.0)


def test_on_the_path_it_goes_on_at_once() -> None:
    leads = guidance()
    leads.steer(state(700.0, 4.0, 3.0), MODEL, assembled=False)
    assert leads.started
    assert leads.distance_m == pytest.approx(700.0)


@pytest.mark.parametrize(
    ("east_m", "heading_deg"),
    [(300.0, 60.0), (-250.0, -20.0), (40.0, 0.0), (5.0, 90.0), (100.0, 180.0), (-900.0, -90.0)],
)
def test_off_the_path_it_returns_in_wide_turns_and_then_follows_it(east_m: float, heading_deg: float) -> None:
    leads = guidance()
    leads.steer(state(700.0, east_m, heading_deg), MODEL, assembled=False)
    assert not leads.started
    way = leads.route
    assert way is not None
    steps = [way.length_m * step / 200 for step in range(201)]
    assert max(abs(way.at(at_m).curvature_1pm) for at_m in steps) <= 1.0 / leads.hold_radius_m() + 1e-9
    begin, end = way.at(0.0), way.at(way.length_m)
    assert (begin.north_m, begin.east_m) == pytest.approx((700.0, east_m))
    assert end.east_m == pytest.approx(0.0, abs=1e-6)
    assert math.remainder(end.course_rad, math.tau) == pytest.approx(0.0, abs=1e-6)
    leads.distance_m = way.length_m
    leads.steer(state(end.north_m + 1.0, 0.0, 0.0), MODEL, assembled=False)
    assert leads.started
    assert leads.distance_m == pytest.approx(end.north_m + 1.0)


@pytest.mark.parametrize("bend_max_rps2", [0.01, 0.03])
def test_beside_its_path_it_turns_back_as_its_followers_can_keep_up(bend_max_rps2: float) -> None:
    """8 degrees off it, all of what they can; the setpoint leads by that times the time constant of 1.5 s."""
    leads = guidance()
    leads.steer(state(700.0, 4.0, 8.0), MODEL, assembled=False, bounds=TurnBounds(bend_max_rps2))
    assert leads.started
    assert leads.turn_rps == pytest.approx(-1.5 * bend_max_rps2)


def test_a_new_leaders_own_route_onto_its_path_counts_as_the_path() -> None:
    leads = guidance()
    leads.take_over(DisplacedPath(leads.path, 600.0, 400.0, 20.0, Rise(0.0)), 700.0)
    leads.steer(state(700.0, 18.0, 0.0), MODEL, assembled=False)
    assert leads.started
    assert leads.rounds == 0


def test_from_a_little_beside_its_path_it_is_back_within_a_turns_radius() -> None:
    """Two opposite turns lead 20 m to the side within (4 · 20 m · R - (20 m)²)^½ along the path, less than R."""
    leads = guidance()
    radius_m = leads.hold_radius_m()
    assert math.sqrt(4.0 * 20.0 * radius_m - 20.0**2) < radius_m
    leads.steer(state(700.0, 20.0, 0.0), MODEL, assembled=False)
    assert leads.route is not None
    assert leads.route.at(leads.route.length_m).north_m == pytest.approx(700.0 + radius_m)


def test_at_the_end_of_the_way_to_its_path_it_knows_how_far_the_path_is() -> None:
    """Wherever the path begins and leads."""
    path = {"speed_mps": SPEED, "waypoints_m": [[400, -300, 100], [400, 3700, 100]]}
    leads = from_scenario.leader_guidance(load_scenario(scenario(path=path)))
    leads.steer(state(-900.0, 600.0, 0.0), MODEL, assembled=False)
    way = leads.route
    assert way is not None
    end, leads.distance_m = way.at(way.length_m), way.length_m
    leads.steer(state(end.north_m, end.east_m, 90.0), MODEL, assembled=False)
    assert leads.on_path
    assert leads.distance_m == pytest.approx(end.east_m + 300.0)


def test_the_straight_before_the_path_gets_longer_with_every_round_up_to_four_times() -> None:
    """A follower that needs longer than it to come back into its slot would be out of it after every lap."""
    leads = guidance()
    leads.centroid_m = None
    lengths_m: list[float] = []
    for _ in range(6):
        leads.route, leads.distance_m = leads.path, -30.0
        leads.steer(state(-30.0, 0.0, 0.0), MODEL, assembled=False)
        assert leads.route is not None
        lengths_m.append(leads.path.at(0.0).north_m - leads.route.at(leads.route.length_m).north_m)
    assert lengths_m == pytest.approx([SETTLE_S * SPEED * times for times in (1, 2, 3, 4, 4, 4)])


@pytest.mark.parametrize(
    ("model", "frame", "times"),
    [("paper", "follower_heading", 1), ("arduplane", "leader_heading", 1), ("arduplane", "follower_heading", 2)],
)
def test_aircraft_with_energies_have_twice_the_time_to_settle_in_frames_of_their_own(
    model: str, frame: str, times: int
) -> None:
    keys = {"vehicles": {"count": 4} | ({} if model == "paper" else {"model": model})}
    keys |= {"formation": {"shape": "line", "spacing_m": 40, "frame": frame}}
    assert from_scenario.leader_guidance(load_scenario(scenario() | keys)).settle_s == times * SETTLE_S


@pytest.mark.parametrize("stands", [True, False])
def test_a_leader_pauses_at_a_stop_of_its_path_alone(stands: bool) -> None:
    leads = guidance()
    leads.route = leads.path
    assert not leads.pauses, "without stops"
    timed: Any = SimpleNamespace(pauses=stands)
    leads.timed = timed
    assert leads.pauses == stands
    leads.route = None
    assert not leads.pauses, "on its way to the path"


@pytest.mark.parametrize("centroid_m", [None, (0.0, 2000.0)])
@pytest.mark.parametrize("noise_mps", [0.05, 0.0, -0.05])
def test_one_that_stands_sets_out_along_its_nose_not_along_the_noise_of_its_velocity(
    noise_mps: float, centroid_m: tuple[float, float] | None
) -> None:
    """By a velocity backwards, its slots' axis would turn by half a turn, and all slots with it."""
    leads = guidance()
    leads.centroid_m = centroid_m
    stands = FlightState(700.0, 300.0, 100.0, 0.0, noise_mps, 0.7, 0.0, 0.0)
    leads.steer(stands, MODEL, assembled=False)
    assert leads.route is not None
    assert leads.route.at(0.0).course_rad == pytest.approx(0.7)
