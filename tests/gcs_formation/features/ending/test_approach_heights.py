"""How high approaches are is asked of every vehicle that has a parameter for it, before a flight that lands."""

from __future__ import annotations

import math

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from airlink.messages.command import ParamValue
from flight_model.earth import GeodeticOrigin
from gcs_formation.features.ending.approach_heights import ApproachHeights
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.vehicle import Vehicle

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
FIRST, SECOND = EACH = VehicleId(1, 1), VehicleId(1, 2)


def test_all_are_waited_for_and_one_that_tells_it_isnt_asked_again() -> None:
    vehicles = {
        each: Vehicle(
            each,
            place,
            ArduPlane(each.system, ORIGIN, 0.25),
            Connection(0, Address("127.0.0.1", 1), LinkState.CONNECTED),
            10.0,
        )
        for place, each in enumerate(EACH)
    }
    heights, default_m = ApproachHeights(vehicles), vehicles[SECOND].autopilot.highest_approach_m
    assert not heights.passed
    assert {vehicle.identity for vehicle, _ in heights.requests(Instant(0))} == {FIRST, SECOND}
    reported = ParamValue("AUTOLAND_WP_ALT", default_m + 25.0, m.MAV_PARAM_TYPE_REAL32, 1000, 7)
    heights.take_item(vehicles[FIRST], reported, after(Instant(0), 0.1))
    assert not heights.passed
    assert {vehicle.identity for vehicle, _ in heights.requests(after(Instant(0), 5.0))} == {SECOND}
    assert [each.autopilot.highest_approach_m for each in vehicles.values()] == [default_m + 25.0, default_m]
    vehicles[SECOND].connection.state = LinkState.LOST
    assert heights.requests(after(Instant(0), 10.0)) == []
    heights.take_item(vehicles[SECOND], reported, after(Instant(0), 10.1))
    assert heights.passed
    assert heights.refusal(ready=True) is None
