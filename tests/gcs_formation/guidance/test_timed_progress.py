"""A leader's progress by its timetable: led to where it is due, standing at stops, and due where it is when far off."""

from __future__ import annotations

import math

import pytest

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from flight_model.legs.heights import Climbs
from flight_model.legs.turn import TurnLimits
from flight_model.stops.corners import Pass
from flight_model.stops.pacing import Rates
from flight_model.stops.path import PathWithStops, StopPlan
from flight_model.stops.timetable import SETTLE_S, Passage, Timetable
from gcs_formation.guidance.timed_progress import BACK_RADPS, OFF_M, Due, TimedProgress
from gcs_formation.guidance.turn_on_spot import TurnOnSpot

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


def at_s(seconds: float) -> Instant:
    return Instant(round(seconds * NANOSECONDS))


def due_at(timed: TimedProgress, distance_m: float, now_s: float, turn: TurnOnSpot | None = None) -> Due:
    """Return what is due; the leader wasn't ordered to hover."""
    due = timed.advance(distance_m, at_s(now_s), TICK_S, turn)
    assert due is not None
    return due


@pytest.mark.parametrize(
    ("due", "setpoint_mps"),
    [
        (Due(5.0, 0.0, 0.0, hovers=False, turn=None), 5.0),
        (Due(5.0, 1.0, -2.0, hovers=False, turn=None), 5.0 + 0.5 - 0.6),
        (Due(5.0, -2.0, 3.0, hovers=False, turn=None), 5.0 - 1.0 + 0.9),
        (Due(1.0, -4.0, 0.0, hovers=False, turn=None), 0.0),
        (Due(0.0, 0.0, 4.0, hovers=True, turn=None), 0.0),
    ],
)
def test_the_setpoint_leads_the_speed_by_the_lag_and_makes_up_three_tenths_of_a_distance_a_second(
    due: Due, setpoint_mps: float
) -> None:
    """By (7) with a time constant of 0.5 s; no vehicle flies backwards."""
    assert due.setpoint_mps(LAG_S) == pytest.approx(setpoint_mps)


@pytest.mark.parametrize(("elapsed_s", "counted_s"), [(0.1, 0.1), (0.7, 0.7), (1.7, 1.0), (-0.4, 0.0)])
def test_it_is_due_by_the_time_between_two_setpoints_up_to_a_second(elapsed_s: float, counted_s: float) -> None:
    timed = progress()
    assert due_at(timed, 20.0, 3.0).ahead_m == pytest.approx(0.0, abs=1e-6)
    assert due_at(timed, 21.0, 3.0 + elapsed_s).ahead_m == pytest.approx(CRUISE_MPS * counted_s - 1.0, abs=1e-6)


@pytest.mark.parametrize(("off_m", "ahead_m"), [(4.9, -4.9), (-4.9, 4.9), (5.1, 0.0), (-5.1, 0.0)])
def test_up_to_five_metres_off_it_is_led_to_where_it_is_due(off_m: float, ahead_m: float) -> None:
    timed = progress()
    due_at(timed, 30.0, 0.0)
    assert due_at(timed, 30.5 + off_m, 0.1).ahead_m == pytest.approx(ahead_m, abs=1e-6)


def test_from_its_path_s_first_metre_on_it_is_led_to_where_it_is_due() -> None:
    timed = progress()
    due_at(timed, 0.3, 0.0)
    assert due_at(timed, 0.5, 0.1).ahead_m == pytest.approx(0.3)


def test_the_acceleration_that_is_due_is_the_mean_over_the_tick() -> None:
    """Before the stop it brakes; what it flies in each tick adds up to what the timetable says."""
    timed = progress()
    begins_s, speeds_mps, accels_mps2 = timed.timetable.pauses[0].begin_s, list[float](), list[float]()
    for tick in range(int(begins_s / TICK_S)):
        distance_m, _, _ = timed.timetable.after(TICK_S * tick)
        due = due_at(timed, distance_m, TICK_S * tick)
        speeds_mps.append(due.speed_mps)
        accels_mps2.append(due.accel_mps2)
        assert due.ahead_m == pytest.approx(0.0, abs=1e-3)
    assert min(accels_mps2) < -0.8
    for before, after_it, accel_mps2 in zip(speeds_mps, speeds_mps[1:], accels_mps2, strict=False):
        assert after_it - before == pytest.approx(TICK_S * accel_mps2, abs=1e-6)


def test_at_a_stop_it_settles_for_two_seconds_holds_and_then_turns_as_long_as_is_planned() -> None:
    """Whenever ticks are: the turn begins when it is due, and followers have the last two seconds of it."""
    timed, pause = progress(), progress().timetable.pauses[0]
    now_s, turns = 0.03, list[TurnOnSpot]()
    while now_s < pause.end_s + 0.2:
        distance_m, _, _ = timed.timetable.after(now_s - 0.03)
        due = due_at(timed, min(distance_m, STOP_M), now_s)
        since_s = now_s - 0.03 - pause.begin_s
        if abs(since_s) > 0.01 and abs(since_s - STOP.pause_s) > 0.01:
            assert timed.pauses == (0.0 < since_s < STOP.pause_s)
        if abs(since_s - SETTLE_S) > 0.01:
            assert due.hovers == (SETTLE_S < since_s < STOP.pause_s)
        if abs(since_s - SETTLE_S - HOLD_S) > 0.01:
            assert (due.turn is not None) == (SETTLE_S + HOLD_S < since_s < STOP.pause_s)
        turns += [due.turn] if due.turn is not None else []
        now_s += 0.09
    turn = turns[0]
    assert all(each is turn for each in turns)
    assert (turn.begin_rad, turn.by_rad, turn.duration_s) == pytest.approx((0.0, math.pi / 2, TURN_S - 2.0))
    assert seconds_between(Instant(0), turn.begun) == pytest.approx(0.03 + pause.begin_s + SETTLE_S + HOLD_S, abs=1e-6)


