"""What `check` says about speeds that leave little to hold a slot with."""

from __future__ import annotations

from typing import Any

import pytest

import gcs_formation
from formation_scenario import load_scenario
from gcs_formation.app.check_room import gusts_mps, little_left
from tests.flights.conftest import scenario

GUSTS = {"at_s": 0, "kind": "dryden", "wind_6m_mps": 7}
BEND = [[0, 0, 100], [1500, 0, 100], [2500, 1000, 100]]


def told(speed_mps: float, waypoints_m: Any = ((0, 0, 100), (4000, 0, 100)), **keys: Any) -> list[str]:
    path = {"speed_mps": speed_mps, "waypoints_m": [list(each) for each in waypoints_m]}
    return list(little_left(load_scenario(scenario(path=path, **keys))))


def test_a_speed_near_a_vehicle_s_own_least_or_most_is_reported_with_the_figures() -> None:
    (low,), (high,) = told(16.8), told(27.2)
    slot = "vehicle 2's slot in shape arrow is flown at"
    should = "1.2 should be to hold it against gusts"
    assert low == f"path.speed_mps: found 16.8; {slot} 16.8 m/s, and 16 is its least: 0.8 m/s is left, {should}"
    assert high == f"path.speed_mps: found 27.2; {slot} 27.2 m/s, and 28 is its most: 0.8 m/s is left, {should}"
    assert told(22.0) == []


def test_slots_inside_a_turn_count_with_their_own_speed_and_with_the_wind_behind_the_leader() -> None:
    """30 m inside a bend of 0.02 rad/s, a slot is 0.6 m/s slower; with a tailwind of 10 m/s half as much again."""
    assert told(17.5) == []
    (still,) = told(17.5, BEND)
    (windy,) = told(17.5, BEND, wind={"velocity_mps": [10, 0, 0]})
    left = [float(text.split(": ")[2].split(" ")[0]) for text in (still, windy)]
    assert left[1] < left[0] < 1.1


def test_the_scenario_s_own_turbulence_asks_for_twice_the_difference_of_two_vehicles_gusts() -> None:
    """At 100 m (328 ft) sigma_u is 0.7 m/s / (0.177 + 0.27)^0.4 = 0.966 m/s."""
    assert gusts_mps(load_scenario(scenario(disturbances=[GUSTS]))) == pytest.approx(2 * 2**0.5 * 0.966, rel=1e-3)
    assert len(told(18.5, disturbances=[GUSTS])) == 1
    assert told(19.0, disturbances=[GUSTS]) == []


def test_gusts_of_one_vehicle_alone_ask_for_their_own_speed_and_those_of_all_for_none() -> None:
    one, everyone = ({"at_s": 5, "velocity_mps": [3, 4, 1], **whom} for whom in ({"vehicles": [2]}, {}))
    assert gusts_mps(load_scenario(scenario(disturbances=[one]))) == pytest.approx(5.0)
    assert gusts_mps(load_scenario(scenario(disturbances=[everyone]))) < 1.2


def test_speeds_that_are_ordered_are_reported_and_a_leader_alone_has_no_slot_to_hold() -> None:
    (text,) = told(22.0, orders=[{"at_s": 10, "order": "speed 16.5"}])
    assert text.startswith("orders.0: found 16.5")
    assert told(16.5, vehicles={"count": 1}) == []


@pytest.mark.slow
def test_what_is_warned_of_is_far_out_of_its_slot_and_what_is_not_is_near(tmp_path: Any) -> None:
    """In turbulence of 7 m/s, with 1 m/s and 4 m/s of speed left: twice the difference of gusts is 2.7 m/s."""
    worst = dict[float, float]()
    for speed_mps in (17.0, 20.0):
        path = {"speed_mps": speed_mps, "waypoints_m": [[0, 0, 100], [4000, 0, 100]]}
        keys = scenario(path=path, duration_s=120, disturbances=[GUSTS])
        flown = gcs_formation.run(keys, clock="virtual", out=tmp_path / f"{speed_mps}").to_dict()["followers"]
        worst[speed_mps] = max(each["error_x_m"]["rms"] for each in flown.values())
    assert worst[17.0] > 3.0  # 4.3 m, because gusts are answered within the envelope
    assert worst[20.0] < 1.5
