"""In the follower's own frame, heading is damped by the distance behind the leader, or by what is missing of it."""

import math

import pytest

from flight_model.slot import Slot
from gcs_formation.control.follower_loops import LawInput
from gcs_formation.control.setpoint import TRAIL_S
from tests.gcs_formation.control.test_follower_limits import DT_S, HEADING_RAD, MIXER, SPEED_MPS, controller, pair

FAR_M = TRAIL_S * SPEED_MPS


def behind(far_m: float, side: float) -> LawInput:
    """Return a follower in its slot, straight behind the leader, whose heading setpoint is 0.07 rad to a side."""
    given = pair()
    leader = given.leader.state
    given.slot = Slot([-far_m, 0.0, 0.0], [0.0] * 3, [0.0] * 3)
    given.state.north_m = leader.north_m - far_m * math.cos(HEADING_RAD)
    given.state.east_m = leader.east_m - far_m * math.sin(HEADING_RAD)
    given.state.height_m = leader.height_m
    given.commanded = SPEED_MPS, HEADING_RAD + side * 0.07, leader.height_m
    return given


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("far_m", "damped_by_m"), [(FAR_M, FAR_M), (20.0, FAR_M), (5.0, FAR_M), (60.0, 60.0)])
def test_the_mixed_error_changes_as_if_the_slot_were_at_least_1_36_s_behind(
    far_m: float, damped_by_m: float, side: float
) -> None:
    """It turns at 0.05 rad/s: its axes swing the slot across by its distance behind, nearer ones by 29.9 m."""
    of = controller(frame="follower_heading")
    of.decide(behind(far_m, side), DT_S)
    assert of._right.rate == pytest.approx(-side * 0.05 * (MIXER.k_psi + MIXER.k_y * damped_by_m))
