"""Heights of a formation at its end while the air moves vehicles off them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.estimation.projection import FORGOTTEN_AFTER_S
from gcs_formation.features.ending.holding_stack import HoldingStack
from gcs_formation.features.ending.vertical_separation import VerticalSeparation
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion

NOW = Instant(0)
BELOW_M = 12.0


def separation_of(*heights_m: float) -> tuple[VerticalSeparation, list[Any], list[Any], Any]:
    """Return the separation of vehicles that fly at their height setpoints, with these, their links and the tick."""
    tick: Any = SimpleNamespace(setpoints=[[22.0, 0.0, height_m] for height_m in heights_m])
    controller: Any = SimpleNamespace(plan=SimpleNamespace(leader=0), last_tick=tick)
    each: list[Any] = [
        SimpleNamespace(
            identity=VehicleId(1, index + 1),
            index=index,
            member=Member.FLYING,
            may_loiter=False,
            telemetry=SimpleNamespace(motion=at(height_m), armed=True),
            connection=SimpleNamespace(last_received=NOW),
            round_trips=SimpleNamespace(received_at=lambda now: now),
            autopilot=SimpleNamespace(climbs_out=lambda _seen: False),
        )
        for index, height_m in enumerate(heights_m)
    ]
    links: list[Any] = [SimpleNamespace(ready=True, disobeying=False, received_at=NOW) for _ in each]
    vehicles = {vehicle.identity: vehicle for vehicle in each}
    return VerticalSeparation(HoldingStack(10.0), controller, vehicles, NOW, 60.0, 3.0), each, links, tick


def at(height_m: float) -> ReportedMotion:
    return ReportedMotion(0.0, 0.0, 0.0, height_m, 22.0, 0.0, 0.0, height_m)


def test_one_that_sinking_air_carries_below_its_height_is_commanded_none_lower() -> None:
    separation, (vehicle,), (link,), tick = separation_of(100.0)
    for number in range(10):
        link.disobeying = number % 2 == 1
        tick.setpoints[0][2] = separation.steer([link], after(NOW, 2.0 * number))[0]
        assert tick.setpoints[0][2] == 100.0
        vehicle.telemetry.motion = at(tick.setpoints[0][2] - BELOW_M)


@pytest.mark.parametrize("gone", ["disarmed", "silent", "without a position"])
def test_one_that_is_down_or_long_silent_takes_no_height_from_the_others(gone: str) -> None:
    separation, (first, second), links, _ = separation_of(100.0, 100.0)
    now = after(NOW, FORGOTTEN_AFTER_S + 1.0)
    first.connection.last_received = now
    if gone != "silent":
        second.connection.last_received = now
    second.telemetry.armed = gone != "disarmed"
    second.telemetry.motion = None if gone == "without a position" else at(100.0)
    first_m, second_m = separation.steer(links, now)
    assert first_m == 100.0
    assert math.isnan(second_m)


def test_a_doubt_that_is_dropped_soon_moves_nobody_and_a_confirmed_one_does() -> None:
    separation, _, links, _ = separation_of(100.0, 100.0)
    assert separation.steer(links, NOW) == [100.0, 115.0]
    links[1].disobeying = True
    assert separation.steer(links, after(NOW, 1.4)) == [100.0, 115.0]
    assert separation.steer(links, after(NOW, 1.5)) == [115.0, 100.0]


@pytest.mark.parametrize("may_loiter", [False, True])
def test_one_that_disobeyed_before_or_may_circle_is_not_waited_for(may_loiter: bool) -> None:
    separation, (_, vehicle), links, _ = separation_of(100.0, 100.0)
    if may_loiter:
        assert separation.steer(links, NOW) == [100.0, 115.0]
        vehicle.may_loiter = True
    links[1].disobeying = True
    assert separation.steer(links, NOW) == [115.0, 100.0]
