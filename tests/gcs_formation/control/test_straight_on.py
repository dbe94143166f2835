"""What is commanded once the law's setpoints can't be computed: all fly straight on, those that hover stop."""

from __future__ import annotations

import math

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN
from gcs_formation.control.straight_on import StraightOn
from gcs_formation.estimation.projection import MeasuredStates

MODEL = AutopilotModel(4.0, 1.5, 1.0, 3.0, 16.0, 28.0, 1.5, 0.25, 3.0)
SLOW = AutopilotModel(4.0, 1.5, 1.0, 3.0, 10.0, 18.0, 1.5, 0.25, 3.0)
FAST = AutopilotModel(4.0, 1.5, 1.0, 3.0, 25.0, 40.0, 1.5, 0.25, 3.0)
LOST = FlightState(math.nan, 0.0, 130.0, 0.0, 22.0, 0.0, 0.0, 0.0)


def flying(height_m: float, airspeed_mps: float, heading_rad: float) -> FlightState:
    return FlightState(0.0, 0.0, height_m, 0.0, airspeed_mps, heading_rad, 0.0, 0.0)


EACH = [flying(100.0, 21.0, 0.4), flying(110.0, 22.0, 0.5), flying(120.0, 23.0, 0.6)]


def measured(states: list[FlightState], active: list[bool] | None = None) -> MeasuredStates:
    count = len(states)
    return MeasuredStates(states, vec[i64]([5] * count), active or [True] * count, vec[i64]([6] * count))


def test_all_fly_on_at_the_leaders_last_setpoint_each_at_its_own_height_and_within_its_own_speeds() -> None:
    straight = StraightOn([MODEL, SLOW, FAST], hovers=False)
    known = straight.known(measured(EACH), 0, (22.0, 1.0, 500.0))
    assert straight.setpoints(known) == [(22.0, 1.0, 100.0), (18.0, 1.0, 110.0), (25.0, 1.0, 120.0)]


def test_the_first_setpoint_lasts_whatever_the_leader_is_later() -> None:
    straight = StraightOn([MODEL] * 3, hovers=False)
    straight.known(measured(EACH), 0, (22.0, 1.0, 500.0))
    known = straight.known(measured(EACH), 1, (20.0, 2.0, 500.0))
    assert straight.setpoints(known)[2] == (22.0, 1.0, 120.0)


@pytest.mark.parametrize(("leader", "active", "of"), [(1, [True] * 3, 1), (1, [False, False, True], 2)])
def test_without_a_setpoint_it_is_the_leaders_own_motion_or_else_the_first_known(
    leader: int, active: list[bool], of: int
) -> None:
    straight = StraightOn([MODEL] * 3, hovers=False)
    known = straight.known(measured(EACH, active), leader, (22.0, math.nan, 100.0))
    setpoints = straight.setpoints(known)
    for index, state in enumerate(EACH):
        own = EACH[of].airspeed_mps, EACH[of].heading_rad, state.height_m
        assert setpoints[index] == own if active[index] else math.isnan(setpoints[index][0])


def test_a_state_that_is_not_finite_is_replaced_and_its_vehicle_is_not_commanded() -> None:
    straight = StraightOn([MODEL] * 3, hovers=False)
    states = [LOST, EACH[1], EACH[2]]
    known = straight.known(measured(states), 0, (22.0, 1.0, 100.0))
    assert known.active == [False, True, True]
    assert known.states == [EACH[1], EACH[1], EACH[2]]
    assert (known.stamps[0], known.acts[2]) == (5, 6)
    assert [math.isnan(each[0]) for each in straight.setpoints(known)] == [True, False, False]


def test_an_inactive_vehicle_whose_state_is_finite_keeps_it() -> None:
    known = StraightOn([MODEL] * 3, hovers=False).known(measured(EACH, [True, True, False]), 0, UNKNOWN)
    assert known.active == [True, True, False]
    assert known.states == EACH


def test_while_nothing_is_known_nothing_is_commanded_and_it_has_not_begun() -> None:
    straight = StraightOn([MODEL] * 2, hovers=False)
    known = straight.known(measured([LOST, EACH[1]], [True, False]), 0, (22.0, 1.0, 100.0))
    assert known.active == [False, False]
    assert known.states == [LOST, EACH[1]]
    assert (known.stamps[0], known.acts[1]) == (5, 6)
    assert all(math.isnan(each[1]) for each in straight.setpoints(known))
    assert straight.ahead_m(60.0) == [(0.0, 0.0)]
    begun = straight.known(measured(EACH[:2]), 0, (24.0, 2.0, 100.0))
    assert straight.setpoints(begun)[0] == (24.0, 2.0, 100.0)


def test_the_path_ahead_is_straight_every_165_m_and_reaches_where_they_will_be() -> None:
    """At 22 m/s, 60 s are 1320 m, exactly 8 intervals; a metre more is another point."""
    straight = StraightOn([MODEL] * 3, hovers=False)
    straight.known(measured(EACH), 0, (22.0, math.radians(150.0), 100.0))
    ahead = straight.ahead_m(60.0)
    assert len(ahead) == 9
    for step, (north_m, east_m) in enumerate(ahead):
        assert north_m == pytest.approx(-165.0 * step * math.sqrt(3.0) / 2.0)
        assert east_m == pytest.approx(165.0 * step / 2.0)
    assert len(straight.ahead_m(60.1)) == 10


def test_those_that_hover_stop_where_they_are() -> None:
    straight = StraightOn([MODEL] * 3, hovers=True)
    known = straight.known(measured(EACH), 0, (22.0, 1.0, 100.0))
    assert straight.setpoints(known)[1] == (0.0, 1.0, 110.0)
    assert straight.ahead_m(60.0) == [(0.0, 0.0)]
