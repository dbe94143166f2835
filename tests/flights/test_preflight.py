"""Before the first command: parameters are read, confirmation is awaited, or a dry run ends."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from airlink.engine import Datagram
from airlink.frame import HEADER_V2, FrameWriter
from airlink.messages.command import CommandInt, CommandLong, ParamSet
from airlink.messages.system import Timesync
from airlink.stream_parser import StreamParser
from flight_model.earth import GeodeticOrigin
from formation_scenario.surroundings import Fault
from gcs_formation.app.dry_run import rehearsal_text, rehearsed
from gcs_formation.app.operator_at_terminal import question
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from sim_vehicles.autopilot.modes_and_failsafe import Condition, Mode
from sim_vehicles.fleet import Fleet
from tests.flights.in_memory import Between, World

GROUND: dict[str, Any] = {"start": {"in_air": False}, "vehicles": {"count": 2}, "formation": {"shape": "follower"}}
READ = PreFlightOptions(parameters=True)
TIMES = [each.to_bytes(3, "little") for each in (m.MAVLINK_MSG_ID_TIMESYNC, m.MAVLINK_MSG_ID_HOME_POSITION)]
UTC_S = 1_800_000_000


class Listening(Between):
    """Records the commands that arrive."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.commands = set[int]()

    def take(self, datagram: Datagram, now: Instant) -> None:
        messages = (frame.message for frame in StreamParser().feed(datagram.data))
        self.commands |= {each.command for each in messages if isinstance(each, CommandInt | CommandLong)}
        super().take(datagram, now)


class WithoutPosition(Listening):
    """The last vehicle sends no position."""

    def datagrams_to_send(self) -> list[Datagram]:
        position = m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT.to_bytes(3, "little")
        sent = super().datagrams_to_send()
        return [each for each in sent if each.socket != 1 or each.data[HEADER_V2 - 3 : HEADER_V2] != position]


class WithoutTime(Listening):
    """The last vehicle doesn't answer TIMESYNC, and tells no HOME_POSITION, which has its time too."""

    def datagrams_to_send(self) -> list[Datagram]:
        sent = super().datagrams_to_send()
        return [each for each in sent if each.socket != 1 or each.data[HEADER_V2 - 3 : HEADER_V2] not in TIMES]


