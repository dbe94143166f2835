"""How much the leader is slowed down for one that is saturated, how slots wait for it, and what is said of it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from flight_model.slot import Vector3
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.saturation.feature import FEATURE
from tests.gcs_formation.event_log import EventLog

BEGIN_S, DT_S, AGE_S = 50.0, 0.1, 0.3
COURSE_RAD, WIND_MPS = 2.5, 6.0
"""All fly on one course, against the wind."""
LEADER = 1


class Reserve:
    """Three multirotors of 9 m/s at most, the second of which leads, 10 ticks a second, and what limits them.

    The first reaches 4.5 m/s over ground where the law commands 7 m/s; the others fly at 5 m/s as commanded.
    """

    def __init__(self) -> None:
        self.commanded_mps, self.reached_mps = [7.0, 5.0, 5.0], [4.5, 9.0, 9.0]
        self.active, self.received = [True] * 3, [True] * 3
        self.leader_mps = self.waits_m = math.nan
        """Bound of the leader's speed, and error from which on slots wait."""
        self.bounds_mps = [math.nan] * 3
        self.log, self.ticks = EventLog(), 0
        self._history = SetpointHistory(1.0 / DT_S)
        self._filters = [SimpleNamespace(state=None, stamp=0) for _ in range(3)]
        self.controller = SimpleNamespace(
            models=[SimpleNamespace(speed_max_mps=9.0)] * 3,
            count=3,
            history=self._history,
            estimator=SimpleNamespace(filters=self._filters),
            bound_leader=lambda mps: setattr(self, "leader_mps", mps),
            wait_from=lambda error_m: setattr(self, "waits_m", error_m),
            bound_speed=self.bounds_mps.__setitem__,
        )
        cycle: Any = SimpleNamespace(
            controller=self.controller,
            scenario=SimpleNamespace(law=SimpleNamespace(rate_hz=1.0 / DT_S), hovers=True),
            each=[SimpleNamespace(index=index, identity=VehicleId(1 + index, 1)) for index in range(3)],
            findings=SimpleNamespace(saturated=[False] * 3),
            log_event=self.log,
        )
        self.cycle, (self._stage,) = cycle, FEATURE.stages(cycle)

    def run(self, ticks: int = 1) -> float:
        """Fly on; return the leader's bound."""
        for _ in range(ticks):
            now = after(Instant(0), BEGIN_S + self.ticks * DT_S)
            self.ticks += 1
            setpoints: list[Vector3] = [(mps, COURSE_RAD, 60.0) for mps in self.commanded_mps]
            self._history.begin_tick(vec[i64]([now] * 3))
            self._history.record(setpoints)
            for index, seen in enumerate(self._filters):
                if self.received[index]:
                    seen.stamp, seen.state = after(now, -AGE_S), self._flown(index)
            self.cycle.now = now
            self.cycle.tick = SimpleNamespace(setpoints=setpoints, active=list(self.active), leader=LEADER)
            self._stage.run(self.cycle)
        return self.leader_mps

    def restart(self, index: int) -> None:
        """Forget the state of a vehicle that has restarted, and receive nothing of it."""
        self._filters[index].state, self.received[index] = None, False

    def _flown(self, index: int) -> FlightState:
        through_air_mps = WIND_MPS + min(self.commanded_mps[index], self.reached_mps[index])
        wind = -WIND_MPS * math.cos(COURSE_RAD), -WIND_MPS * math.sin(COURSE_RAD)
        return FlightState(0.0, 0.0, 60.0, 0.0, through_air_mps, COURSE_RAD, *wind)

    @property
    def saturated(self) -> list[bool]:
        return list(self.cycle.findings.saturated)


FIRST = 17
"""Ticks until the first is found to be saturated: by the samples at 0.1, 0.5, 0.9 and 1.3 s, each 0.3 s old.

The one before them is older than any setpoint."""


def saturated() -> Reserve:
    """Return a formation whose first vehicle has just been found to be saturated."""
    reserve = Reserve()
    reserve.run(FIRST)
    return reserve


def test_one_is_saturated_by_four_samples_0_4_s_apart_at_which_it_was_commanded() -> None:
    reserve = Reserve()
    assert reserve.run(FIRST - 1) == reserve.waits_m == math.inf
    assert (reserve.saturated, reserve.bounds_mps) == ([False] * 3, [math.inf] * 3)
    reserve.run()
    assert reserve.saturated == [True, False, False]


def test_it_is_commanded_1_mps_more_than_it_reaches_at_most_and_slots_wait_for_errors_of_half_a_metre() -> None:
    reserve = saturated()
    assert reserve.bounds_mps == pytest.approx([5.5, math.inf, math.inf])
    assert reserve.waits_m == 0.5


