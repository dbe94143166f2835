"""Slots fixed to north and east: what they require of vehicles, where they lie, and which paths they make flyable."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.fence_geometry import Drift, Flyers, positions_along
from flight_model.slot import Slot
from flight_model.spline import SplinePath
from formation_scenario.slot_frame import axis_rad
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, slot_needs
from formation_scenario.start_states import start_states

NORTH = "formation.frame=north"
BEND = "path={speed_mps: 22, waypoints_m: [[0, 0, 100], [600, 0, 100], [800, 200, 100], [800, 900, 100]]}"
STEP_S = 0.01
offsets = st.floats(-200.0, 200.0)


def test_the_axis_is_the_leaders_the_followers_or_north():
    assert axis_rad("leader_heading", 1.0, 2.0) == 1.0
    assert axis_rad("follower_heading", 1.0, 2.0) == 2.0
    assert axis_rad("north", 1.0, 2.0) == 0.0
    assert math.isnan(axis_rad("north", math.nan, 2.0))


@given(offsets, offsets, st.floats(0.1, 0.9))
def test_a_slot_at_rest_is_flown_as_the_leader_flies_wherever_it_lies(forward, right, share):
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 900, 100], [3500, 2400, 100]])
    points = path.at(np.array([share * path.length_m]))
    flight = LeaderFlight.along(points, 22.0)
    needs = slot_needs(flight, SlotMotion.at_rest(np.array([[forward, right, 0.0]])), "north")
    assert needs.speed_mps[0, 0] == pytest.approx(22.0)
    assert needs.accel_mps2[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert needs.turn_rate_rps[0, 0] == pytest.approx(flight.turn_rate_rps[0])


@given(st.tuples(offsets, offsets), st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.floats(-0.2, 0.2))
def test_a_moving_slot_needs_what_its_position_over_ground_does(position, velocity, acceleration):
    """Against differences of the slot's position: the leader's and a parabola that doesn't turn."""
    path = SplinePath([[0, 0, 100], [1500, 0, 100], [3000, 900, 100], [3500, 2400, 100]])
    s, speed = float(path.nodes_m[100] + path.nodes_m[101]) / 2, 22.0
    times_s = STEP_S * np.arange(-2.0, 3.0)
    points = path.at(s + speed * times_s)
    start, mps = complex(*position), complex(*velocity)
    own = start + times_s * mps + times_s**2 / 2 * acceleration
    over = np.gradient(points.north_m + 1j * points.east_m + own, STEP_S)[1:-1]
    rows = np.array([[*velocity, 0.0]]), np.array([[acceleration, 0.0, 0.0]])
    needs = slot_needs(
        LeaderFlight.along(path.at(np.array([s])), speed), SlotMotion(np.array([[*position, 0.0]]), *rows), "north"
    )
    assert abs(over[1]) == pytest.approx(needs.speed_mps[0, 0], rel=1e-4)
    assert np.angle(over[2] / over[0]) / (2 * STEP_S) == pytest.approx(needs.turn_rate_rps[0, 0], abs=1e-4)
    assert (abs(over[2]) - abs(over[0])) / (2 * STEP_S) == pytest.approx(needs.accel_mps2[0, 0], abs=1e-3)


@given(st.tuples(offsets, offsets), st.tuples(st.floats(-5, 5), st.floats(-5, 5)), st.floats(-3, 3), st.floats(-1, 1))
def test_one_slot_turns_as_arrays_of_them_do(position, velocity, axis, turn):
    slot = Slot([*position, 3.0], [*velocity, 1.0], [0.1, -0.2, 0.3]).turned(axis, turn, 0.05)
    arrays = SlotMotion(*(np.array([row]) for row in ([*position, 3.0], [*velocity, 1.0], [0.1, -0.2, 0.3])))
    each = arrays.turned(np.array([axis]), np.array([turn]), np.array([0.05]))
    assert [slot.forward_m, slot.right_m, slot.up_m] == pytest.approx(each.position_m[0, 0], abs=1e-9)
    assert [slot.forward_mps, slot.right_mps, slot.up_mps] == pytest.approx(each.velocity_mps[0, 0], abs=1e-9)
    assert [slot.forward_mps2, slot.right_mps2, slot.up_mps2] == pytest.approx(each.acceleration_mps2[0, 0], abs=1e-9)


def test_a_turn_too_tight_for_slots_that_swing_is_flown_by_slots_that_do_not(load, refusal):
    """With 60 m to the side at 22 m/s, a turn of 0.1 rad/s takes 6 m/s more outside: 28 is the limit."""
    wide = "formation.shape=line", "formation.spacing_m=80"
    assert any("m/s" in line for line in refusal(BEND, *wide))
    assert load(BEND, *wide, NORTH)


def test_slots_start_north_and_east_of_the_leader_whatever_its_course(load):
    east = "path.waypoints_m=[[0, 0, 100], [0, 4000, 100]]"
    states = start_states(load(east, NORTH, "start={in_air: true, run_in_s: 10, offset_m: [1, 2, 3]}"))
    positions = [(each.north_m - states[0].north_m, each.east_m - states[0].east_m) for each in states[1:]]
    assert positions == [pytest.approx((north + 1, east + 2)) for north, east in ((-30, -30), (-30, 30), (-60, 0))]
    assert [each.heading_rad for each in states] == pytest.approx([math.pi / 2] * 4)


def test_along_a_fence_slots_keep_their_direction():
    path = np.zeros(2), np.zeros(2), np.array([0.0, math.pi / 2])
    flyers = Flyers(np.array([-50.0]), np.array([20.0]), np.array([0.2]), slots_turn=False)
    positions = positions_along(path, flyers, Drift(20.0, 0.0, 12.0, 32.0))
    assert positions[0] == pytest.approx(np.array([[-50.0, 20.0], [-50.0, 20.0]]))


def test_vehicles_that_hover_fly_it_too(load):
    vehicles = "vehicles=[{id: 1, role: leader, autopilot: arducopter}, {id: 2, autopilot: arducopter}]"
    assert load(vehicles, "path.speed_mps=5", NORTH).formation.frame == "north"
