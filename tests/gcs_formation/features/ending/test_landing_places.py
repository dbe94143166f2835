"""Where vehicles land, whom that endangers, and who lands first."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.endpoint import VehicleId
from airlink.messages.telemetry import Attitude
from formation_scenario import load_scenario
from gcs_formation.features.ending.landing_order import Landing, LandingOrder, landing_of, lowest_circle_m
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.stored_mission import LandingSequence
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.flights.test_landing import CONNECTION, LEVEL, ORIGIN, grounded, hovering, order, plane, tell

HOME = st.floats(-3000.0, 3000.0)
COURSE = st.floats(-math.pi, math.pi)
OFF_M = 1e-6


def copter(number: int) -> Vehicle:
    """Return a multirotor in the air that was never seen on the ground."""
    return Vehicle(VehicleId(1, number), number - 1, ArduCopter(number, ORIGIN, 0.25), CONNECTION, 10.0)


@settings(max_examples=20)
@given(HOME, HOME, COURSE, st.floats(-160.0, 70.0), st.floats(-30.0, 30.0))
def test_a_landing_takes_150_m_before_its_home_60_m_beyond_and_25_m_to_either_side_whatever_its_course(
    north_m: float, east_m: float, course_rad: float, along_m: float, right_m: float
) -> None:
    """The strip turns and moves with the landing, and is its own mirror image."""
    landing, cos, sin = Landing(north_m, east_m, course_rad), math.cos(course_rad), math.sin(course_rad)
    inside_m = min(along_m + 150.0, 59.5 - along_m, 25.0 - abs(right_m))
    for lateral_m in (right_m, -right_m):
        place = north_m + along_m * cos - lateral_m * sin, east_m + along_m * sin + lateral_m * cos
        assert abs(inside_m) < OFF_M or landing.reaches(place) == (inside_m > 0.0)


@pytest.mark.parametrize(
    ("along_m", "right_m", "reached"),
    [(-149.9, 0, True), (-150.0, 0, False), (59.4, 0, True), (59.5, 0, False), (0, 24.9, True), (0, -25.0, False)],
)
def test_the_ends_and_sides_of_that_strip(along_m: float, right_m: float, reached: bool) -> None:
    assert Landing(10.0, 20.0, 0.0).reaches((10.0 + along_m, 20.0 + right_m)) is reached


@settings(max_examples=20)
@given(HOME, HOME, COURSE, st.floats(0.0, 6.0))
def test_one_that_comes_down_straight_takes_3_m_around_its_home(
    north_m: float, east_m: float, to_rad: float, away_m: float
) -> None:
    place = north_m + away_m * math.cos(to_rad), east_m + away_m * math.sin(to_rad)
    assert abs(away_m - 3.0) < OFF_M or Landing(north_m, east_m, math.nan).reaches(place) == (away_m < 3.0)
    assert not Landing(0.0, 0.0, math.nan).reaches((0.0, 3.0))


def test_a_fixed_wing_lands_where_it_stood_towards_where_it_took_off() -> None:
    assert landing_of(plane(1, 300.0, -40.0, course_rad=0.7)) == pytest.approx((300.0, -40.0, 0.7), abs=1e-3)


def test_one_with_a_landing_in_its_mission_lands_by_that() -> None:
    for vehicle in (plane(1, 300.0, -40.0), grounded(2, 0.0, 0.0), copter(3)):
        vehicle.autopilot.landing = LandingSequence(500.0, 80.0, 1.2, 70.0)
        assert landing_of(vehicle) == (500.0, 80.0, 1.2)


def test_a_multirotor_comes_down_straight_over_its_home_which_must_be_known_unless_it_stands_there() -> None:
    landing = landing_of(hovering(1, 12.0, 100.0, 0.0))
    assert isinstance(landing, Landing)
    assert (landing.north_m, landing.east_m) == pytest.approx((0.5, 12.0), abs=1e-3)
    assert math.isnan(landing.course_rad)
    aloft = copter(2)
    tell(aloft, 8.0, 9.0, 50.0)
    unknown = "vehicle 2 lands at its home, which it hasn't reported"
    assert landing_of(aloft) == unknown
    planned = landing_of(aloft, planned=True)
    assert isinstance(planned, Landing)
    assert planned[:2] == pytest.approx((8.0, 9.0), abs=1e-3)
    assert landing_of(copter(2), planned=True) == unknown, "where it stands isn't known either"


def test_before_a_take_off_a_fixed_wings_nose_says_its_course() -> None:
    vehicle = grounded(1, 20.0, 30.0)
    assert isinstance(landing_of(vehicle, planned=True), str)
    vehicle.telemetry.store(Attitude(1.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0))
    assert landing_of(vehicle, planned=True) == pytest.approx((20.0, 30.0, 1.5), abs=1e-3)
    assert landing_of(vehicle) == "vehicle 1 lands where it took off, and that was not seen"
    flown = plane(2, 0.0, 0.0, course_rad=0.4)
    flown.telemetry.store(Attitude(1.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0))
    assert landing_of(flown) == pytest.approx((0.0, 0.0, 0.4), abs=1e-3), "it turns in the air"
    flown.take_off.stood = None
    assert isinstance(landing_of(flown, planned=True), str)


def test_a_fixed_wing_of_px4_without_a_stored_landing_can_not_land() -> None:
    vehicle = Vehicle(VehicleId(1, 3), 2, Px4Plane(3, ORIGIN, 0.25), CONNECTION, 10.0)
    assert landing_of(vehicle) == "vehicle 3 can't land by itself"


def test_of_those_in_line_each_lands_after_all_ahead_within_the_length_of_an_approach() -> None:
    """Homes 70 m apart: an approach is low over the next two behind it; those farther back don't matter."""
    found = order(*(plane(number, -70.0 * number, 0.0) for number in range(1, 6)))
    assert found.refusal is None
    names = {number: VehicleId(1, number) for number in range(1, 6)}
    ahead = {number: {names[one] for one in (number - 2, number - 1) if one > 0} for number in range(2, 6)}
    assert found.first == {names[number]: frozenset(before) for number, before in ahead.items()}
    for number in range(2, 6):
        for one in range(1, number):
            blocked = names[one] in ahead[number]
            said = f"vehicle {one} would come in over the place of vehicle {number}" if blocked else None
            assert found.why_not_now([names[number], names[one]]) == said
            assert found.why_not_now([names[one], names[number]]) is None


