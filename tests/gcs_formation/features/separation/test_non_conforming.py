"""Where a multirotor may be that has received nothing since 10 s: on its way, hovering, or on its way home."""

from __future__ import annotations

import math

import pytest
from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, after
from flight_model.flight_state import FlightState
from formation_scenario import load_scenario
from gcs_formation.estimation.projection import MeasuredStates
from gcs_formation.estimation.setpoint_history import SetpointHistory
from gcs_formation.features.separation.non_conforming import NonConforming
from gcs_formation.from_scenario import autopilot_models
from gcs_formation.recorder import VehicleLink
from tests.flights.conftest import scenario

SPEED_MPS, HELD_S = 8.0, 3.0
"""It flies north at that speed, and goes on so for that long after its last setpoint."""


def at_s(seconds: float) -> Instant:
    return after(Instant(0), seconds)


def possible(now_s: float, home_m: tuple[float, float] | None) -> list[tuple[float, float, float]]:
    """Return its possible positions, north, with their speeds and for how long it has had its intent, by north."""
    path = {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 60], [900, 0, 60]]}
    planned = load_scenario(scenario(vehicles={"count": 1, "model": "arducopter"}, path=path))
    history, models = SetpointHistory(planned.law.rate_hz), autopilot_models(planned)
    history.begin_tick(vec[i64]([at_s(10.0)]))
    history.record([(SPEED_MPS, 0.0, 60.0)])
    state = FlightState(0.0, 0.0, 60.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    link = VehicleLink(at_s(10.0))
    link.hovers_after_s, link.returns_after_s, link.home_m = HELD_S, 8.0, home_m
    rule, now = NonConforming(history, models, 12.0, hovers=True), at_s(now_s)
    rule.update(now, [link], [True])
    measured = MeasuredStates([state], vec[i64]([at_s(10.0)]), [True], vec[i64]([now]))
    _, _, _, traffic = rule.traffic([0], [], now, [link], measured, now)
    assert traffic is not None
    table = zip(traffic.state.north_m, traffic.state.airspeed_mps, traffic.lead_s, strict=True)
    return sorted((float(north_m), float(mps), float(lead_s)) for north_m, mps, lead_s in table)


def test_before_it_may_stop_it_flies_on_by_what_it_holds() -> None:
    assert possible(12.0, None) == [pytest.approx((2.0 * SPEED_MPS, SPEED_MPS, 0.0))]


def test_when_it_may_have_stopped_it_brakes_or_flies_on() -> None:
    stopped, flying = possible(20.0, None)
    assert flying == pytest.approx((10.0 * SPEED_MPS, SPEED_MPS, 0.0))
    assert stopped[0] > HELD_S * SPEED_MPS + 4.0, "it needs some way to stop"
    assert stopped[1:] == pytest.approx((0.0, 0.0), abs=0.1)


def test_when_it_may_be_on_its_way_home_it_has_stopped_before_unless_it_left_at_once() -> None:
    """It leaves at 13 s, when it would stop, at 18 s at the latest, or at a third or two thirds of that time."""
    hovering, leaving = possible(20.0, None)[0], possible(20.0, (-400.0, 0.0))
    by_lead = sorted((lead_s, north_m, mps) for north_m, mps, lead_s in leaving if lead_s > 0.0)
    assert [lead_s for lead_s, _, _ in by_lead] == pytest.approx([2.0, 2.0 + 5.0 / 3.0, 2.0 + 10.0 / 3.0, 7.0])
    (_, last_m, last_mps), *_, (_, first_m, first_mps) = by_lead
    assert (first_m, first_mps) == pytest.approx((HELD_S * SPEED_MPS, SPEED_MPS))
    assert (last_m, last_mps) == pytest.approx(hovering[:2], abs=0.5)
    assert len(leaving) == 6


@pytest.mark.parametrize(
    ("now_s", "home_m", "leaving"), [(26.0, (-400.0, 0.0), 4), (26.0, (-10.0, 0.0), 3), (31.0, (-10.0, 0.0), 0)]
)
def test_who_would_be_home_by_now_is_left_out(now_s: float, home_m: tuple[float, float], leaving: int) -> None:
    """A way home of less than 12 s at full speed is reckoned to take these 12 s."""
    assert sum(lead_s > 0.0 for _, _, lead_s in possible(now_s, home_m)) == leaving


def test_who_has_nothing_held_flies_straight_on() -> None:
    """Its history begins only later: its setpoint then isn't known."""
    path = {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 60], [900, 0, 60]]}
    planned = load_scenario(scenario(vehicles={"count": 1, "model": "arducopter"}, path=path))
    history = SetpointHistory(planned.law.rate_hz)
    history.begin_tick(vec[i64]([at_s(10.0)]))
    history.record([(math.nan, math.nan, math.nan)])
    rule = NonConforming(history, autopilot_models(planned), 12.0, hovers=True)
    link = VehicleLink(at_s(10.0))
    rule.update(at_s(10.7), [link], [True])
    assert not rule.any
    rule.update(at_s(10.8), [link], [True])
    assert rule.any, "0.27 s between requests, and 0.5 s for those that are lost"
    state = FlightState(0.0, 0.0, 60.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    measured = MeasuredStates([state], vec[i64]([at_s(10.0)]), [True], vec[i64]([at_s(11.0)]))
    *_, traffic = rule.traffic([0], [], at_s(11.0), [link], measured, at_s(11.0))
    assert traffic is not None
    assert traffic.state.north_m.tolist() == pytest.approx([SPEED_MPS])
