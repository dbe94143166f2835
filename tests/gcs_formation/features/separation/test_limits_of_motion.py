"""Vehicles that may not respond, and what is measured of them: limits from both of their sides, sums by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, after
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation import non_conforming as rule
from gcs_formation.features.separation import resolver as ticks
from gcs_formation.features.separation.accelerations import Accelerations
from gcs_formation.features.separation.approach import ClosestApproach
from gcs_formation.features.separation.conflict_resolution import Conflict, _conflicts
from gcs_formation.features.separation.non_conforming import Candidate, NonConforming, UncommandedMotion
from gcs_formation.recorder import VehicleLink
from tests.gcs_formation.features.separation.crossing import HOVERS, Crossing

NORTH_8 = (8.0, 0.0, 60.0)
START = Instant(0)


def copter() -> AutopilotModel:
    """Return a multirotor of 10 m/s at most and 4 m/s², with a time constant of 2 s."""
    return AutopilotModel(2.0, 0.6, 0.5, 0.5, 0.0, 10.0, 4.0, 0.5, 3.0)


def at_s(seconds: float) -> Instant:
    return after(START, seconds)


def state(north_mps: float = 0.0, east_mps: float = 0.0, north_m: float = 0.0, east_m: float = 0.0) -> FlightState:
    speed_mps, course_rad = math.hypot(north_mps, east_mps), math.atan2(east_mps, north_mps)
    return FlightState(north_m, east_m, 60.0, 0.0, speed_mps, course_rad, 0.0, 0.0)


def sent(*setpoints: Vector3, first_s: float = 0.0, every_s: float = 0.1) -> SetpointHistory:
    history = SetpointHistory(1.0 / every_s)
    for number, each in enumerate(setpoints):
        history.begin_tick(vec[i64]([at_s(first_s + number * every_s)]))
        history.record([each])
    return history


def measured(seen: FlightState, stamp_s: float, *, active: bool = True, acts_s: float | None = None) -> MeasuredStates:
    acts = at_s(stamp_s if acts_s is None else acts_s)
    return MeasuredStates([seen], vec[i64]([at_s(stamp_s)]), [active], vec[i64]([acts]))


@given(st.floats(-math.pi, math.pi), st.floats(1.0, 300.0), st.floats(2.0, 40.0))
@settings(max_examples=20)
def test_a_flight_home_goes_straight_there_within_the_time_or_as_fast_as_it_can(
    way_rad: float, way_m: float, within_s: float
) -> None:
    """Full speed is 10 m/s."""
    home_m = 30.0 + way_m * math.cos(way_rad), -20.0 + way_m * math.sin(way_rad)
    flies = state(north_m=30.0, east_m=-20.0)
    assert rule.distance_m(flies, home_m) == pytest.approx(way_m)
    mps, rad, height_m = rule.homewards(flies, home_m, copter(), within_s)
    assert mps == pytest.approx(min(10.0, way_m / within_s))
    assert math.remainder(rad - way_rad, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert math.isnan(height_m)


@pytest.mark.parametrize(("delay_s", "after_s"), [(0.0, 0.77), (0.3, 1.07), (0.72, 1.49), (0.8, 1.5), (3.0, 1.5)])
def test_an_answer_may_miss_for_the_delay_a_request_and_half_a_second_but_for_1_5_s_at_most(
    delay_s: float, after_s: float
) -> None:
    link = VehicleLink(START)
    link.delay_s = delay_s
    assert rule._suspect_after_s(link) == pytest.approx(after_s)
    for now_s, suspected in ((after_s - 0.01, False), (after_s + 0.01, True)):
        watched = NonConforming(sent(NORTH_8), [copter()], 12.0, hovers=True)
        watched.update(at_s(now_s), [link], [True])
        assert watched.any == suspected


def test_one_that_disobeys_may_not_respond_however_well_it_answers() -> None:
    link, watched = VehicleLink(START), NonConforming(sent(NORTH_8), [copter()], 12.0, hovers=True)
    link.disobeying = True
    watched.update(START, [link], [True])
    assert watched.any
    indices, intents, moved_s, traffic = watched.traffic([0], [], START, [link], measured(state(8.0), 0.0), at_s(2.0))
    assert (indices, moved_s) == ([0], [math.inf])
    assert np.isnan(intents).all()
    assert traffic is not None
    assert (traffic.state.north_m[0], traffic.lead_s[0]) == pytest.approx((16.0, 0.0)), "it flies straight on"


@pytest.mark.parametrize(
    ("candidate", "moved_s"),
    [
        (Candidate(0, None, held=NORTH_8), math.inf),
        (Candidate(0, at_s(5.0), held=NORTH_8), 3.0),
        (Candidate(0, at_s(1.0), held=NORTH_8), 0.0),
        (Candidate(0, at_s(5.0), held=(0.0, 0.0, 60.0)), 0.0),
        (Candidate(0, at_s(5.0), at_s(7.0), (0.0, 0.0), NORTH_8), math.inf),
    ],
)
def test_what_hovers_has_moved_since_its_state_until_it_stopped(candidate: Candidate, moved_s: float) -> None:
    """Seen at 2 s."""
    assert rule._moved_s(candidate, at_s(2.0)) == moved_s


@pytest.mark.parametrize(("seen_s", "found"), [(8.4, 3), (8.5, 3), (8.6, 0)])
def test_one_that_is_reported_to_stop_and_not_seen_for_1_5_s_stops_where_the_command_comes_or_is_repeated(
    seen_s: float, found: int
) -> None:
    """Commanded at 9 s, with 0.4 s under way, and again after 1 s and 2 s; now it is 10 s. It held 8 m/s until then."""
    link = VehicleLink(at_s(10.0))
    link.brakes, link.up_s, link.dead_s = at_s(9.0), 0.3, 0.1
    watched = NonConforming(sent(*[NORTH_8] * 101), [copter()], 12.0, hovers=True)
    watched.update(at_s(10.0), [link], [True])
    assert not watched.any
    seen = vec[i64]([at_s(seen_s)])
    stops = watched._braking([0], at_s(10.0), [link], seen)
    assert [each.hovers_at for each in stops] == [at_s(9.4), at_s(10.4), at_s(11.4)][:found]
    assert [each.held for each in stops] == [NORTH_8] * found
    link.brakes = None
    assert watched._braking([0], at_s(10.0), [link], seen) == []


def test_what_was_held_at_the_last_position_is_kept_until_there_is_another_or_another_command() -> None:
    """Histories end before vehicles are found. Where one has ended already, it flies on by what it held when silent."""
    link, other = VehicleLink(at_s(5.0)), (5.0, 1.0, 60.0)
    watched = NonConforming(sent(*[NORTH_8] * 101), [copter()], 12.0, hovers=True)
    assert watched._last_known(0, at_s(9.0), 0.5, at_s(8.0)) == (at_s(9.5), NORTH_8)
    watched._history = sent(*[other] * 101)
    assert watched._last_known(0, at_s(9.0), 0.7, at_s(8.0)) == (at_s(9.5), NORTH_8)
    assert watched._last_known(0, at_s(9.2), 0.5, at_s(8.0)) == (at_s(9.7), other)
    watched._history = sent(*[NORTH_8] * 101)
    assert watched._last_known(0, at_s(9.2), 0.5, at_s(8.1)) == (at_s(9.7), NORTH_8)
    watched.update(at_s(9.3), [link], [True])
    watched._history = sent(UNKNOWN)
    assert watched._last_known(0, at_s(9.9), 0.0, at_s(8.1)) == (at_s(9.9), NORTH_8)


@pytest.mark.parametrize(("now_s", "may_hover"), [(12.4, False), (12.5, True)])
def test_one_that_receives_nothing_may_hover_half_a_second_before_it_would(now_s: float, may_hover: bool) -> None:
    """3 s after 10 s; it flies on until then, or stops."""
    link = VehicleLink(at_s(10.0))
    link.hovers_after_s = 3.0
    watched = NonConforming(sent(NORTH_8, first_s=10.0), [copter()], 12.0, hovers=True)
    watched.update(at_s(now_s), [link], [True])
    found = watched._candidates([0], at_s(now_s), [link], vec[i64]([at_s(10.0)]))
    assert [each.hovers_at for each in found] == ([None, at_s(13.0)] if may_hover else [None])
    assert {each.held for each in found} == {NORTH_8}


def test_one_that_still_answers_hovers_nowhere_else() -> None:
    """It would hover 1 s after its last setpoint, and 0.6 s after an answer there may be another one."""
    link, watched = VehicleLink(at_s(10.0)), NonConforming(sent(NORTH_8), [copter()], 12.0, hovers=True)
    link.hovers_after_s = 1.0
    for now_s, possible in ((10.6, 0), (10.8, 2)):
        watched.update(at_s(now_s), [link], [True])
        found, *_ = watched.traffic([0], [], at_s(now_s), [link], measured(state(8.0), 10.0), at_s(now_s))
        assert found == [0] * possible


def test_one_that_was_left_may_have_stopped_after_the_last_setpoint_sent_too() -> None:
    link = VehicleLink(at_s(10.0))
    link.hovers_after_s = 3.0
    watched = NonConforming(sent(NORTH_8, first_s=10.0), [copter()], 12.0, hovers=True)
    watched.update(at_s(11.0), [link], [False])
    watched.update(at_s(14.0), [link], [False])
    found = watched._candidates([0], at_s(14.0), [link], vec[i64]([at_s(10.0)]))
    assert [each.hovers_at for each in found] == [None, at_s(13.0), at_s(14.0)]
    watched.update(at_s(14.1), [link], [True])
    assert len(watched._candidates([0], at_s(14.1), [link], vec[i64]([at_s(10.0)]))) == 2


@pytest.mark.parametrize(
    ("turned_rad", "elapsed_s", "turn_rps"),
    [
        (0.2, 1.0, 0.2),
        (-0.2, 0.5, -0.4),
        (0.9, 1.0, 0.5),
        (-0.9, 1.0, -0.5),
        (6.1, 1.0, 6.1 - math.tau),
        (1.0, 30.0, 0.0),
    ],
)
def test_a_turn_rate_is_that_of_the_last_two_headings_within_the_limit(
    turned_rad: float, elapsed_s: float, turn_rps: float
) -> None:
    """0.5 rad/s; states more than half a minute apart tell nothing, and a commanded one's isn't needed."""
    watched = UncommandedMotion(sent(NORTH_8), [copter()], 12.0, hovers=False)
    first, later = state(8.0), state(8.0)
    first.heading_rad, later.heading_rad = 1.0, 1.0 + turned_rad
    watched.update(measured(first, 1.0, active=False))
    watched.update(measured(later, 1.0 + elapsed_s, active=False))
    assert watched.turn_rps == pytest.approx([turn_rps])


def test_an_acceleration_is_averaged_over_half_a_second() -> None:
    """2 m/s² north and -1 m/s² east in steps of 0.1 s: a fifth of the rest each; in steps of 0.5 s at once."""
    watched = UncommandedMotion(sent(NORTH_8), [copter()], 12.0, hovers=True)
    for number in range(4):
        watched.update(measured(state(0.2 * number, -0.1 * number), 1.0 + 0.1 * number, active=False))
    share = 1.0 - 0.8**3
    assert watched.accel_mps2[0] == pytest.approx((2.0 * share, -share))
    watched.update(measured(state(4.6, -0.3), 1.8, active=False))
    assert watched.accel_mps2[0] == pytest.approx((8.0, 0.0))
    assert rule.UncommandedMotion._accelerated(watched, 0, measured(state(1.0, 2.0), 2.0))[:2] == pytest.approx(
        (math.hypot(17.0, 2.0), math.atan2(2.0, 17.0))
    ), "in two seconds"


@pytest.mark.parametrize(
    ("mps", "accel_mps2", "before", "leaves"),
    [
        ((6.4, 0.0), (-1.1, 0.0), False, True),
        ((6.6, 0.0), (-1.1, 0.0), False, False),
        ((6.4, 0.0), (-0.9, 0.0), False, False),
        ((6.4, 0.0), (0.9, 0.0), True, True),
        ((6.4, 0.0), (1.1, 0.0), True, False),
        ((6.6, 0.0), (-1.1, 0.0), True, False),
        ((8.0, 1.6), (0.0, 1.1), False, True),
        ((8.0, -1.6), (0.0, 1.1), False, False),
    ],
)
def test_a_multirotor_leaves_its_command_that_is_1_5_mps_off_and_departs_by_1_mps2(
    mps: tuple[float, float], accel_mps2: tuple[float, float], before: bool, leaves: bool
) -> None:
    """Commanded 8 m/s north; one that has left it does so until it returns by 1 m/s², or is within 1.5 m/s."""
    watched = UncommandedMotion(sent(*[NORTH_8] * 30), [copter()], 12.0, hovers=True)
    watched.accel_mps2, watched.non_conforming = [accel_mps2], [before]
    assert watched._leaves_command(0, measured(state(*mps), 2.5)) == leaves
    new = UncommandedMotion(sent(UNKNOWN, NORTH_8, first_s=2.0, every_s=0.4), [copter()], 12.0, hovers=True)
    new.accel_mps2, new.non_conforming = [accel_mps2], [before]
    assert not new._leaves_command(0, measured(state(*mps), 2.5)), "it had no setpoint a second ago"


def test_a_multirotor_that_is_free_may_go_on_accelerating_or_fly_home() -> None:
    watched = UncommandedMotion(sent(NORTH_8), [copter()] * 3, 12.0, hovers=True)
    watched.accel_mps2 = [(0.0, 0.0), (1.0, 0.0), (0.0, -1.0)]
    links = [SimpleNamespace(flies_home_m=home_m) for home_m in (None, (0.0, 60.0), None)]
    tick: Any = SimpleNamespace(active=[True, False, True], links=links)
    now: Any = SimpleNamespace(states=[state(5.0)] * 3)
    watched.non_conforming[2] = True
    (first, ahead), (second, sideways), (third, home) = watched.intents(tick, [0, 2, 1], now)
    assert (first, second, third) == (1, 2, 2)
    assert ahead[:2] == pytest.approx((math.hypot(5.0, 2.0), math.atan2(-2.0, 5.0)))
    assert sideways[:2] == pytest.approx((7.0, 0.0))
    assert home[:2] == pytest.approx((5.0, math.pi / 2.0))
    assert UncommandedMotion(sent(NORTH_8), [copter()] * 3, 12.0, hovers=False).intents(tick, [0, 2, 1], now) == []


@pytest.mark.parametrize(("acts_s", "north_mps2"), [(5.0, -4.0), (5.1, -3.5), (5.15, -3.25), (5.2, -3.0)])
def test_an_acceleration_changes_until_its_setpoint_acts_towards_what_those_in_flight_want(
    acts_s: float, north_mps2: float
) -> None:
    """It brakes by 4 m/s² at 2 m/s, commanded 8 m/s: it wants some 3 m/s² and gets there by 5 m/s³."""
    watched = UncommandedMotion(sent(*[NORTH_8] * 60), [copter()], 12.0, hovers=True)
    watched.accel_mps2 = [(-4.0, 0.0)]
    predicts = Accelerations(sent(*[NORTH_8] * 60), [copter()], watched, hovers=True)
    assert predicts.of(0, measured(state(2.0), 5.0, acts_s=acts_s)) == pytest.approx((north_mps2, 0.0))
    assert predicts.of(0, measured(state(2.0), 5.0, active=False, acts_s=acts_s)) == (0.0, 0.0)
    fixed = Accelerations(sent(NORTH_8), [copter()], watched, hovers=False)
    assert fixed.of(0, measured(state(2.0), 5.0, acts_s=acts_s)) == (0.0, 0.0)


def test_an_acceleration_that_is_as_wanted_follows_the_velocity_error() -> None:
    """(8 - v) / 2 s, by Euler's steps of 0.1 s: from 6 m/s 1 m/s² and 6.1 m/s, then 0.95 m/s²."""
    watched = UncommandedMotion(sent(*[NORTH_8] * 60), [copter()], 12.0, hovers=True)
    watched.accel_mps2 = [(1.0, 0.0)]
    predicts = Accelerations(sent(*[NORTH_8] * 60), [copter()], watched, hovers=True)
    assert predicts.of(0, measured(state(6.0), 5.0, acts_s=5.2)) == pytest.approx((0.95, 0.0))
    assert predicts.of(0, measured(state(6.0), 5.0, acts_s=5.3)) == pytest.approx((0.9025, 0.0))