class OfAnotherEpoch(Listening):
    """The last vehicle answers TIMESYNC by UTC, but stamps its messages with its time since boot."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.writer = FrameWriter(2, m.MAV_COMP_ID_AUTOPILOT1)

    def datagrams_to_send(self) -> list[Datagram]:
        return [self.reported(each) if each.socket == 1 else each for each in super().datagrams_to_send()]

    def reported(self, datagram: Datagram) -> Datagram:
        for frame in StreamParser().feed(datagram.data):
            answer = frame.message
            if isinstance(answer, Timesync) and answer.tc1_ns:
                later = self.writer.encode(Timesync(answer.tc1_ns + UTC_S * NANOSECONDS, answer.ts1_ns))
                return Datagram(datagram.socket, datagram.peer, later)
        return datagram


def commands_to(world: World) -> set[int]:
    assert isinstance(world.between, Listening)
    return world.between.commands


def put(world: World, number: int, name: str, value: float) -> None:
    asked = ParamSet(number, m.MAV_COMP_ID_AUTOPILOT1, name, value, m.MAV_PARAM_TYPE_REAL32)
    assert world.vehicle(number).parameters.set(asked)


def test_parameters_that_are_not_as_they_should_be_are_reported_before_any_vehicle_is_armed() -> None:
    world = World(caution=READ, **GROUND)
    for name in ("FS_GCS_ENABL", "FS_LONG_ACTN"):
        put(world, 2, name, 1)
    world.run(8.0)
    assert world.words("parameters")[0].startswith("FS_GCS_ENABL: found 0; allowed: 1 or 2")
    assert world.words("parameters")[1] == "in order"
    assert max(world.times_s("parameters")) < min(world.times_s("mode", text="TAKEOFF"))
    assert all(vehicle.pilot.condition.armed for vehicle in world.fleet.vehicles)


def test_a_parameter_with_which_none_can_fly_keeps_all_as_they_are() -> None:
    world = World(Listening, READ, **GROUND)
    put(world, 2, "AIRSPEED_MAX", 20)
    world.run(30.0)
    assert world.station.flight.phase is Phase.FAILED
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure.startswith("vehicle 2: AIRSPEED_MAX: found 20; allowed: 28 m/s or more")
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


def test_all_vehicles_that_cannot_be_flown_are_named_at_once() -> None:
    world = World(Listening, READ, **GROUND)
    put(world, 1, "TKOFF_ALT", 20)
    put(world, 2, "AIRSPEED_MAX", 20)
    world.run(30.0)
    failure = world.station.phase_machine.failure or ""
    assert [reported.split(" ")[1] for reported in failure.split("vehicle ")[1:]] == ["TKOFF_ALT:", "AIRSPEED_MAX:"]
    assert sum("AIRSPEED_MAX: found 20" in reported for reported in world.words("parameters")) == 1
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


def test_of_a_vehicle_that_flies_already_the_same_is_reported_and_it_is_taken_over() -> None:
    world = World(caution=READ, vehicles={"count": 2})
    put(world, 2, "AIRSPEED_MAX", 20)
    world.run(3.0)
    assert any("AIRSPEED_MAX: found 20" in reported for reported in world.words("parameters"))
    assert world.station.phase_machine.failure is None
    assert len(world.times_s("ready")) == 2


class Speeds(Listening):
    """Records the airspeeds that the second vehicle is commanded."""

    def __init__(self, fleet: Fleet) -> None:
        super().__init__(fleet)
        self.speeds_mps: list[float] = []

    def take(self, datagram: Datagram, now: Instant) -> None:
        messages = (frame.message for frame in StreamParser().feed(datagram.data) if datagram.socket == 1)
        commands = (each for each in messages if isinstance(each, CommandInt))
        speed = m.MAV_CMD_GUIDED_CHANGE_SPEED
        self.speeds_mps += [each.param2 for each in commands if each.command == speed]
        super().take(datagram, now)


def test_airspeeds_that_a_vehicle_tells_bound_what_it_is_commanded() -> None:
    """Its model flies 28 m/s; it was commanded 27 m/s for 527 s, all of them FAILED."""
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2, "autopilot_parameters": {"AIRSPEED_MAX": 24}}]
    world = World(Speeds, READ, vehicles=vehicles)
    world.fly_to(1.0)
    answer = world.station.orders.execute("speed 27", world.clock.now())
    assert not answer.accepted
    assert "24 m/s" in answer.text
    assert world.station.orders.execute("speed 23.9", world.clock.now()).accepted
    world.run(15.0)
    assert isinstance(world.between, Speeds)
    assert 23.0 < max(world.between.speeds_mps) <= 24.0
    assert world.times_s("disobeys") == []


def test_a_bend_that_needs_more_than_a_vehicle_tells_is_refused_before_the_take_off_with_the_key_to_change() -> None:
    bend = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [2500, 800, 100], [2500, 2500, 100]]}
    to_side = {"shape": "custom", "slots_m": {2: [0, -60, 0]}, "frame": "leader_heading"}
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2, "autopilot_parameters": {"AIRSPEED_MAX": 23}}]
    world = World(Listening, READ, vehicles=vehicles, start={"in_air": False}, path=bend, formation=to_side)
    world.run(30.0)
    failure = world.station.phase_machine.failure or ""
    assert failure.startswith("what vehicles tell (vehicle 2: AIRSPEED_MAX 23) isn't enough for path.waypoints_m.2")
    assert "23 m/s" in failure.partition("allowed: ")[2]
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


def already_flown(caution: PreFlightOptions) -> World:
    """Return two vehicles on the ground by their scenario, of which a pilot flies the second in LOITER."""
    world = World(Listening, caution, **GROUND)
    flown = world.vehicle(2)
    flown.pilot.condition = Condition.FLYING
    flown.body.state.height_m, flown.body.state.airspeed_mps = 80.0, 22.0
    flown.pilot.enter(Mode.LOITER, flown.body.motion)
    return world


def test_who_flies_already_under_somebodys_command_is_named_and_not_taken_unasked() -> None:
    world = already_flown(READ)
    world.run(30.0)
    assert world.station.flight.phase is Phase.FAILED
    said = "vehicle 2 flies already, in LOITER: under somebody's command; --take takes it over, --confirm asks"
    assert world.station.phase_machine.failure == said
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert world.vehicle(2).pilot.mode is Mode.LOITER


def test_with_take_who_flies_already_is_named_and_taken_over() -> None:
    world = already_flown(PreFlightOptions(parameters=True, take=True))
    world.run(12.0)
    assert world.station.phase_machine.failure is None
    assert world.vehicle(2).pilot.mode is Mode.GUIDED
    assert world.times_s("parameters", 2, "flies already, in LOITER: under somebody's command")


def test_with_confirm_the_question_names_who_flies_already() -> None:
    world = already_flown(PreFlightOptions(parameters=True, confirm=True))
    world.run(12.0)
    assert world.vehicle(2).pilot.mode is Mode.LOITER
    assert "take over 1 (vehicle 2 from LOITER, under somebody's command)" in question(world.station.gate)
    world.station.gate.confirm()
    world.run(3.0)
    assert world.vehicle(2).pilot.mode is Mode.GUIDED


def test_a_dry_run_names_who_flies_already_and_goes_on() -> None:
    world = already_flown(PreFlightOptions(parameters=True, rehearse=True))
    world.run(30.0)
    assert world.station.gate.rehearsed
    assert any("flies already, in LOITER" in text for text in world.station.gate.warnings.popitem()[1])


def test_one_that_takes_off_by_its_pilot_while_the_others_are_waited_for_is_not_taken_either() -> None:
    world = World(Listening, READ, **GROUND)
    pilots, waits = world.vehicle(2), world.vehicle(1)
    waits.inject(Fault(at_s=0.0, kind="freeze"), world.clock.now(), ends=False)
    world.run(5.0)
    pilots.enter(Mode.TAKEOFF)
    pilots.arm(force=True)
    world.network.run(lambda: pilots.pilot.airborne)
    waits.inject(Fault(at_s=0.0, kind="freeze"), world.clock.now(), ends=True)
    world.run(25.0)
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure.startswith("vehicle 2 flies already, in TAKEOFF")
    assert not waits.pilot.condition.armed


@pytest.mark.parametrize("in_air", [False, True])
def test_with_confirm_no_vehicle_is_commanded_before_the_word(in_air: bool) -> None:
    keys: Any = GROUND | {"start": {"in_air": in_air}}
    world = World(Listening, PreFlightOptions(parameters=True, confirm=True), **keys)
    world.run(20.0 if in_air else 95.0)  # longer than the timeout of the step
    assert world.station.gate.awaits_word
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}
    asked = question(world.station.gate)
    assert asked.startswith("2 vehicles are connected, ready and checked (2 with warnings). Type yes to")
    assert ("take over 2" in asked) == in_air
    world.station.gate.confirm()
    world.run(2.0)
    assert (m.MAV_CMD_GUIDED_CHANGE_SPEED if in_air else m.MAV_CMD_COMPONENT_ARM_DISARM) in commands_to(world)


def test_stopped_while_the_word_is_awaited_everybody_is_left_as_found() -> None:
    world = World(Listening, PreFlightOptions(confirm=True), vehicles={"count": 2})
    world.vehicle(1).enter(Mode.MANUAL)
    world.run(3.0)
    world.station.phase_machine.stop(world.clock.now())
    world.run(1.0)
    assert world.station.flight.phase is Phase.DONE
    assert world.vehicle(1).pilot.mode is Mode.MANUAL
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


def test_a_rehearsal_ends_when_everybody_is_ready_and_says_what_would_be_sent() -> None:
    world = World(Listening, PreFlightOptions(parameters=True, rehearse=True), **GROUND)
    world.run(60.0)
    assert world.station.flight.phase is Phase.DONE
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}
    assert all(vehicle.pilot.condition is Condition.DISARMED for vehicle in world.fleet.vehicles)
    report = rehearsed(world.station)
    text = rehearsal_text(report).splitlines()
    assert text[0] == "vehicle 1 (ArduPlane): MANUAL, disarmed, on the ground"
    assert [line for line in text if line.startswith("  start: ")][:3] == [
        "  start: COMMAND_LONG DO_SET_MODE (TAKEOFF): param1 1, param2 13",
        "  start: COMMAND_LONG COMPONENT_ARM_DISARM: param1 1",
        "  start: COMMAND_LONG DO_SET_MODE (GUIDED): param1 1, param2 15",
    ]
    assert [line for line in text if line.startswith("  setpoints")][:3] == [
        "  setpoints, 10 a second: COMMAND_INT GUIDED_CHANGE_SPEED: param1 0, param2 22",
        "  setpoints, 10 a second: COMMAND_INT GUIDED_CHANGE_ALTITUDE: z 100",
        "  setpoints, 10 a second: COMMAND_INT GUIDED_CHANGE_HEADING: param1 1, param2 0, param3 5.5",
    ]


@pytest.mark.parametrize("confirm", [False, True])
def test_while_one_is_not_ready_no_vehicle_is_commanded(confirm: bool) -> None:
    """The last one has no position: the station waits for it, then the run ends with all on the ground."""
    world = World(WithoutPosition, PreFlightOptions(parameters=True, confirm=confirm), **GROUND)
    world.run(60.0)
    assert world.station.flight.phase is Phase.FAILED
    assert world.station.phase_machine.failure
    assert world.station.phase_machine.failure == (
        "vehicle 2: not done within 30 s after we asked for telemetry (it has reported no position)"
    )
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


@pytest.mark.parametrize("in_air", [False, True])
@pytest.mark.parametrize("caution", [READ, PreFlightOptions(parameters=True, rehearse=True)])
@pytest.mark.parametrize(
    ("between", "why"),
    [
        (WithoutTime, r"it answers no TIMESYNC: its delay and clock aren't known"),
        (
            OfAnotherEpoch,
            r"its TIMESYNC tells another time than the stamps of its positions: "
            r"18000000\d\d s, where the newest is of \d+ s",
        ),
    ],
    ids=["none", "of another epoch"],
)
def test_one_whose_clock_is_not_known_is_not_ready_and_no_vehicle_is_commanded(
    between: type[Listening], why: str, caution: PreFlightOptions, in_air: bool
) -> None:
    """It would be armed and take off, and never get a setpoint, because no state of it can be dated."""
    keys: Any = GROUND | {"start": {"in_air": in_air}}
    world = World(between, caution, **keys)
    for vehicle in world.fleet.vehicles:
        vehicle.enter(Mode.GUIDED if in_air else Mode.MANUAL)
    world.run(60.0)
    assert world.station.flight.phase is Phase.FAILED
    assert re.fullmatch(
        rf"vehicle 2: not done within 30 s after we asked for telemetry \({why}\)",
        world.station.phase_machine.failure or "",
    )
    assert commands_to(world) <= {m.MAV_CMD_SET_MESSAGE_INTERVAL, m.MAV_CMD_REQUEST_MESSAGE}
    assert world.times_s("member", 2) == world.times_s("duplicate") == []


@pytest.mark.parametrize(
    "caution", [PreFlightOptions(parameters=True, rehearse=True), PreFlightOptions(parameters=True, confirm=True)]
)
def test_vehicles_that_fly_in_guided_already_are_not_commanded_in_a_rehearsal_nor_before_the_word(
    caution: PreFlightOptions,
) -> None:
    world = World(Listening, caution, vehicles={"count": 2})
    for vehicle in world.fleet.vehicles:
        vehicle.enter(Mode.GUIDED)
    world.run(5.0)
    assert world.station.flight.phase is (Phase.DONE if caution.rehearse else Phase.CONNECTING)
    assert world.station.gate.awaits_word
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}
    world.station.gate.confirm()
    world.run(2.0)
    assert (m.MAV_CMD_GUIDED_CHANGE_SPEED in commands_to(world)) is caution.confirm


def test_a_run_that_ends_before_any_is_commanded_records_nothing_more_of_those_in_the_air() -> None:
    """Its phase is over by then, and no time series has such a phase."""
    world = World(Listening, PreFlightOptions(parameters=True, rehearse=True), vehicles={"count": 2})
    world.run(20.0)
    assert world.station.flight.phase is Phase.DONE
    assert {tick.phase for tick in world.recorder.ticks} == {"connecting"}


def elsewhere(*, in_air: bool, north_rad: float = 0.0, up_m: float = 0.0) -> World:
    """Return a world whose station assumes the vehicles to be farther north and higher than the scenario does."""
    keys: Any = GROUND | {"start": {"in_air": in_air}}
    world = World(Listening, READ, **keys)
    for vehicle in world.station.vehicles.values():
        seen = vehicle.telemetry
        seen.origin = GeodeticOrigin(seen.origin.lat_rad - north_rad, seen.origin.lon_rad, seen.origin.alt_m - up_m)
    world.run(10.0 if in_air else 40.0)
    return world


@pytest.mark.parametrize("in_air", [False, True])
def test_vehicles_at_a_field_of_another_height_are_not_armed_and_in_the_air_it_is_said(in_air: bool) -> None:
    """The origin of the station's scenario is at sea level, but the vehicles' field is at 500 m."""
    world = elsewhere(in_air=in_air, up_m=500.0)
    found = "home: found 500 m above sea level, where the scenario's ground is at 0 m; allowed: 30 m off"
    if in_air:
        assert len([each for each in world.words("parameters") if found in each]) == 2
        assert world.station.phase_machine.failure is None
    else:
        assert (world.station.phase_machine.failure or "").startswith(f"vehicle 1: {found}. Set origin.alt_m, now 0")
        assert world.station.flight.phase is Phase.FAILED
        assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}


@pytest.mark.parametrize("in_air", [False, True])
def test_vehicles_far_from_the_path_are_left_as_they_are(in_air: bool) -> None:
    """They are a degree of latitude south of the origin in the station's scenario."""
    world = elsewhere(in_air=in_air, north_rad=-math.radians(1.0))
    assert re.match(
        r"vehicle 1: place: found 11\d\.\d km from the path's start; allowed: up to 14.0 km",
        world.station.phase_machine.failure or "",
    )
    assert commands_to(world) == {m.MAV_CMD_SET_MESSAGE_INTERVAL}
