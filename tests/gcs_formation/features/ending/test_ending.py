"""How a run leaves its vehicles, in whatever phase of flight each of them is."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import Address, VehicleId
from airlink.messages.command import CommandAck
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import GlobalPositionInt, HomePosition
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from formation_scenario.orders import End
from gcs_formation.features.ending.ending import UNANSWERED_FOR_S, SeparatedEnding
from gcs_formation.features.ending.holding_stack import motion_of
from gcs_formation.fleet.circle_heights import GroundFloor
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.vehicle.command_delivery import REFUSES_S, Outcome
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
NOW, LATER = Instant(0), Instant(1_000_000_000)
CIRCLES = m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_LOITER
DISARMED = m.MAV_CMD_COMPONENT_ARM_DISARM, 0.0
FLYING, WAITING = m.MAV_STATE_ACTIVE, m.MAV_STATE_STANDBY
Place = Callable[..., Vehicle]


@pytest.fixture
def place() -> Place:
    """Return a factory of vehicles in a mode, armed or not, at a height above home, this far north."""

    def placed(number: int, mode: int, height_m: float, *, armed: bool = True, status: int = FLYING) -> Vehicle:
        connection = Connection(0, Address("127.0.0.1", 1), LinkState.CONNECTED)
        vehicle = Vehicle(VehicleId(1, number), number - 1, ArduPlane(number, ORIGIN, 0.25), connection, 10.0)
        tell(vehicle, mode, height_m, armed=armed, status=status)
        return vehicle

    return placed


def tell(vehicle: Vehicle, mode: int, height_m: float, *, armed: bool = True, status: int = FLYING) -> None:
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(50.0 * vehicle.identity.system, 0.0, -height_m)
    vehicle.telemetry.store(GlobalPositionInt(1.0, lat_rad, lon_rad, alt_m, height_m, 0.0, 0.0, 0.0, 0.0))
    base = m.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    vehicle.telemetry.store(Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, base, mode, status))


def beat(mode: int, status: int) -> Heartbeat:
    return Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, m.MAV_MODE_FLAG_SAFETY_ARMED, mode, status)


def beats(vehicle: Vehicle, mode: int, status: int) -> None:
    """Let an armed vehicle send its mode and status, but no position."""
    vehicle.telemetry.store(beat(mode, status))


def sent_to(vehicle: Vehicle, now: Instant = NOW, until: int | None = None) -> list[tuple[int, float]]:
    """Return the commands in progress, each acknowledged as it comes, with mode or first parameter."""
    sent: list[tuple[int, float]] = []
    while vehicle.commands.under_way is not None and (until is None or asked(vehicle) != until):
        command = vehicle.commands.due(now)
        if command is None:
            break
        sent.append((command.command, command.param2 if command.command == m.MAV_CMD_DO_SET_MODE else command.param1))
        vehicle.commands.acknowledge(CommandAck(command.command, m.MAV_RESULT_ACCEPTED), now)
    return sent


def asked(vehicle: Vehicle) -> int | None:
    """Return the mode that the command in progress asks for."""
    command = vehicle.commands.under_way
    return None if command is None else vehicle.autopilot.mode_asked(command)


def accept(vehicle: Vehicle) -> int:
    """Accept one command, and return its id."""
    command = vehicle.commands.due(NOW)
    assert command is not None
    vehicle.commands.acknowledge(CommandAck(command.command, m.MAV_RESULT_ACCEPTED), NOW)
    return command.command


def refuse(vehicle: Vehicle, result: int, now: Instant = NOW) -> None:
    """Answer the command in progress."""
    vehicle.commands.due(now)
    command = vehicle.commands.under_way
    assert command is not None
    vehicle.commands.acknowledge(CommandAck(command.command, result), now)


def goes_home_at(height_m: float) -> list[tuple[int, Any]]:
    """Return commands for the height, RTL, and the height again, which the change of mode has reset."""
    height = loiters_at(height_m)[1]
    return [height, (m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_RTL), height]


def loiters_at(height_m: float) -> list[tuple[int, Any]]:
    return [
        (m.MAV_CMD_DO_SET_MODE, m.PLANE_MODE_LOITER),
        (m.MAV_CMD_DO_CHANGE_ALTITUDE, pytest.approx(height_m, abs=1e-3)),
    ]


def ending(*vehicles: Vehicle, manner: End = "loiter", ground: GroundFloor | None = None) -> SeparatedEnding:
    ground = ground or GroundFloor(load_scenario(scenario()))
    end = SeparatedEnding({vehicle.identity: vehicle for vehicle in vehicles}, ground, manner)
    end.start(NOW)
    end.leave(NOW)
    return end


def test_vehicles_that_fly_close_together_loiter_15_m_apart(place: Place):
    vehicles = [place(i, m.PLANE_MODE_GUIDED, 100.0) for i in (1, 2, 3)]
    end = ending(*vehicles)
    assert [sent_to(vehicle) for vehicle in vehicles] == [loiters_at(height_m) for height_m in (100.0, 115.0, 130.0)]
    assert end.pending() == []


@pytest.mark.parametrize("manner", ["loiter", "rtl"])
@pytest.mark.parametrize(("hill_north_m", "base_m"), [(250.0, 150.0), (600.0, 100.0)])
def test_circles_are_clear_of_the_ground_around_them(place: Place, manner: End, hill_north_m: float, base_m: float):
    """Vehicles 50 m and 100 m north of home, and at home; a hill 90 m high, 60 m of clearance."""
    hill = {"shape": "cosine", "north_m": hill_north_m, "east_m": 0, "height_m": 90, "radius_m": 100}
    away = {"speed_mps": 22, "waypoints_m": [[0, 3000, 100], [2000, 3000, 100]]}
    planned = load_scenario(scenario(terrain={"clearance_m": 60, "hills": [hill]}, path=away))
    vehicles = [place(i, m.PLANE_MODE_GUIDED, 100.0) for i in (1, 2)]
    ending(*vehicles, manner=manner, ground=GroundFloor(planned))
    heights_m = [sent_to(vehicle)[-1][1] for vehicle in vehicles]
    assert heights_m == pytest.approx([base_m, base_m + 15.0], abs=1.5)


def test_the_way_home_is_to_where_the_vehicle_says_that_its_home_is(place: Place):
    """A hill is 2 km east of them; home is 4 km east, the origin 50 m south."""
    hill = {"shape": "cosine", "north_m": 50, "east_m": 2000, "height_m": 90, "radius_m": 100}
    ground = GroundFloor(load_scenario(scenario(terrain={"clearance_m": 60, "hills": [hill]})))
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    ending(vehicle, manner="rtl", ground=ground)
    assert sent_to(vehicle)[-1][1] == pytest.approx(100.0, abs=0.1)
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(50.0, 4000.0, 0.0)
    vehicle.telemetry.store(HomePosition(lat_rad, lon_rad, alt_m, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0)))
    ending(vehicle, manner="rtl", ground=ground)
    assert sent_to(vehicle)[-1][1] == pytest.approx(150.0, abs=1.5)


def test_a_vehicle_that_takes_off_climbs_out_before_it_circles(place: Place):
    low, high = place(1, m.PLANE_MODE_TAKEOFF, 12.0), place(2, m.PLANE_MODE_GUIDED, 50.0)
    end = ending(low, high)
    assert sent_to(low) == []
    assert sent_to(high) == loiters_at(60.0)
    assert end.pending() == [low]
    tell(low, m.PLANE_MODE_TAKEOFF, 46.0)
    end.advance(NOW)
    assert sent_to(low) == loiters_at(45.0)
    assert end.pending() == []


def test_a_vehicle_that_takes_off_counts_as_there_where_it_will_be_done(place: Place):
    climbing, flying = (motion_of(place(1, mode, 12.0)) for mode in (m.PLANE_MODE_TAKEOFF, m.PLANE_MODE_GUIDED))
    assert climbing is not None
    assert flying is not None
    assert flying.height_m == pytest.approx(12.0, abs=0.01)
    assert climbing.height_m == pytest.approx(ArduPlane(1, ORIGIN, 0.25).take_off_m, abs=0.01)
    assert climbing.north_m == flying.north_m == pytest.approx(50.0, abs=0.01)


def test_a_vehicle_armed_on_the_ground_is_disarmed(place: Place):
    vehicle = place(1, m.PLANE_MODE_TAKEOFF, 0.0, status=WAITING)
    ending(vehicle)
    assert sent_to(vehicle) == [(m.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)]


def test_arming_that_is_under_way_is_called_off(place: Place):
    vehicle = place(1, m.PLANE_MODE_TAKEOFF, 0.0, armed=False, status=WAITING)
    vehicle.commands.send(vehicle.autopilot.start_up(vehicle.rates_hz)[4].commands(vehicle.telemetry), NOW)
    ending(vehicle)
    assert sent_to(vehicle) == [(m.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)]


def test_a_vehicle_that_left_the_ground_before_it_could_be_disarmed_loiters(place: Place):
    vehicle = place(1, m.PLANE_MODE_TAKEOFF, 0.0, status=WAITING)
    end = ending(vehicle)
    tell(vehicle, m.PLANE_MODE_TAKEOFF, 47.0)
    end.advance(NOW)
    assert sent_to(vehicle) == loiters_at(45.0)


def test_a_disarmed_vehicle_on_the_ground_is_left_alone(place: Place):
    vehicle = place(1, m.PLANE_MODE_MANUAL, 0.0, armed=False, status=WAITING)
    assert ending(vehicle).pending() == []
    assert sent_to(vehicle) == []


def test_a_vehicle_that_its_pilot_has_taken_stays_the_pilots(place: Place):
    vehicle = place(1, m.PLANE_MODE_RTL, 80.0)
    vehicle.member = Member.PARTED
    end = ending(vehicle)
    assert sent_to(vehicle) == []
    assert end.pending() == []


def test_a_vehicle_that_isnt_heard_is_reported_but_not_waited_for(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    vehicle.connection.state = LinkState.LOST
    end = ending(vehicle)
    assert end.pending() == []
    assert sent_to(vehicle) == loiters_at(100.0)


def test_vehicles_that_go_home_circle_there_at_heights_of_their_own(place: Place):
    vehicles = [place(i, m.PLANE_MODE_GUIDED, 100.0) for i in (1, 2, 20)]  # the last one is 900 m away
    ending(*vehicles, manner="rtl")
    assert [sent_to(vehicle) for vehicle in vehicles] == [goes_home_at(height_m) for height_m in (100.0, 115.0, 130.0)]


ABOARD = pytest.mark.parametrize("status", [FLYING, m.MAV_STATE_CRITICAL, m.MAV_STATE_EMERGENCY, m.MAV_STATE_UNINIT])


@ABOARD
def test_one_that_is_armed_and_has_reported_no_position_circles_and_is_not_disarmed(place: Place, status: int):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    vehicle.telemetry.invalidate()
    beats(vehicle, m.PLANE_MODE_GUIDED, status)
    end = ending(vehicle)
    assert sent_to(vehicle)[0] == CIRCLES
    assert end.pending() == [vehicle], "it has no height of its own"
    assert "where it flies isn't known" in end.lacks(vehicle)
    tell(vehicle, m.PLANE_MODE_LOITER, 100.0)
    end.advance(NOW)
    assert sent_to(vehicle) == loiters_at(100.0)
    assert end.pending() == []


def test_one_that_restarted_in_flight_circles_until_it_is_known_to_stand(place: Place):
    """Right after boot an ArduPilot reports STANDBY, and would obey a command to disarm."""
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    vehicle.restart(Instant(0))
    end = ending(vehicle)
    assert sent_to(vehicle)[0] == CIRCLES
    beats(vehicle, m.PLANE_MODE_MANUAL, WAITING)
    end.advance(NOW)
    assert sent_to(vehicle) == []
    tell(vehicle, m.PLANE_MODE_MANUAL, 0.0, status=WAITING)
    end.advance(NOW)
    assert sent_to(vehicle) == [DISARMED]


def test_one_that_restarted_on_the_ground_is_commanded_nothing(place: Place):
    vehicle = place(1, m.PLANE_MODE_MANUAL, 0.0, armed=False, status=WAITING)
    vehicle.restart(Instant(0))
    end = ending(vehicle)
    beats(vehicle, m.PLANE_MODE_MANUAL, WAITING)
    end.advance(NOW)
    assert sent_to(vehicle) == []


def test_one_in_an_emergency_9_m_above_its_home_circles(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 9.0)
    tell(vehicle, m.PLANE_MODE_GUIDED, 9.0, status=m.MAV_STATE_CRITICAL)
    ending(vehicle)
    assert vehicle.airborne
    assert sent_to(vehicle) == loiters_at(9.0)


def test_disarming_is_withdrawn_as_soon_as_the_vehicle_turns_out_to_fly(place: Place):
    """This happens while the others are still spreading the formation."""
    vehicle = place(1, m.PLANE_MODE_TAKEOFF, 0.0, status=WAITING)
    end = SeparatedEnding({vehicle.identity: vehicle}, GroundFloor(load_scenario(scenario())))
    end.start(NOW)
    assert vehicle.commands.due(NOW) is not None
    end.command_by_state(NOW)
    assert vehicle.commands.outcome is Outcome.WAITING
    tell(vehicle, m.PLANE_MODE_TAKEOFF, 1.0)
    end.command_by_state(NOW)
    assert vehicle.commands.due(LATER) is None
    end.leave(LATER)
    assert vehicle.commands.due(LATER) is None, "it climbs out"


def test_one_that_refuses_to_circle_is_commanded_again_and_is_not_done(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle)
    for _ in range(3):
        refuse(vehicle, m.MAV_RESULT_DENIED)
        assert end.pending() == [vehicle]
        assert end.lacks(vehicle) == ": it refuses mode LOITER (DO_SET_MODE: DENIED)"


def test_one_that_refuses_to_circle_and_is_seen_to_do_so_gets_its_height(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle)
    refuse(vehicle, m.MAV_RESULT_DENIED)
    for _ in range(2):
        vehicle._take_heartbeat(beat(m.PLANE_MODE_LOITER, FLYING), after(NOW, 2.5))
    assert sent_to(vehicle, after(NOW, 2.5)) == loiters_at(100.0)[1:]
    assert end.pending() == []


@pytest.mark.parametrize("result", [m.MAV_RESULT_UNSUPPORTED, m.MAV_RESULT_DENIED, m.MAV_RESULT_FAILED])
def test_one_that_refuses_its_height_circles_where_it_is_instead_of_at_home_and_is_not_done(place: Place, result: int):
    """At home all would be at one height."""
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle, manner="rtl")
    refuse(vehicle, result)
    end.advance(after(NOW, REFUSES_S))
    command = vehicle.commands.due(after(NOW, REFUSES_S))
    assert command is not None
    assert (command.command, command.param2) == CIRCLES
    vehicle.commands.acknowledge(CommandAck(command.command, m.MAV_RESULT_ACCEPTED), after(NOW, REFUSES_S))
    refuse(vehicle, result, after(NOW, REFUSES_S))
    assert end.pending() == [vehicle]
    assert "DO_CHANGE_ALTITUDE" in end.lacks(vehicle)
    end.advance(after(NOW, 60.0))
    again = vehicle.commands.due(after(NOW, 60.0))
    assert again is not None
    assert again.command == m.MAV_CMD_DO_CHANGE_ALTITUDE


def test_one_that_takes_its_height_after_all_goes_home(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle, manner="rtl")
    refuse(vehicle, m.MAV_RESULT_FAILED)
    end.advance(after(NOW, REFUSES_S))
    assert sent_to(vehicle, after(NOW, REFUSES_S)) == [*loiters_at(100.0), *goes_home_at(100.0)]
    assert end.pending() == []


def test_one_that_refuses_to_go_home_circles_where_it_is_and_is_commanded_again(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle, manner="rtl")
    assert accept(vehicle) == m.MAV_CMD_DO_CHANGE_ALTITUDE
    refuse(vehicle, m.MAV_RESULT_DENIED)
    end.advance(after(NOW, REFUSES_S))
    assert sent_to(vehicle, after(NOW, REFUSES_S), until=m.PLANE_MODE_RTL)[:2] == loiters_at(100.0)
    refuse(vehicle, m.MAV_RESULT_DENIED, after(NOW, REFUSES_S))
    assert end.pending() == [vehicle]
    assert end.lacks(vehicle) == ": it refuses mode RTL (DO_SET_MODE: DENIED)"


def test_one_that_refuses_its_height_on_its_way_home_turns_back_to_circle_for_good(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle, manner="rtl")
    accept(vehicle)
    accept(vehicle)
    tell(vehicle, m.PLANE_MODE_RTL, 100.0)
    refuse(vehicle, m.MAV_RESULT_DENIED)
    end.advance(after(NOW, REFUSES_S))
    assert sent_to(vehicle, after(NOW, REFUSES_S)) == loiters_at(100.0)


def test_one_that_never_answers_that_it_is_to_go_home_is_commanded_to_circle_where_it_is(place: Place):
    vehicle = place(1, m.PLANE_MODE_GUIDED, 100.0)
    end = ending(vehicle, manner="rtl")
    late = after(NOW, UNANSWERED_FOR_S + 0.1)
    end.advance(late)
    assert sent_to(vehicle, late)[:2] == loiters_at(100.0)


def test_none_lands_if_one_refuses_its_height(place: Place):
    vehicles = [place(i, m.PLANE_MODE_GUIDED, 100.0) for i in (1, 2)]
    end = ending(*vehicles, manner="land")
    refuse(vehicles[0], m.MAV_RESULT_UNSUPPORTED)
    end.advance(after(NOW, REFUSES_S))
    assert end.landings.failure == "vehicle 1 refuses DO_CHANGE_ALTITUDE: UNSUPPORTED"
    assert not end.landings.under_way
