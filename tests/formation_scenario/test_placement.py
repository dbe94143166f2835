from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation_scenario import load_scenario
from formation_scenario.start_states import start_states

COLUMNS = ("north_m", "east_m", "height_m", "heading_rad", "airspeed_mps", "in_air")
EAST = "path.waypoints_m=[[0, 0, 100], [0, 4000, 100]]"


def started(scenario) -> SimpleNamespace:
    """Return the vehicles' start states as arrays in the scenario's order."""
    states = start_states(scenario)
    return SimpleNamespace(**{name: np.array([getattr(each, name) for each in states]) for name in COLUMNS})


def test_in_the_air_followers_are_offset_from_their_slots_in_the_leaders_heading(load):
    start = started(load(EAST, "start={in_air: true, offset_m: [8, 6, 4], run_in_s: 10}"))
    # heading east: forward is east, right is south
    np.testing.assert_allclose(start.east_m, [-220, -242, -242, -272], atol=1e-9)
    np.testing.assert_allclose(start.north_m, [0, 24, -36, -6], atol=1e-9)
    np.testing.assert_allclose(start.height_m, [100, 104, 104, 104])
    np.testing.assert_allclose(start.heading_rad, np.pi / 2)
    np.testing.assert_allclose(start.airspeed_mps, 22.0)
    assert start.in_air.all()


@pytest.mark.parametrize(
    ("offset_m", "line"),
    [
        ("[30, -30, 0]", "vehicle 1 and vehicle 3 begin 0 m apart; 5 m or more (safety.separation_m)"),
        ("[30, -27, 2]", "vehicle 1 and vehicle 3 begin 3.61 m apart; 5 m or more (safety.separation_m)"),
        ("[0, 0, -150]", "vehicle 2 begins -50.0 m above the ground; 5 m or more (safety.clearance_m)"),
        ("[0, 0, -99]", "vehicle 2 begins 1.0 m above the ground; 5 m or more (safety.clearance_m)"),
    ],
)
def test_a_start_in_the_air_keeps_what_safety_asks_for(load, refusal, offset_m, line):
    """Slots of the diamond are 30 m behind and 30 m lateral, and 60 m behind; vehicle 3 flies on the right."""
    for in_air in ("true", "false"):  # not in the air they assemble after a take-off
        start = f"start={{in_air: {in_air}, offset_m: {offset_m}, run_in_s: 10}}"
        assert refusal(start) == [f"start.offset_m: {line}"]
    assert load("start={in_air: true, offset_m: [30, 26, 3], run_in_s: 10}")  # vehicle 2 begins 5 m from the leader


def test_on_the_ground_followers_stand_at_their_slots(load):
    start = started(load(EAST, "start={offset_m: [8, 6, 4]}"))
    np.testing.assert_allclose(start.east_m, [-1320, -1350, -1350, -1380], atol=1e-9)
    np.testing.assert_allclose(start.north_m, [0, 30, -30, 0], atol=1e-9)
    assert not start.height_m.any()
    assert not start.airspeed_mps.any()
    assert not start.in_air.any()


def test_on_the_ground_they_stand_in_a_row_to_the_leaders_right(load):
    start = started(load(EAST, "start.row_m=9"))
    np.testing.assert_allclose(start.east_m, [-1320] * 4, atol=1e-9)
    np.testing.assert_allclose(start.north_m, [0, -9, -18, -27], atol=1e-9)


def test_a_virtual_leader_takes_no_slot(load):
    start = started(load(EAST, "vehicles=[{id: 2}, {id: 3}]", "formation.shape=follower"))
    np.testing.assert_allclose(start.east_m, [-1350, -1380], atol=1e-9)


def test_slots_above_each_other_stand_separated_on_the_ground(load):
    stacked = "formation={shape: custom, slots_m: {2: [0, 0, 20], 3: [0, 0, 40], 4: [-30, 0, 0]}}"
    start = started(load(EAST, stacked))
    np.testing.assert_allclose(start.east_m + 1320, [0, -10, -20, -30], atol=1e-9)


@given(
    st.lists(st.tuples(st.integers(-4, 0), st.integers(-2, 2)), min_size=1, max_size=12),
    st.floats(0.1, 20.0),
)
def test_vehicles_on_the_ground_keep_the_safe_separation(positions, separation):
    levels = {index + 2: [3.0 * f, 3.0 * r, 30.0 * (index + 1)] for index, (f, r) in enumerate(positions)}
    scenario = load_scenario(
        {
            "vehicles": {"count": len(positions) + 1},
            "path": {"waypoints_m": [[0, 0, 100], [4000, 1000, 100]]},
            "formation": {"shape": "custom", "slots_m": levels},
            "safety": {"separation_m": separation},
        }
    )
    start = started(scenario)
    north, east = start.north_m, start.east_m
    distances = np.hypot(north[:, None] - north, east[:, None] - east) + np.diag(np.full(len(north), np.inf))
    assert distances.min() >= separation * (1 - 1e-6)


def test_the_order_is_that_of_the_vehicles(load):
    start = started(load(EAST, "vehicles=[{id: 2}, {id: 1, role: leader}]", "formation.shape=follower"))
    np.testing.assert_allclose(start.east_m, [-1350, -1320], atol=1e-9)
    assert start.heading_rad == pytest.approx([np.pi / 2] * 2)
