"""The order `land`: one vehicle after another, each where it took off."""

from __future__ import annotations

import math
from itertools import combinations

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from airlink.messages.command import CommandAck
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import GlobalPositionInt
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.features.ending.landing_order import LandingOrder
from gcs_formation.features.ending.landings import Landings
from gcs_formation.fleet.circle_heights import GroundFloor, loiter_heights
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.phases import Phase
from gcs_formation.vehicle.families.arducopter.arducopter import ArduCopter
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.vehicle import Vehicle
from sim_vehicles.airframe.body import Body
from sim_vehicles.autopilot.modes_and_failsafe import Condition, Mode
from tests.flights.conftest import STRAIGHT, scenario
from tests.flights.in_memory import World

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
NOW = Instant(0)
CONNECTION = Connection(0, Address("127.0.0.1", 1), LinkState.CONNECTED)
LEVEL = GroundFloor(load_scenario(scenario()))


def places(bodies: list[Body]) -> list[tuple[float, float, float]]:
    """Return their positions: north, east, height, m."""
    states = [body.state for body in bodies]
    return [(each.north_m, each.east_m, each.height_m) for each in states]


@pytest.mark.slow
def test_they_land_one_after_another_each_where_it_took_off() -> None:
    world = World(
        start={"in_air": False},
        formation={"shape": "line", "spacing_m": 40},
        duration_s=60,
        orders=[{"at_s": 5, "order": "land"}],
        finish={"loiter_s": 0},
    )
    began = places(world.fleet.bodies)
    min_m = math.inf
    world.fly_to(5.0)
    while not world.station.flight.ended:
        world.run(0.2)
        flying = [each for each in world.fleet.vehicles if each.pilot.condition is Condition.FLYING]
        assert len([each for each in flying if each.pilot.mode is Mode.AUTOLAND]) <= 1
        distance_m = [math.dist(one, other) for one, other in combinations(places([each.body for each in flying]), 2)]
        min_m = min([min_m, *distance_m])
    assert min_m > 12.0
    assert world.station.flight.phase is Phase.DONE
    assert [each.pilot.condition for each in world.fleet.vehicles] == [Condition.DISARMED] * 3
    ended = places(world.fleet.bodies)
    assert max(math.dist(one[:2], other[:2]) for one, other in zip(began, ended, strict=True)) < 60.0


@pytest.mark.slow
def test_none_lands_while_one_that_restarted_as_it_landed_is_still_low() -> None:
    """It used to count as landed, because nothing said that it was armed."""
    orders = [{"at_s": 5, "order": "land"}]
    world = World(start={"in_air": False}, vehicles={"count": 2}, duration_s=60, orders=orders, finish={"loiter_s": 0})
    world.fly_to(5.0)
    world.network.run(lambda: any(each.pilot.mode is Mode.AUTOLAND for each in world.fleet.vehicles))
    first, other = (1, 2) if world.vehicle(1).pilot.mode is Mode.AUTOLAND else (2, 1)
    world.run(10.0)
    world.inject(first, "restart")
    world.run()
    assert not world.times_s("mode", other, "AUTOLAND")
    assert [each.pilot.mode for each in world.fleet.vehicles] == [Mode.RTL] * 2
    assert "that was not seen" in str(world.station.phase_machine.failure)


def plane(number: int, north_m: float, east_m: float, height_m: float = 100.0, course_rad: float = 0.0) -> Vehicle:
    """Return a vehicle that took off from a place on the ground, and circles over it."""
    vehicle = Vehicle(VehicleId(1, number), number - 1, ArduPlane(number, ORIGIN, 0.25), CONNECTION, 10.0)
    for armed, up_m in ((False, 0.0), (True, 20.0), (True, height_m)):
        tell(vehicle, north_m, east_m, up_m, armed=armed, course_rad=course_rad)
    vehicle.commands.send((), NOW)
    return vehicle


def grounded(number: int, north_m: float, east_m: float) -> Vehicle:
    """Return a vehicle that hasn't taken off."""
    vehicle = Vehicle(VehicleId(1, number), number - 1, ArduPlane(number, ORIGIN, 0.25), CONNECTION, 10.0)
    tell(vehicle, north_m, east_m, 0.0, armed=False)
    return vehicle