def test_the_leaders_bound_falls_from_its_speed_by_2_mps2_while_any_is_commanded_all_that_it_reaches() -> None:
    """7 m/s are 3 m/s more than 4.5 m/s less a reserve of 0.5 m/s."""
    reserve = saturated()
    assert [reserve.leader_mps, reserve.run(), reserve.run(), reserve.run(10)] == pytest.approx([4.8, 4.6, 4.4, 2.4])


def test_it_falls_by_the_excess_where_that_is_less() -> None:
    """4.125 m/s are 0.125 m/s more than 4 m/s, and 3.9 m/s aren't."""
    reserve = saturated()
    reserve.commanded_mps[0] = 4.125
    assert [reserve.run(), reserve.run()] == pytest.approx([4.675, 4.55])
    reserve.commanded_mps[0] = 3.9
    assert reserve.run() == pytest.approx(4.58)


def test_it_falls_to_1_mps_at_least() -> None:
    reserve = saturated()
    assert reserve.run(18) == pytest.approx(1.2)
    assert [reserve.run(), reserve.run(), reserve.run(20)] == [1.0] * 3


def test_it_rises_by_0_3_mps2_and_ends_2_mps_above_the_leaders_speed() -> None:
    """From 4.8 m/s; the leader wants 5 m/s."""
    reserve = saturated()
    reserve.commanded_mps[0] = 3.5
    assert [reserve.run(), reserve.run()] == pytest.approx([4.83, 4.86])
    assert reserve.run(71) == pytest.approx(6.99)
    assert reserve.run() == math.inf
    assert reserve.run(3) == math.inf


@pytest.mark.parametrize(("commanded_mps", "expected_mps"), [(7.0, 2.8), (4.125, 2.875)])
def test_a_bound_above_the_leaders_speed_falls_from_that_speed(commanded_mps: float, expected_mps: float) -> None:
    reserve = saturated()
    reserve.commanded_mps = [commanded_mps, 3.0, 5.0]
    assert reserve.run() == pytest.approx(expected_mps)


def test_one_that_is_not_commanded_slows_nothing_down_and_is_found_saturated_by_four_new_samples() -> None:
    """Checks are 4 ticks apart. Its limit is kept meanwhile."""
    reserve = saturated()
    reserve.active[0] = False
    assert reserve.run() == pytest.approx(4.83)
    reserve.run(3)
    assert (reserve.saturated[0], reserve.waits_m) == (False, 0.5)
    reserve.active[0] = True
    reserve.run(15)
    assert not reserve.saturated[0]
    reserve.run()
    assert reserve.saturated[0]


def test_of_one_that_was_never_received_nothing_is_known() -> None:
    reserve = Reserve()
    reserve.received[0] = False
    assert reserve.run(40) == math.inf
    assert not any(reserve.saturated)


def test_what_one_flew_before_it_restarted_does_not_count() -> None:
    reserve = Reserve()
    reserve.run(FIRST - 4)
    reserve.restart(0)
    reserve.run(4)
    reserve.received[0] = True
    reserve.run(12)
    assert not reserve.saturated[0]
    reserve.run(4)
    assert reserve.saturated[0]


def test_a_sample_counts_once_however_long_it_is_the_newest() -> None:
    reserve = Reserve()
    reserve.run(FIRST - 4)
    reserve.received[0] = False
    reserve.run(20)
    assert not reserve.saturated[0]
    reserve.received[0] = True
    reserve.run(4)
    assert reserve.saturated[0]


def test_it_is_reported_when_it_begins_and_when_the_last_time_was_more_than_20_s_ago() -> None:
    reserve = saturated()
    reserve.run(40)
    text = "flies 4.5 m/s over ground, commanded 7.0: all that it reaches at present; the leader leaves it 0.5 m/s"
    figures = pytest.approx({"begins": True, "speed_mps": 4.5, "commanded_mps": 7.0})
    assert reserve.log == [(pytest.approx(51.6), "saturated", text, 1, figures)]
    last_s = 51.6 + 4.0
    reserve.commanded_mps[0] = 4.0
    reserve.run(203)
    assert len(reserve.log) == 1
    reserve.run(100)
    ended = pytest.approx(last_s + 20.4), "saturated", "reaches its commanded speed again", 1, {"begins": False}
    assert reserve.log[1:] == [ended]
    reserve.commanded_mps[0] = 7.0
    reserve.run(20)
    assert [each.details["begins"] for each in reserve.log] == [True, False, True]


def test_fixed_wings_have_no_such_limit_over_ground() -> None:
    cycle: Any = SimpleNamespace(scenario=SimpleNamespace(hovers=False))
    assert FEATURE.stages(cycle) == []