@pytest.mark.parametrize("turned_deg", [0.0, 77.0, 200.0])
def test_where_each_blocks_the_next_in_a_ring_none_can_be_first(turned_deg: float) -> None:
    """Three homes 100 m apart, each lands away from the next: every approach is low over another's home."""
    turn_rad = math.radians(turned_deg)
    corners = [turn_rad + 2.0 * math.pi * each / 3.0 for each in range(3)]
    radius_m, vehicles = 100.0 / math.sqrt(3.0), []
    for number, at_rad in enumerate(corners, 1):
        course_rad = at_rad - math.radians(30.0)  # away from the next corner, which is at 150° to the left
        vehicles.append(plane(number, radius_m * math.cos(at_rad), radius_m * math.sin(at_rad), course_rad=course_rad))
    assert order(*vehicles[:2]).refusal is None
    found = order(*vehicles)
    assert found.refusal is not None
    assert found.refusal.startswith("vehicle ")
    assert "would come in over the place of vehicle" in found.refusal


def test_only_those_that_fly_and_are_not_their_pilots_land() -> None:
    """Who stands, or is the pilot's, is where it is: in the way, or not."""
    lands, stands, pilots = plane(1, 0.0, 0.0), grounded(2, -100.0, 0.0), plane(3, 0.0, 400.0)
    assert order(lands, stands).refusal == "vehicle 1 would come in over the place of vehicle 2"
    tell(pilots, 20.0, 10.0, 60.0)
    assert order(lands, pilots).refusal is None, "it flies, and its home is far away"
    pilots.member = Member.PARTED
    assert order(lands, pilots).refusal == "vehicle 1 would come in over the place of vehicle 3"