def tell(
    vehicle: Vehicle,
    north_m: float,
    east_m: float,
    height_m: float,
    *,
    armed: bool = True,
    course_rad: float = 0.0,
    rolls_mps: float = 0.0,
    flies_mps: float = 20.0,
) -> None:
    base, status = (m.MAV_MODE_FLAG_SAFETY_ARMED, m.MAV_STATE_ACTIVE) if armed else (0, m.MAV_STATE_STANDBY)
    kind = m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA
    vehicle.telemetry.store(Heartbeat(*kind, base, m.PLANE_MODE_RTL, status))
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(north_m, east_m, -height_m)
    speed_mps = flies_mps if armed else rolls_mps
    velocity = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), 0.0
    vehicle.telemetry.store(GlobalPositionInt(1.0, lat_rad, lon_rad, alt_m, height_m, *velocity, 0.0))
    vehicle.take_off.update_position(vehicle.telemetry)


def motion(height_m: float) -> ReportedMotion:
    return ReportedMotion(0.0, 0.0, 0.0, height_m, 20.0, 0.0, 0.0, height_m)


def refusal(*vehicles: Vehicle, ground: GroundFloor = LEVEL) -> str | None:
    return order(*vehicles, ground=ground).refusal


def order(*vehicles: Vehicle, ground: GroundFloor = LEVEL) -> LandingOrder:
    return LandingOrder({vehicle.identity: vehicle for vehicle in vehicles}, ground)


@pytest.mark.parametrize(
    ("place", "course_deg", "in_way"),
    [
        ((0.0, 30.0), 0.0, False),
        ((0.0, 20.0), 0.0, True),
        ((-140.0, 0.0), 0.0, True),  # it would approach low over the other
        ((-160.0, 0.0), 0.0, False),
        ((50.0, 0.0), 0.0, True),  # it would roll there
        ((70.0, 0.0), 0.0, False),
        ((0.0, -140.0), 90.0, True),
        ((-140.0, 0.0), 90.0, False),
        ((-90.0, -90.0), 45.0, True),
        ((90.0, -90.0), 45.0, False),
        ((90.0, -90.0), -225.0, True),
    ],
)
def test_none_lands_where_another_stands(place: tuple[float, float], course_deg: float, in_way: bool) -> None:
    """A vehicle that took off at the origin, and another that is on the ground."""
    lands, stands = plane(1, 0.0, 0.0, course_rad=math.radians(course_deg)), grounded(2, *place)
    said = "vehicle 1 would come in over the place of vehicle 2"
    assert refusal(lands, stands) == (said if in_way else None)


def test_who_was_not_seen_to_take_off_can_not_land() -> None:
    vehicle = plane(1, 0.0, 0.0)
    vehicle.take_off.stood = None
    assert refusal(vehicle) == "vehicle 1 lands where it took off, and that was not seen"


def test_the_ground_around_must_be_level() -> None:
    hill = {"shape": "cosine", "north_m": 500, "east_m": 0, "height_m": 40, "radius_m": 100}
    rough = load_scenario(scenario(terrain={"clearance_m": 10, "hills": [hill]}, path=STRAIGHT))
    said = "the ground within 600 m of where vehicle 1 lands is 40 m higher"
    assert refusal(plane(1, 0.0, 0.0), ground=GroundFloor(rough)) == said
    assert refusal(plane(1, -300.0, 0.0), ground=GroundFloor(rough)) is None


@pytest.mark.parametrize(("ahead_m", "in_way"), [(30.0, True), (40.0, False)])
def test_one_that_has_landed_short_of_its_home_leaves_the_next_less_room(ahead_m: float, in_way: bool) -> None:
    landed, lands = plane(1, 60.0, 0.0), plane(2, 0.0, 0.0)
    tell(landed, ahead_m, 0.0, 0.0, armed=False)
    assert (refusal(lands, landed) is not None) == in_way


def test_those_of_a_diamond_land_over_one_approach_the_foremost_first() -> None:
    slots = [(0.0, 0.0), (-30.0, -30.0), (-30.0, 30.0), (-60.0, 0.0)]
    found = order(*(plane(n, *slot) for n, slot in enumerate(slots, 1)))
    assert found.refusal is None
    first, last = VehicleId(1, 1), VehicleId(1, 4)
    assert found.first == {last: frozenset({first})}
    assert found.why_not_now([last, first]) == "vehicle 1 would come in over the place of vehicle 4"
    assert found.why_not_now([first, last]) is None


def test_those_that_stand_too_near_behind_one_another_can_not_land() -> None:
    assert refusal(plane(1, 0.0, 0.0), plane(2, -50.0, 0.0)) == "vehicle 1 would come in over the place of vehicle 2"


