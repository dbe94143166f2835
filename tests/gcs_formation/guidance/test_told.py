"""What a leader flies by at an instant, from what it was told and when that acts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant
from gcs_formation.estimation.flight_state import Setpoints
from gcs_formation.guidance.leader import ToldLeader

TICK_S = 0.1
TURN_RPS = 0.2


def leader(ticks: int) -> ToldLeader:
    """Tell it at each tick, which acts 0.4 s later, to turn right through south and to gain 0.5 m/s a second."""
    told = ToldLeader(TICK_S)
    for tick in range(ticks):
        at_s = TICK_S * tick
        heading_rad = math.remainder(math.pi - 0.1 + TURN_RPS * at_s, math.tau)
        told.tell(instant(at_s + 0.4), setpoints(22.0 + 0.5 * at_s, heading_rad), TURN_RPS if tick else 0.0)
    return told


def setpoints(speed_mps: float, heading_rad: float) -> Setpoints:
    return Setpoints(np.array([speed_mps]), np.array([heading_rad]), np.array([100.0]))


def instant(at_s: float) -> Instant:
    return Instant(round(at_s * NANOSECONDS))


def test_a_follower_whose_setpoint_acts_sooner_gets_what_the_leader_still_flies_by():
    """Told at 1.9 s the leader acts at 2.3 s; 0.32 s before that it flies by 3.2 ticks older setpoints in the mean."""
    told = leader(20).at(np.array([instant(2.3), instant(1.98)]))
    assert told.setpoints.speed_mps == pytest.approx([22.95, 22.79])
    turned_rad = told.setpoints.heading_rad - (math.pi - 0.1)
    assert turned_rad == pytest.approx([0.38, 0.316])  # through south without a jump
    assert told.turn_rps == pytest.approx([TURN_RPS, TURN_RPS])


def test_outside_of_what_it_was_told_the_nearest_holds():
    told = leader(20).at(np.array([instant(0.0), instant(9.0)]))
    assert told.setpoints.speed_mps == pytest.approx([22.0, 22.95])
    assert told.turn_rps == pytest.approx([0.0, TURN_RPS])


def test_another_leader_has_not_turned_from_where_the_last_one_headed():
    told = leader(20)
    told.begin()
    told.tell(instant(2.4), setpoints(20.0, -1.0), 0.0)
    begun = told.at(np.array([instant(2.0)]))
    assert (begun.setpoints.heading_rad[0], begun.turn_rps[0]) == (-1.0, 0.0)
