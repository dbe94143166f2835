"""Heights of a formation at its end while the air moves vehicles off them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.features.ending.holding_stack import HoldingStack
from gcs_formation.features.ending.vertical_separation import VerticalSeparation
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion

NOW = Instant(0)
BELOW_M = 12.0


def test_one_that_sinking_air_carries_below_its_height_is_commanded_none_lower() -> None:
    tick: Any = SimpleNamespace(setpoints=[[22.0, 0.0, 100.0]])
    controller: Any = SimpleNamespace(plan=SimpleNamespace(leader=0), last_tick=tick)
    telemetry = SimpleNamespace(motion=None, armed=True)
    vehicle: Any = SimpleNamespace(
        identity=VehicleId(1, 1),
        index=0,
        member=Member.FLYING,
        telemetry=telemetry,
        connection=SimpleNamespace(last_received=NOW),
        round_trips=SimpleNamespace(received_at=lambda _now: NOW),
        autopilot=SimpleNamespace(climbs_out=lambda _seen: False),
    )
    link: Any = SimpleNamespace(ready=True, disobeying=False, received_at=NOW)
    vehicles = {vehicle.identity: vehicle}
    separation = VerticalSeparation(HoldingStack(10.0), controller, vehicles, NOW, 60.0, 3.0)
    telemetry.motion = ReportedMotion(0.0, 0.0, 0.0, 100.0, 22.0, 0.0, 0.0, 100.0)
    for number in range(10):
        link.disobeying = number % 2 == 1
        tick.setpoints[0][2] = separation.steer([link], NOW)[0]
        assert tick.setpoints[0][2] == 100.0
        height_m = tick.setpoints[0][2] - BELOW_M
        telemetry.motion = ReportedMotion(0.0, 0.0, 0.0, height_m, 22.0, 0.0, -1.0, height_m)
