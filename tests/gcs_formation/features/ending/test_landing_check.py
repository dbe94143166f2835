"""Before a flight that is to end in landings: what is asked of whom, and when it is judged."""

from __future__ import annotations

import math
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from airlink.messages.command import ParamValue
from airlink.messages.mission import MissionCount, MissionItemInt, MissionRequestInt, MissionRequestList
from airlink.messages.telemetry import Attitude, HomePosition
from formation_scenario import load_scenario
from gcs_formation.features.ending.approach_heights import ApproachHeights, lands
from gcs_formation.features.ending.landing_check import LandingCheck
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.vehicle.autopilot_family import STATION
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.flights.test_landing import ORIGIN, grounded, tell

NOW = Instant(0)
LAND = {"then": "land", "loiter_s": 0}
PLANNED = {then: load_scenario(scenario(finish=LAND | {"then": then})) for then in ("land", "rtl")}
LAND_AT = (900.0, 60.0)


def check_of(*vehicles: Vehicle, then: str = "land") -> LandingCheck:
    return LandingCheck(PLANNED[then], {each.identity: each for each in vehicles})


def connection() -> Connection:
    return Connection(0, Address("127.0.0.1", 1), LinkState.CONNECTED)


def plane(number: int, north_m: float) -> Vehicle:
    """Return a fixed wing that stands with its nose to the north."""
    vehicle = grounded(number, north_m, 0.0)
    vehicle.connection = connection()
    vehicle.telemetry.store(Attitude(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    return vehicle


def px4() -> Vehicle:
    """Return a fixed wing of PX4 at the origin, 30 m above it, which lands by its mission alone."""
    vehicle = Vehicle(VehicleId(1, 1), 0, Px4Plane(1, ORIGIN, 0.25), connection(), 10.0)
    tell(vehicle, 0.0, 0.0, 30.0, armed=False)
    assert vehicle.telemetry.motion is not None
    vehicle.telemetry.motion.above_home_m = 0.0
    return vehicle


def item(number: int, command: int, north_m: float, east_m: float, up_m: float, frame: int) -> MissionItemInt:
    lat_rad, lon_rad, _ = ORIGIN.from_ned(north_m, east_m, 0.0)
    x, y = round(math.degrees(lat_rad) * 1e7), round(math.degrees(lon_rad) * 1e7)
    return MissionItemInt(*STATION, number, frame, command, 0, 1, 0.0, 0.0, 0.0, 0.0, x, y, up_m)


def read(check: LandingCheck, vehicle: Vehicle) -> None:
    """Answer with a mission that approaches from the west to a place, 120 m above sea level."""
    check.take_item(vehicle, MissionCount(*STATION, 2, m.MAV_MISSION_TYPE_MISSION), NOW)
    sea, ground = m.MAV_FRAME_GLOBAL_INT, m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    north_m, east_m = LAND_AT
    for each in (
        item(0, m.MAV_CMD_NAV_WAYPOINT, north_m, east_m - 500.0, 120.0, sea),
        item(1, m.MAV_CMD_NAV_LAND, north_m, east_m, 0.0, ground),
    ):
        check.take_item(vehicle, each, NOW)


def test_a_landing_is_read_from_the_mission_with_its_height_above_home_and_then_nothing_more_is_asked() -> None:
    """120 m above the sea are 90 m above a home at 30 m."""
    vehicle = px4()
    check = check_of(vehicle)
    ((asked, request),) = check.requests(NOW)
    assert asked is vehicle
    assert isinstance(request, MissionRequestList)
    assert check.refusal(ready=True) is None, "it isn't read yet"
    assert not check.passed
    read(check, vehicle)
    check.requests(after(NOW, 1.0))
    landing = vehicle.autopilot.landing
    assert landing == pytest.approx((*LAND_AT, math.pi / 2, 90.0), abs=0.05)
    assert check.refusal(ready=False) is None
    assert not check.passed
    assert check.refusal(ready=True) is None
    assert check.passed
    assert check.requests(after(NOW, 20.0)) == []
    kept = vehicle.autopilot.landing = landing._replace(approach_m=1.0) if landing else None
    check.requests(after(NOW, 21.0))
    assert vehicle.autopilot.landing is kept, "it is taken once"


def test_while_its_height_is_unknown_or_it_is_not_heard_nothing_is_taken_or_asked() -> None:
    vehicle = px4()
    check = check_of(vehicle)
    vehicle.connection.state = LinkState.LOST
    assert check.requests(NOW) == []
    vehicle.connection.state = LinkState.CONNECTED
    assert len(check.requests(NOW)) == 1
    check.take_item(vehicle, MissionCount(*STATION, 2, m.MAV_MISSION_TYPE_MISSION), NOW)
    assert isinstance(check.requests(after(NOW, 2.0))[0][1], MissionRequestInt)
    read(check, vehicle)
    motion, vehicle.telemetry.motion = vehicle.telemetry.motion, None
    check.requests(after(NOW, 3.0))
    assert vehicle.autopilot.landing is None
    vehicle.telemetry.motion = motion
    check.requests(after(NOW, 4.0))
    assert vehicle.autopilot.landing is not None


def answered_by_none(check: LandingCheck) -> str | None:
    for second in range(30):
        check.requests(after(NOW, 2.0 * second))
    return check.refusal(ready=True)


@pytest.mark.parametrize(("only_warns", "said_again"), [(False, True), (True, False)])
def test_one_that_would_come_in_over_another_is_refused_or_where_it_only_warns_said_once(
    only_warns: bool, said_again: bool
) -> None:
    """Two homes 50 m apart, one behind the other."""
    check = check_of(plane(1, 0.0), plane(2, -50.0))
    check.only_warns = only_warns
    assert check.passed is only_warns
    said = "finish.then: found land, but vehicle 1 would come in over the place of vehicle 2; allowed: rtl, loiter, or "
    assert answered_by_none(check) == said + "another place or a stored landing for it"
    assert (check.refusal(ready=True) is not None) is said_again
    assert check.passed is only_warns


def test_vehicles_that_fly_already_are_judged_by_where_they_took_off() -> None:
    stands, flies = plane(1, 0.0), plane(2, 300.0)
    check = check_of(stands, flies)
    tell(flies, 400.0, 0.0, 100.0, course_rad=0.5)
    flies.take_off.stood = None
    assert "that was not seen" in str(answered_by_none(check))
    assert answered_by_none(check_of(plane(1, 0.0), plane(2, 300.0))) is None


def test_without_an_order_to_land_at_the_end_nothing_is_asked_and_all_may_begin() -> None:
    vehicle = px4()
    check = check_of(vehicle, then="rtl")
    assert check.passed
    assert check.requests(NOW) == []
    assert check.refusal(ready=True) is None
    read(check, vehicle)
    assert check.requests(after(NOW, 5.0)) == []
    assert vehicle.autopilot.landing is None, "a mission that another station reads is not taken"


def test_a_multirotor_has_no_mission_to_read_nor_an_approach() -> None:
    vehicle = Vehicle(VehicleId(1, 1), 0, ArduCopter(1, ORIGIN, 0.25), connection(), 10.0)
    tell(vehicle, 0.0, 0.0, 0.0, armed=False)
    check = check_of(vehicle)
    assert check.requests(NOW) == []
    assert check.refusal(ready=True) is None
    assert check.passed
    heights = ApproachHeights({vehicle.identity: vehicle})
    heights.take_item(vehicle, ParamValue("AUTOLAND_WP_ALT", 80.0, m.MAV_PARAM_TYPE_REAL32, 1000, 7), NOW)
    assert heights.passed
    assert heights.requests(NOW) == []


def copter_in_the_air() -> Vehicle:
    """Return a multirotor that hovers 50 m above the origin, and hasn't said where its home is."""
    vehicle = Vehicle(VehicleId(1, 1), 0, ArduCopter(1, ORIGIN, 0.25), connection(), 10.0)
    tell(vehicle, 0.0, 0.0, 50.0)
    assert vehicle.airborne
    return vehicle


def test_a_multirotor_in_the_air_is_asked_for_its_home_each_second_and_judged_once_that_came() -> None:
    vehicle = copter_in_the_air()
    check = check_of(vehicle)
    ((asked, request),) = check.requests(NOW)
    assert asked is vehicle
    assert request == vehicle.autopilot.home_request()
    assert check.requests(after(NOW, 0.5)) == []
    assert check.refusal(ready=True) is None, "it hasn't answered yet"
    assert not check.passed
    assert len(check.requests(after(NOW, 1.0))) == 1
    vehicle.telemetry.store(HomePosition(*ORIGIN.from_ned(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0)))
    assert check.requests(after(NOW, 2.0)) == []
    assert check.refusal(ready=True) is None
    assert check.passed


def test_a_multirotor_in_the_air_that_never_tells_its_home_is_refused_and_asked_while_it_is_heard_alone() -> None:
    vehicle = copter_in_the_air()
    check = check_of(vehicle)
    vehicle.connection.state = LinkState.SEARCHING
    assert check.requests(NOW) == []
    vehicle.connection.state = LinkState.CONNECTED
    assert len(check.requests(NOW)) == 1
    assert "vehicle 1 lands at its home, which it hasn't reported" in str(answered_by_none(check))
    assert check.requests(after(NOW, 60.0)) == []
    assert check_of(copter_in_the_air(), then="rtl").requests(NOW) == []


def test_a_flight_that_goes_on_does_not_wait_for_the_heights_of_approaches() -> None:
    heights = ApproachHeights({VehicleId(1, 1): plane(1, 0.0)})
    assert not heights.passed
    heights.only_warns = True
    assert heights.passed


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"finish": LAND}, True),
        ({"finish": {"then": "rtl"}}, False),
        ({"orders": [{"at_s": 5, "order": "land"}]}, True),
        ({"orders": [{"at_s": 5, "order": "rtl"}]}, False),
        ({}, False),
    ],
)
def test_a_scenario_lands_at_its_end_or_by_an_order(keys: dict[str, Any], expected: bool) -> None:
    assert lands(load_scenario(scenario(**keys))) is expected