def test_a_stop_is_as_long_as_planned_for_a_leader_that_makes_the_turn() -> None:
    """Its own turn isn't one to be ended before time goes on."""
    timed, pause = progress(), progress().timetable.pauses[0]
    turn: TurnOnSpot | None = None
    for tick in range(int(pause.end_s / TICK_S) + 5):
        now_s = TICK_S * tick
        distance_m, _, _ = timed.timetable.after(now_s)
        turn = due_at(timed, distance_m, now_s, turn).turn
        if min(abs(now_s - pause.begin_s), abs(now_s - pause.end_s)) > 0.01:
            assert timed.pauses == (pause.begin_s < now_s < pause.end_s)


def test_who_takes_the_lead_in_mid_turn_is_at_the_stop_until_its_first_setpoint() -> None:
    timed, pause = progress(), progress().timetable.pauses[0]
    leader = Leader(timed)
    leader.fly(pause.begin_s + SETTLE_S + HOLD_S + TURN_S / 2.0)
    timed.take_over()
    assert timed.pauses
    assert not due_at(timed, STOP_M, pause.end_s).hovers
    assert not timed.pauses


def test_where_no_turn_is_planned_it_stands_without_one() -> None:
    straight_on = Passage(STOP_M, STOP_M, 0.0, hold_s=HOLD_S)
    timed = TimedProgress(Timetable(CRUISE_MPS, [CRUISE_MPS] * 2, [straight_on], LENGTH_M, Rates(1.0, 2.0)))
    leader = Leader(timed)
    leader.fly(timed.timetable.end_s)
    assert leader.stood_s == pytest.approx(HOLD_S, abs=2.0 * TICK_S)
    assert leader.turned_s == 0.0


@pytest.mark.parametrize(("off_m", "hovers"), [(-5.2, True), (-5.0, False), (5.0, False), (5.2, True)])
def test_a_new_leader_that_is_far_from_the_stop_stays_where_it_is(off_m: float, hovers: bool) -> None:
    """One that is near still has the rest of two seconds to reach it."""
    timed, pause = progress(), progress().timetable.pauses[0]
    leader = Leader(timed)
    leader.fly(pause.begin_s + 1.0)
    timed.take_over()
    due = timed.advance(STOP_M + off_m, leader.now, TICK_S, None)
    assert due is not None
    assert (due.hovers, due.turn) == (hovers, None)
    assert (due.speed_mps, due.accel_mps2, due.ahead_m) == pytest.approx((0.0, 0.0, -off_m))


def test_a_new_leader_from_before_the_last_stop_is_due_right_after_it() -> None:
    timed = progress()
    leader = Leader(timed)
    leader.fly(timed.timetable.pauses[0].end_s + 4.0)
    timed.take_over()
    due = timed.advance(STOP_M - 20.0, leader.now, TICK_S, None)
    assert due is not None
    assert due.ahead_m == pytest.approx(20.0, abs=0.01)
    assert not timed.pauses


def test_a_new_leader_from_before_the_last_of_several_stops_is_due_right_after_that_one() -> None:
    stops = [Passage(at_m, at_m, 0.0, hold_s=HOLD_S) for at_m in (STOP_M, 140.0)]
    timed = TimedProgress(Timetable(CRUISE_MPS, [CRUISE_MPS] * 3, stops, LENGTH_M, Rates(1.0, 2.0)))
    leader = Leader(timed)
    leader.fly(timed.timetable.pauses[1].end_s + 3.0)
    timed.take_over()
    assert due_at(timed, STOP_M + 10.0, 0.0).ahead_m == pytest.approx(30.0, abs=0.01)


def test_a_new_leader_flies_on_from_where_it_is_once_its_own_turn_is_over() -> None:
    """The turn lasts 2 s, and followers are given as long to end theirs."""
    timed, turn = progress(), TurnOnSpot(0.0, 1.0, at_s(1.0), 2.0)
    due_at(timed, 40.0, 0.9)
    for now_s in (1.0, 3.0, 4.9):
        due = due_at(timed, 40.0, now_s, turn)
        assert (due.speed_mps, due.accel_mps2, due.ahead_m, due.hovers, due.turn) == (0.0, 0.0, 0.0, True, turn)
    due = due_at(timed, 40.0, 5.1, turn)
    assert (due.speed_mps, due.hovers, due.turn) == (CRUISE_MPS, False, None)


def test_ordered_to_fly_at_a_stop_it_is_due_where_it_is() -> None:
    timed = progress()
    leader = Leader(timed)
    leader.fly(timed.timetable.pauses[0].begin_s + SETTLE_S + 1.0)
    timed.order(0.0)
    assert not timed.pauses
    assert timed.advance(leader.at_m, leader.now, TICK_S, None) is None
    timed.order(3.0)
    assert timed.timetable.begin_mps == 3.0
    due = timed.advance(STOP_M + 20.0, leader.now, TICK_S, None)
    assert due is not None
    assert (due.speed_mps, due.ahead_m) == pytest.approx((3.0, 0.0), abs=1e-6)
