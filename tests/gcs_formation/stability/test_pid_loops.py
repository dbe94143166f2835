"""Delay margins of whole scenarios: the published figures, from a user's keys."""

from __future__ import annotations

import pytest

from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.stability import follower_margins, law_margins, leader_loops
from tests.flights.conftest import scenario


def flown(frame="follower_heading", law="fuzzy_pid", model=None):
    slots = {2: [-30, -30, 0], 3: [-30, 30, 0], 4: [-60, 0, 0]}
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [3000, 0, 100]]}
    vehicles = [
        {"id": 1, "role": "leader"},
        {"id": 2},
        {"id": 3},
        {"id": 4, **({"model": model} if model else {})},
    ]
    formation = {"shape": "custom", "frame": frame, "slots_m": slots}
    return load_scenario(
        {"schema": 1, "vehicles": vehicles, "path": path, "formation": formation, "law": {"type": law}}
    )


def test_golden_margins_in_the_followers_frame():
    found = law_margins(flown())
    assert (found.small_signal["x"], found.small_signal["y"]) == pytest.approx((0.8688, 0.7349), abs=5e-5)
    assert (found.worst["x"], found.worst["y"]) == pytest.approx((0.669424, 0.584744), abs=5e-7)


def test_golden_margins_in_the_leaders_frame_with_its_own_heading_gains():
    found = law_margins(flown(frame="leader_heading"))
    assert (found.small_signal["y"], found.worst["y"]) == pytest.approx((1.252, 0.892), abs=5e-4)


def test_fixed_gains_are_the_nominal_ones():
    found = law_margins(flown(law="pid"))
    assert found.worst == found.small_signal
    assert (found.worst["x"], found.worst["y"], found.worst["z"]) == pytest.approx(
        (0.862581, 0.779763, 2.326183), abs=5e-7
    )


def test_slots_of_the_whole_run_count():
    """The column behind the leader grows from one spacing to three: x_rc 30 m, later 90 m."""
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [6000, 0, 100]]}
    scenario = {"vehicles": {"count": 2}, "path": path}
    formation = {"shape": "follower", "frame": "follower_heading", "spacing_m": 30}
    changes = [{"at_s": 40, "shape": "follower", "spacing_m": 90}]
    near, far, both = (
        law_margins(load_scenario(scenario | {"formation": formation | more})).worst["y"]
        for more in ({}, {"spacing_m": 90}, {"changes": changes})
    )
    assert both == far < near


def test_a_leader_that_is_to_follow_counts():
    """Its own autopilot, in its slot behind the other: like a follower's from the start."""
    keys = {
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [6000, 0, 100]]},
        "formation": {"shape": "follower", "frame": "follower_heading", "spacing_m": 30},
    }
    slow, changes = {"tau_v_s": 2.0, "tau_psi_s": 2.5}, ["formation.changes=[{at_s: 40, leader: 2}]"]
    leading = keys | {"vehicles": [{"id": 1, "role": "leader", "model": slow}, {"id": 2}]}
    behind = keys | {"vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "model": slow}]}
    first, second = VehicleId(1, 1), VehicleId(1, 2)
    assert set(follower_margins(load_scenario(leading))) == {second}
    found = follower_margins(load_scenario(leading, changes))
    assert found[first] == follower_margins(load_scenario(behind))[second]
    assert found[first].worst["y"] < found[second].worst["y"]


def test_weakest_follower_decides():
    """A slot farther behind has less margin in y (follower's frame); another autopilot has another margin in x."""
    scenario = flown(model={"tau_v_s": 2.0})
    found, least = follower_margins(scenario), law_margins(scenario)
    y = [found[VehicleId(1, number)].worst["y"] for number in (2, 3, 4)]
    assert y[0] == y[1] > y[2] == least.worst["y"]
    x = [found[VehicleId(1, number)].worst["x"] for number in (2, 3, 4)]
    assert x[0] == x[1] != x[2]
    assert min(x) == least.worst["x"]


def test_only_a_real_leader_has_loops_for_when_another_leads():
    virtual = [{"id": 1, "role": "follower"}, {"id": 2, "role": "follower"}]
    assert leader_loops(load_scenario(scenario(vehicles=virtual))) == {}
    assert list(leader_loops(load_scenario(scenario(vehicles={"count": 3})))) == [VehicleId(1, 1)]