@pytest.mark.parametrize(
    ("flew", "beyond_m", "reached"),
    [(True, 34.4, True), (True, 34.6, False), (False, 59.4, True), (False, 59.6, False)],
)
def test_one_that_has_landed_may_be_nearer_beyond_a_home_than_one_that_has_not_flown(
    flew: bool, beyond_m: float, reached: bool
) -> None:
    """It may have used up 25 m of the 60 m between their homes. Positions are known to half a metre."""
    lands = plane(1, 300.0, -40.0)
    other = plane(2, 300.0 + beyond_m, -40.0) if flew else grounded(2, 300.0 + beyond_m, -40.0)
    if flew:
        tell(other, 300.0 + beyond_m, -40.0, 0.0, armed=False)
    found = order(lands, other)
    said = "vehicle 1 would come in over the place of vehicle 2"
    assert found.refusal == (said if reached else None)
    assert found.why_not_now([lands.identity]) == found.refusal


def test_before_a_flight_all_count_as_those_that_will_fly() -> None:
    each = [grounded(1, 0.0, 0.0), grounded(2, -100.0, 0.0)]
    for vehicle in each:
        vehicle.telemetry.store(Attitude(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    named = {vehicle.identity: vehicle for vehicle in each}
    assert LandingOrder(named, LEVEL, planned=True).first == {VehicleId(1, 2): frozenset({VehicleId(1, 1)})}
    assert LandingOrder(named, LEVEL).first == {}


def test_one_that_still_climbs_out_is_asked_later_where_it_lands() -> None:
    vehicle = plane(1, 0.0, 0.0, height_m=20.0)
    vehicle.take_off.course_rad = None
    assert order(vehicle).refusal == "vehicle 1 lands where it took off, and that was not seen"
    vehicle.telemetry.custom_mode = m.PLANE_MODE_TAKEOFF
    assert order(vehicle).refusal is None
    assert LandingOrder({vehicle.identity: vehicle}, LEVEL, planned=True).refusal is not None
    vehicle.take_off.stood = None
    assert order(vehicle).refusal is not None, "it is nowhere to be seen where it takes off"


@pytest.mark.parametrize(
    ("home_up_m", "hill_m", "stated"), [(0.0, 4.9, False), (0.0, 5.1, True), (30.0, 34.9, False), (30.0, 35.1, True)]
)
def test_ground_within_600_m_may_be_5_m_higher_than_home_but_not_where_one_comes_down_straight(
    home_up_m: float, hill_m: float, stated: bool
) -> None:
    hill = {"shape": "cosine", "north_m": 500, "east_m": 0, "height_m": hill_m, "radius_m": 200}
    away = {"speed_mps": 22, "waypoints_m": [[0, 3000, 100], [2000, 3000, 100]]}
    ground = GroundFloor(load_scenario(scenario(terrain={"clearance_m": 10, "hills": [hill]}, path=away)))
    near, far = plane(1, 0.0, 0.0), plane(1, -310.0, 0.0)
    for vehicle in (near, far):
        assert vehicle.take_off.stood is not None
        vehicle.take_off.stood.height_m = home_up_m
    assert (order(near, ground=ground).refusal is not None) is stated
    assert order(far, ground=ground).refusal is None
    assert order(hovering(1, 0.0, 100.0, 0.0), ground=ground).refusal is None


def test_the_lowest_circle_is_15_m_above_the_highest_approach_of_any_home() -> None:
    """55 m of AUTOLAND_WP_ALT by default; a home 30 m above the origin; a stored approach of 90 m."""
    low, high, third = plane(1, 0.0, 0.0), plane(2, 100.0, 0.0), plane(3, 200.0, 0.0)
    assert high.take_off.stood is not None
    high.take_off.stood.height_m = 30.0
    third.autopilot.landing = LandingSequence(0.0, 0.0, 0.0, 90.0)
    named = {each.identity: each for each in (low, high, third)}
    heights_m = [lowest_circle_m({each.identity: each}) for each in (low, high, third)]
    assert heights_m == pytest.approx([70.0, 100.0, 105.0], abs=0.01)
    assert lowest_circle_m(named) == max(heights_m)
    unseen = plane(4, 0.0, 0.0)
    unseen.take_off.stood = None
    assert lowest_circle_m({unseen.identity: unseen}) == pytest.approx(70.0, abs=0.01), "by its height above home"
    assert lowest_circle_m({VehicleId(1, 5): copter(5)}) == -math.inf
