"""When setpoints are sent: decisions without I/O; vehicles are mere links here."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import NEVER, Instant, after
from airlink.endpoint import VehicleId
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.fleet.dispatch import HOLD_MAX_S, Dispatch
from gcs_formation.recorder import Tick, VehicleLink
from gcs_formation.vehicle.member import Member
from tests.flights.conftest import scenario

NOW = Instant(0)
LEADER, QUICK, SLOW = 0, 1, 2


def vehicle(index: int, up_s: float) -> SimpleNamespace:
    return SimpleNamespace(
        index=index,
        member=Member.FLYING,
        airborne=True,
        flew=True,
        may_loiter=False,
        clock=SimpleNamespace(one_way_s=up_s, asymmetry_s=0.0, loop_s=0.1),
        jitter=SimpleNamespace(jitter_s=0.0),
        round_trips=SimpleNamespace(received_at=lambda now: now, gnss=None, knows_asymmetry=False),
        autopilot=SimpleNamespace(speeds_mps=None),
        hovers_after_s=math.inf,
        returns_after_s=0.0,
        telemetry=SimpleNamespace(home_m=None),
        setpoints=SimpleNamespace(hurries=False),
        new_setpoints=lambda setpoint, *_: [(str(index), setpoint)],
        forget_setpoints=lambda: None,
    )


def dispatch(*delays_s: float, dead_s: tuple[float, ...] = (0.0, 0.0, 0.0), **law: Any) -> Dispatch:
    """Return the dispatch of a leader and followers with these link delays and dead times."""
    planned = [{"id": 1 + index, "model": {"dead_time_s": each}} for index, each in enumerate(dead_s)]
    planned[0]["role"] = "leader"
    keys = scenario(vehicles=planned, law={"type": "fuzzy_pid", **law})
    vehicles: dict[VehicleId, Any] = {
        VehicleId(1, 1 + index): vehicle(index, delay_s) for index, delay_s in enumerate(delays_s)
    }
    return Dispatch(load_scenario(keys), vehicles)


def links(served: Dispatch) -> list[VehicleLink]:
    return served.links(LEADER, [False] * 3, NOW)[0]


def hold_s(served: Dispatch) -> float:
    return served.links(LEADER, [False] * 3, NOW)[1]


def tick(speed_mps: float = 22.0, active: tuple[bool, ...] = (True, True, True)) -> Tick:
    made = Tick(NOW, 0.0, "flying", LEADER, [VehicleLink(NOW)] * 3, [0.0] * 3, [0.0] * 3, [*active])
    made.setpoints = [(each_mps, 0.0, 100.0) for each_mps in (22.0, speed_mps, 22.0)]
    made.state = [FlightState(0.0, 0.0, 100.0, 0.0, 22.0, 0.0, 0.0, 0.0)] * 3
    return made


def told(served: Dispatch, at_s: float) -> list[str]:
    due: Any = served.pop_due(after(NOW, at_s))
    return [message[0] for _, message in due]


def test_the_leaders_setpoints_wait_until_the_slowest_followers_act():
    served = dispatch(0.05, 0.0, 0.3)
    held_s = hold_s(served)
    assert held_s == pytest.approx(0.3 - 0.05)
    served.accept(tick(), held_s, NOW)
    assert sorted(told(served, 0.0)) == ["1", "2"]
    assert told(served, held_s - 1e-3) == []
    assert told(served, held_s) == ["0"]


def test_what_is_held_back_counts_as_the_leaders_lag():
    delays_s = [link.further_delay_s for link in links(dispatch(0.0, 0.0, 0.3))]
    assert delays_s == pytest.approx([0.05 + 0.3, 0.05, 0.05])


def test_a_dead_time_is_waited_for_like_a_slower_link():
    """The second follower's setpoints act last: 0.1 s by its link, 0.4 s by its autopilot."""
    served = dispatch(0.05, 0.0, 0.1, dead_s=(0.2, 0.0, 0.4))
    assert hold_s(served) == pytest.approx(0.1 + 0.4 - 0.05 - 0.2)
    delays_s = [link.further_delay_s for link in links(served)]
    assert delays_s == pytest.approx([0.05 + 0.2 + hold_s(served), 0.05, 0.05 + 0.4])


@pytest.mark.parametrize(
    ("delays_s", "law", "held_s"),
    [
        ((0.4, 0.0, 0.3), {}, 0.0),
        ((0.0, 0.0, 30.0), {}, HOLD_MAX_S),
        ((0.0, 0.0, 0.3), {"delay_compensation": False}, 0.0),
    ],
)
def test_nothing_is_held_back_for_quicker_followers_forever_or_without_compensation(delays_s, law, held_s):
    assert hold_s(dispatch(*delays_s, **law)) == held_s


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_setpoint_that_is_not_finite_is_never_sent(bad):
    served = dispatch(0.0, 0.0, 0.0)
    served.accept(tick(speed_mps=bad), 0.0, NOW)
    assert sorted(told(served, 10.0)) == ["0", "2"]


def test_who_is_not_commanded_is_sent_nothing_and_a_cleared_queue_sends_nothing():
    served = dispatch(0.0, 0.0, 0.0)
    served.accept(tick(active=(True, True, False)), 0.5, NOW)
    assert told(served, 0.0) == ["1"]
    served.clear()
    assert served.due == NEVER
    assert told(served, 1.0) == []


def test_setpoints_that_are_held_back_do_not_follow_a_leader_that_has_left():
    served = dispatch(0.0, 0.0, 0.3)
    served.accept(tick(), hold_s(served), NOW)
    served._vehicles[0].member = Member.PARTED
    assert sorted(told(served, 10.0)) == ["1", "2"]


def test_once_less_is_held_back_no_older_setpoint_comes_after_a_newer_one():
    """The slowest follower is lost, and the leader's setpoints no longer wait for it."""
    served = dispatch(0.0, 0.0, 0.3)
    leader: Any = served._vehicles[0]
    leader.new_setpoints = lambda setpoint, *_: [(str(setpoint.speed_mps), setpoint)]
    for at_s, held_s, speed_mps in ((0.0, 0.15, 20.0), (0.1, 0.3, 21.0), (0.2, 0.0, 22.0)):
        made = tick()
        made.setpoints[LEADER] = (speed_mps, 0.0, 100.0)
        served.accept(made, held_s, after(NOW, at_s))
    assert sorted(told(served, 1.0)) == ["1", "1", "1", "2", "2", "2", "20.0", "22.0"]