@pytest.mark.parametrize(
    ("age_s", "delay_s", "moves_s", "timing_s"),
    [(2.0, 0.5, math.inf, 0.25), (40.0, 0.0, math.inf, 3.0), (2.0, 0.5, 1.0, 0.15), (0.0, math.nan, 9.0, 0.0)],
)
def test_timing_is_uncertain_by_a_tenth_of_a_states_age_and_its_delay(
    age_s: float, delay_s: float, moves_s: float, timing_s: float
) -> None:
    """Up to half a minute, and not for longer than it has moved since."""
    tick: Any = SimpleNamespace(age_s=[age_s], links=[SimpleNamespace(delay_s=delay_s)])
    assert ticks._timing_s(tick, 0, moves_s) == pytest.approx(timing_s)


def test_the_nearest_slots_are_those_of_any_two() -> None:
    slots_m = np.array([(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (30.0, 3.0, 4.0)])
    assert ticks._nearest_m(slots_m) == 5.0
    assert ticks._nearest_m(slots_m[:1]) == math.inf


def test_a_conflict_is_reported_by_the_plain_way_that_comes_nearer() -> None:
    near = ClosestApproach(
        np.array([[9.0, 2.0, 1.0], [3.0, 4.0, 5.0]]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), np.ones((2, 3))
    )
    conflicting = np.array((True, True, False))
    assert _conflicts(7, np.array((3, 4, 5)), near, conflicting) == (Conflict(7, 3, 3.0, 4.0), Conflict(7, 4, 2.0, 2.0))


def test_who_evades_without_interruption_is_timed_by_ticks() -> None:
    """0.1 s each; the second has never evaded, and the first begins again."""
    crossing = Crossing(**HOVERS)
    crossing.keep()
    resolution: Any = SimpleNamespace(side=np.array((-1.0, 0.0)), setpoints=SimpleNamespace(table=np.ones((3, 2))))
    tick = crossing.keep(at_s=0.1)
    timed = list[list[float]]()
    for side in (1.0, -1.0, 0.0, 1.0):
        resolution.side[0] = side
        crossing.resolver._replace(tick, np.array((0, 1)), resolution)
        timed.append(list(crossing.resolver._manoeuvring_s))
    lasted_s = timed[0][0] + crossing.resolver._dt_s
    assert [first for first, _ in timed] == pytest.approx([timed[0][0], lasted_s, 0.0, crossing.resolver._dt_s])
    assert {second for _, second in timed} == {0.0}
    assert tick.yielding == [True, False]
    assert tick.setpoints[0] == (1.0, 1.0, 1.0)
