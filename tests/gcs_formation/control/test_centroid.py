"""The virtual leader at its followers' centroid, from followers that are in its slots."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from gcs_formation.control.setpoint import centroid, formation_error, slot_target

SPEED_MPS = 22.0
STILL = [0.0, 0.0, 0.0]
COLUMN = [Slot([-30.0 * place, 5.0 * place, 2.0 * place], STILL, STILL) for place in range(3)]


def in_slots(leader, turn_rps, frame):
    """Return states of followers in their slots, with the headings that these need while their axes turn."""
    followers = []
    for slot in COLUMN:
        heading_rad = slot_target(leader, 0.0, 0.0, turn_rps, slot, frame).heading_rad
        axis_rad = leader.heading_rad if frame == "leader_heading" else heading_rad
        cos, sin = math.cos(axis_rad), math.sin(axis_rad)
        north_m = leader.north_m + slot.forward_m * cos - slot.right_m * sin
        east_m = leader.east_m + slot.forward_m * sin + slot.right_m * cos
        height_m = leader.height_m + slot.up_m
        followers.append(FlightState(north_m, east_m, height_m, 0.0, SPEED_MPS, heading_rad, 0.0, 0.0))
    return followers


@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading"])
@given(heading_rad=st.floats(-3.0, 3.0), turn_rps=st.floats(-0.1, 0.1))
def test_followers_in_their_slots_give_their_leader_in_turns_too(frame, heading_rad, turn_rps):
    leader = FlightState(400.0, -300.0, 100.0, 0.0, SPEED_MPS, heading_rad, 0.0, 0.0)
    followers = in_slots(leader, turn_rps, frame)
    found = centroid(followers, COLUMN, SPEED_MPS, turn_rps, frame)
    assert found.heading_rad == pytest.approx(heading_rad, abs=1e-9)
    assert (found.north_m, found.east_m, found.height_m) == pytest.approx((400.0, -300.0, 100.0), abs=1e-6)


def test_neglecting_the_turn_displaces_the_virtual_leader():
    """Errata item 24: at 0.05 rad/s the slots 30 and 60 m behind head asin(0.05 x_rc / v) outward, 3.9 and 7.8 deg."""
    leader = FlightState(0.0, 0.0, 0.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    followers = in_slots(leader, 0.05, "leader_heading")
    straight = centroid(followers, COLUMN, SPEED_MPS, 0.0, "leader_heading")
    assert math.degrees(straight.heading_rad) == pytest.approx(-3.9, abs=0.1)
    error_m = [
        formation_error(straight, each, slot, straight.heading_rad)[1]
        for each, slot in zip(followers, COLUMN, strict=True)
    ]
    assert max(map(abs, error_m)) == pytest.approx(2.1, abs=0.1)


@given(heading_rad=st.floats(-3.0, 3.0), turn_rps=st.floats(-0.1, 0.1))
def test_followers_north_and_east_of_their_leader_head_as_it_does(heading_rad, turn_rps):
    followers = [
        FlightState(400.0 + slot.forward_m, slot.right_m - 300.0, 100.0 + slot.up_m, 0.0, SPEED_MPS, heading_rad, 0, 0)
        for slot in COLUMN
    ]
    found = centroid(followers, COLUMN, SPEED_MPS, turn_rps, "north")
    assert found.heading_rad == pytest.approx(heading_rad, abs=1e-9)
    assert (found.north_m, found.east_m, found.height_m) == pytest.approx((400.0, -300.0, 100.0), abs=1e-6)
