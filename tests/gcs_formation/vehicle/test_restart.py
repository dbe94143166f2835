"""What a restart of a vehicle's clock leaves of what was known of it."""

from __future__ import annotations

import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.estimation.airspeed import AirspeedCheck
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.vehicle import Vehicle
from tests.gcs_formation.vehicle.conftest import ORIGIN, heartbeat, position

LIMITS_MPS = 16.0, 28.0
CALM = 22.0, 0.0, 0.0
"""Velocity over ground to the north and east, and heading, of a vehicle that flies 22 m/s in calm air."""


def known(*, armed: bool, above_home_m: float) -> Vehicle:
    """Return a vehicle that has reported whether it is armed, and where it is."""
    check = AirspeedCheck(*LIMITS_MPS)
    vehicle = Vehicle(VehicleId(1, 7), 0, ArduPlane(7, ORIGIN, 0.25), Connection(0), 10.0, airspeed_check=check)
    for message in (heartbeat(0, armed=armed), position(above_home_m)):
        vehicle.telemetry.store(message)
    return vehicle


def test_a_sensor_that_was_rejected_before_is_judged_by_its_first_reading_after() -> None:
    vehicle = known(armed=True, above_home_m=100.0)
    check = vehicle.sampler.airspeed_check
    assert check is not None
    assert [check.accepts(500.0, *CALM, 22.0, 1.0), check.accepts(500.1, *CALM, 0.0, 1.0)] == [True, False]
    vehicle.restart(Instant(0))
    assert check.accepts(1.0, *CALM, 22.0, 1.0)


@pytest.mark.parametrize(("armed", "above_home_m", "kept"), [(True, 100.0, True), (False, 0.0, False)])
def test_that_it_is_to_fly_home_holds_while_it_may_fly(*, armed: bool, above_home_m: float, kept: bool) -> None:
    """On the ground it may have been given another battery."""
    vehicle = known(armed=armed, above_home_m=above_home_m)
    vehicle.sent_home = "25% of its battery is left"
    vehicle.restart(Instant(0))
    assert (vehicle.sent_home != "") is kept