def test_who_lands_first_circles_lowest_even_if_it_flew_highest() -> None:
    high, low = VehicleId(1, 1), VehicleId(1, 2)
    places = {high: motion(120.0), low: motion(100.0)}
    assert loiter_heights(places, 0.0, together=True) == {low: 100.0, high: 120.0}
    found = loiter_heights(places, 0.0, together=True, first={low: frozenset({high})})
    assert found == {high: 120.0, low: 135.0}


def waiting(*vehicles: Vehicle) -> Landings:
    landings = Landings(lambda following: order(*vehicles).why_not_now(following))
    for level, vehicle in reversed(list(enumerate(vehicles))):
        landings.await_turn(vehicle, 100.0 + 15.0 * level)
    return landings


def hovering(number: int, east_m: float, height_m: float, noise_mps: float) -> Vehicle:
    """Return a multirotor that took off, and hovers over its home."""
    vehicle = Vehicle(VehicleId(1, number), number - 1, ArduCopter(number, ORIGIN, 0.25), CONNECTION, 10.0)
    for armed, up_m in ((False, 0.0), (True, 20.0), (True, height_m)):
        tell(vehicle, 0.5, east_m, up_m, armed=armed, course_rad=2.0 * number, flies_mps=noise_mps)
    vehicle.commands.send((), NOW)
    return vehicle


@pytest.mark.parametrize(("noise_mps", "mode"), [(0.7, m.COPTER_MODE_LAND), (2.0, None)])
def test_multirotors_that_hover_land_though_the_speeds_that_they_report_are_noisy(
    noise_mps: float, mode: int | None
) -> None:
    """Four simulated PX4 hovered over their homes for 5 minutes, and none was commanded to land."""
    each = [hovering(number, 12.0 * number, 85.0 + 15.0 * number, noise_mps) for number in range(1, 5)]
    landings = waiting(*each)
    landings.advance(NOW)
    assert [commanded(one) for one in each] == [mode, None, None, None]


def commanded(vehicle: Vehicle) -> int | None:
    """Return the mode that a vehicle is commanded."""
    command = vehicle.commands.due(NOW)
    return int(command.param2) if command is not None else None


def test_the_lowest_lands_when_all_are_at_their_heights_and_the_next_when_it_is_disarmed() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0)
    landings = waiting(low, high)
    landings.advance(NOW)
    assert (commanded(low), commanded(high)) == (None, None)
    tell(high, 0.0, 50.0, 113.0)
    landings.advance(NOW)
    assert (commanded(low), commanded(high)) == (m.PLANE_MODE_AUTOLAND, None)
    tell(low, 0.0, 0.0, 0.0)
    landings.advance(NOW)
    assert commanded(high) is None, "the first one stands there, armed"
    tell(low, 0.0, 0.0, 0.0, armed=False, rolls_mps=5.0)
    landings.advance(NOW)
    landings.advance(NOW)
    assert commanded(high) is None, "it still rolls"
    tell(low, 0.0, 0.0, 0.0, armed=False)
    landings.advance(NOW)
    landings.advance(NOW)
    assert commanded(high) == m.PLANE_MODE_AUTOLAND


def test_none_lands_where_the_one_before_has_rolled_to() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = waiting(low, high)
    landings.advance(NOW)
    tell(low, 10.0, 30.0, 0.0, armed=False)
    landings.advance(NOW)
    landings.advance(NOW)
    assert commanded(high) is None
    assert landings.failure == "vehicle 2 would come in over the place of vehicle 1"


def test_when_one_refuses_to_land_the_others_circle_on() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = waiting(low, high)
    landings.advance(NOW)
    assert commanded(low) == m.PLANE_MODE_AUTOLAND
    low.commands.acknowledge(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_FAILED), NOW)
    landings.advance(after(NOW, 6.0))
    assert landings.failure == "vehicle 1 refused to land (FAILED)"
    landings.advance(after(NOW, 7.0))
    assert (commanded(low), commanded(high), landings.under_way) == (None, None, False)


def test_landings_that_are_called_off_end_with_the_one_under_way() -> None:
    low, high = plane(1, 0.0, 0.0), plane(2, 0.0, 50.0, 115.0)
    landings = waiting(low, high)
    landings.advance(NOW)
    landings.call_off()
    assert landings.under_way
    tell(low, 0.0, 0.0, 0.0, armed=False)
    landings.advance(NOW)
    landings.advance(NOW)
    assert (commanded(high), landings.under_way) == (None, False)
