"""A leader's progress by its timetable: led to where it is due, standing at stops, and due where it is when far off."""

from __future__ import annotations

import math

import pytest

from airlink.clock import Instant, after
from flight_model.legs.heights import Climbs
from flight_model.legs.turn import TurnLimits
from flight_model.stops.corners import Pass
from flight_model.stops.pacing import Rates
from flight_model.stops.path import PathWithStops, StopPlan
from flight_model.stops.timetable import SETTLE_S, Passage, Timetable
from gcs_formation.guidance.timed_progress import BACK_RADPS, OFF_M, TimedProgress

CRUISE_MPS, STOP_M, LENGTH_M, HOLD_S, TURN_S = 5.0, 100.0, 180.0, 4.0, 3.0
TICK_S, LAG_S = 0.1, 0.5
STOP = Passage(STOP_M, STOP_M, 0.0, hold_s=HOLD_S, turn_s=TURN_S, from_rad=0.0, by_rad=math.pi / 2)


def progress() -> TimedProgress:
    """Return the progress along 180 m with one stop after 100 m, in which the leader turns in place."""
    return TimedProgress(Timetable(CRUISE_MPS, [CRUISE_MPS, CRUISE_MPS], [STOP], LENGTH_M, Rates(1.0, 2.0)))


class Leader:
    """A vehicle whose speed follows its setpoint with a time constant of 0.5 s, by (7)."""

    def __init__(self, timed: TimedProgress) -> None:
        self.timed, self.at_m, self.speed_mps, self.now = timed, 0.0, CRUISE_MPS, Instant(0)
        self.stood_s = self.turned_s = 0.0

    def fly(self, duration_s: float) -> None:
        """Follow the setpoints."""
        for _ in range(round(duration_s / TICK_S)):
            due = self.timed.advance(self.at_m, self.now, TICK_S, None)
            setpoint_mps = 0.0 if due is None else due.setpoint_mps(LAG_S)
            self.stood_s += TICK_S * (due is not None and due.hovers)
            self.turned_s += TICK_S * (due is not None and due.turn is not None)
            change_mps = (setpoint_mps - self.speed_mps) * (1.0 - math.exp(-TICK_S / LAG_S))
            self.at_m += self.speed_mps * TICK_S + change_mps * TICK_S / 2.0
            self.speed_mps += change_mps
            self.now = after(self.now, TICK_S)


def test_it_stops_at_the_stop_stays_as_long_as_asked_and_arrives_when_the_timetable_says() -> None:
    timed = progress()
    leader, table = Leader(timed), timed.timetable
    pause = table.pauses[0]
    leader.fly(pause.begin_s + SETTLE_S + HOLD_S / 2.0)
    assert timed.pauses
    assert leader.at_m == pytest.approx(STOP_M, abs=0.3)
    assert leader.speed_mps == pytest.approx(0.0, abs=0.05)
    leader.fly(table.end_s - pause.begin_s - SETTLE_S - HOLD_S / 2.0)
    assert leader.at_m == pytest.approx(LENGTH_M, abs=1.2 * CRUISE_MPS * TICK_S)
    assert leader.stood_s == pytest.approx(HOLD_S + TURN_S, abs=2.0 * TICK_S)
    assert leader.turned_s == pytest.approx(TURN_S, abs=2.0 * TICK_S)


@pytest.mark.parametrize("behind_m", [-4.0, 4.0])
def test_a_small_distance_to_where_it_is_due_adds_to_its_speed(behind_m: float) -> None:
    timed = progress()
    assert timed.advance(20.0, None, TICK_S, None) is not None
    due = timed.advance(20.0 + CRUISE_MPS * TICK_S - behind_m, None, TICK_S, None)
    assert due is not None
    assert due.ahead_m == pytest.approx(behind_m)
    assert due.setpoint_mps(LAG_S) == pytest.approx(CRUISE_MPS + BACK_RADPS * behind_m)


@pytest.mark.parametrize("off_m", [-OFF_M - 1.0, OFF_M + 1.0])
def test_one_that_is_too_far_off_is_due_where_it_is(off_m: float) -> None:
    timed = progress()
    assert timed.advance(30.0, None, TICK_S, None) is not None
    due = timed.advance(30.0 + off_m, None, TICK_S, None)
    assert due is not None
    assert due.ahead_m == pytest.approx(0.0, abs=1e-6)
    assert due.setpoint_mps(LAG_S) == pytest.approx(CRUISE_MPS)


def test_before_its_path_it_is_due_where_it_is() -> None:
    timed = progress()
    for at_m in (-50.0, -48.0):
        due = timed.advance(at_m, None, TICK_S, None)
        assert due is not None
        assert due.ahead_m == pytest.approx(0.0, abs=1e-6)


def test_ordered_to_stand_nothing_is_due_until_it_is_ordered_to_fly_on_at_another_speed() -> None:
    timed = progress()
    timed.order(0.0)
    assert timed.advance(50.0, None, TICK_S, None) is None
    assert not timed.ordered
    assert not timed.pauses
    timed.order(2.0)
    due = timed.advance(50.0, None, TICK_S, None)
    assert timed.ordered
    assert due is not None
    assert due.setpoint_mps(LAG_S) == pytest.approx(2.0)
    assert [each.begin_m for each in timed.timetable.stops] == [STOP_M]


def test_its_route_ends_at_the_next_stop_and_begins_at_the_last_one() -> None:
    limits = [TurnLimits(0.05, 0.01)] * 2
    path = PathWithStops(
        [[0, 0, 30], [STOP_M, 0, 30], [STOP_M, LENGTH_M - STOP_M, 30]],
        StopPlan([Pass(0.0)], [Climbs(0.3, 0.02)] * 2, limits, 100.0),
    )
    timed = progress()
    leader, pause = Leader(timed), timed.timetable.pauses[0]
    leader.fly(5.0)
    assert timed.part(path)[1:] == (-math.inf, STOP_M)
    leader.fly(pause.begin_s - 4.0)
    assert timed.pauses
    assert timed.part(path)[1:] == (-math.inf, STOP_M)
    assert timed.part(path, ahead=True)[1:] == (STOP_M, math.inf)
    leader.fly(STOP.pause_s)
    assert not timed.pauses
    assert timed.part(path)[1:] == (STOP_M, math.inf)


def test_one_that_takes_the_lead_in_mid_turn_goes_on_at_once_and_one_that_takes_it_before_stays() -> None:
    for waited_s, left_s in ((SETTLE_S + HOLD_S + TURN_S / 2.0, 0.0), (SETTLE_S + 1.0, HOLD_S + TURN_S - 1.0)):
        timed = progress()
        leader = Leader(timed)
        leader.fly(timed.timetable.pauses[0].begin_s + waited_s)
        timed.take_over()
        stood_s, leader.stood_s = leader.stood_s, 0.0
        assert stood_s > 0.0
        leader.fly(HOLD_S + TURN_S + 5.0)
        assert leader.stood_s == pytest.approx(left_s, abs=2.0 * TICK_S)


def test_a_new_leader_that_is_still_turning_ends_its_turn_first() -> None:
    timed = progress()
    leader = Leader(timed)
    leader.fly(timed.timetable.pauses[0].begin_s + SETTLE_S + HOLD_S + 0.5)
    due = timed.advance(leader.at_m, leader.now, TICK_S, None)
    assert due is not None
    turn = due.turn
    assert turn is not None
    other = progress()
    waits = other.advance(40.0, leader.now, TICK_S, turn)
    assert waits is not None
    assert waits.hovers
    assert waits.turn is turn
