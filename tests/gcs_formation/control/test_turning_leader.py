"""A leader whose turn rate begins to change at once: the feed-forward alone keeps slots beside and behind it."""

from __future__ import annotations

import math

import pytest

from flight_model.autopilot_model import AutopilotModel, advance
from flight_model.flight_state import FlightState
from flight_model.slot import Slot
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import Controller, LawInput
from gcs_formation.control.laws import leader_motion
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.guidance.leader_commands import LeaderCommand
from tests.gcs_formation.control.law_ticks import DT_S, NONE, SPEED_MPS, parameters

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 5.0, 60.0, 3.0, 0.25, 3.0)
BEND_RPS2, BENDS_S, TICKS = 0.01, 1.5, 60


def bend_rps2(tick: int) -> float:
    """Return how fast the turn rate changes during a tick: from 1 s on it grows, then falls."""
    bends = (tick * DT_S - 1.0) / BENDS_S
    return (BEND_RPS2 if bends < 1.0 else -BEND_RPS2) if 0.0 <= bends < 2.0 else 0.0


def largest_error_m(own: Controller, place_m: tuple[float, float]) -> float:
    """Return the largest error, forward or right, of a follower without feedback; `place_m`: its slot."""
    slot, level = Slot([*place_m, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), (0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    leader, follower = FlightState(0.0, 0.0, 100.0, *level), FlightState(*place_m, 100.0, *level)
    turn_rps, largest_m, before = 0.0, 0.0, (SPEED_MPS, 0.0, 100.0)
    for tick in range(TICKS):
        mean_rps = turn_rps + bend_rps2(tick) * DT_S / 2.0
        heading_rad = leader.heading_rad + MODEL.held(DT_S).tau_psi_s * mean_rps
        command = LeaderCommand(SPEED_MPS, heading_rad, 100.0, turn_rps + MODEL.tau_psi_s * bend_rps2(tick))
        motion = leader_motion(command, leader, MODEL.held(DT_S), DT_S)
        own.decide(LawInput(motion, follower, slot, MODEL.held(DT_S), before, 0.0, [1.0] * 3, AS_DECIDED), DT_S)
        before = own.setpoint
        largest_m = max(largest_m, abs(own.error_m[0]), abs(own.error_m[1]))
        advance(leader, MODEL, SPEED_MPS, heading_rad, 100.0, DT_S)
        advance(follower, MODEL, *own.setpoint, DT_S)
        turn_rps += bend_rps2(tick) * DT_S
    assert math.degrees(leader.heading_rad) > 0.3
    return largest_m


@pytest.mark.parametrize("place_m", [(-60.0, 0.0), (-30.0, 30.0), (0.0, 30.0)])
def test_a_slot_is_kept_without_feedback_while_the_turn_rate_changes(place_m: tuple[float, float]) -> None:
    """With turn rates that are means over a tick in place of those at its beginning, 0.023 to 0.026 m."""
    assert largest_error_m(FollowerController(parameters(NONE, NONE, NONE)), place_m) < 0.007


@pytest.mark.parametrize("place_m", [(-60.0, 0.0), (-30.0, 30.0), (0.0, 30.0)])
def test_the_feedback_does_not_take_a_change_of_turn_for_an_error(place_m: tuple[float, float]) -> None:
    """It compared the turn that begins with what the follower did in the tick before: 0.006 to 0.018 m."""
    assert largest_error_m(FollowerController(parameters(NONE + 3.0, NONE, NONE + 5.0)), place_m) < 0.0015
