"""What happens to vehicles that don't get ready: decisions; start-ups are mere steps here."""

from __future__ import annotations

import math
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId, parse_endpoint
from airlink.messages.command import CommandAck, CommandLong
from airlink.messages.system import Heartbeat, Statustext
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.link.link_health import Connection
from gcs_formation.mission.beginning import Beginning
from gcs_formation.mission.starting import CONNECT_LIMIT_S, Starting
from gcs_formation.phases import Flight, Phase
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog, GivenUp

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
PLANE = Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA)
MODE = ArduPlane(1, ORIGIN, 0.25).set_mode(m.PLANE_MODE_GUIDED)


def told(_: Telemetry) -> tuple[Command, ...]:
    return (MODE,)


class Ground:
    """A leader and a follower that take one step of 20 s: a command, until they report GUIDED."""

    def __init__(self, phase: Phase = Phase.CONNECTING, *, takes_off: bool = False, together: bool = False) -> None:
        self.step = StartUpStep("set mode GUIDED", lambda seen: seen.custom_mode == m.PLANE_MODE_GUIDED, told, 20.0)
        if takes_off:
            self.step = StartUpStep("armed", lambda seen: seen.armed, told, 20.0, takes_off=True)
        self.vehicles = {VehicleId(1, number): self._vehicle(number) for number in (1, 2)}
        self.logged, self.given_up, self.preflight = EventLog(), GivenUp(), Preflight()
        self.flight = Flight(phase)
        endpoints = (parse_endpoint("udpin:127.0.0.1:14550"), parse_endpoint("udpin:127.0.0.1:14560"))
        preflight: Any = self.preflight
        beginning = Beginning(load_scenario(scenario(vehicles={"count": 2})), self.vehicles)
        self.starting = Starting(
            self.vehicles,
            endpoints,
            self.flight,
            preflight,
            beginning,
            self.logged,
            self.given_up,
            together=together,
        )

    def _vehicle(self, number: int) -> Vehicle:
        plane = ArduPlane(number, ORIGIN, 0.25)
        made = Vehicle(VehicleId(1, number), number - 1, plane, Connection(number - 1), 10.0)
        made.start_up = StartUp((self.step,))
        return made

    def receive(self, *numbers: int, mode: int = m.PLANE_MODE_MANUAL, kind: Heartbeat = PLANE) -> None:
        for number in numbers:
            self.at(number).connection.record_frame(Instant(0), heartbeat=True)
            self.at(number).telemetry.store(kind.but(custom_mode=mode))

    def advance(self, at_s: float) -> None:
        self.starting.advance(after(Instant(0), at_s))

    def at(self, number: int) -> Vehicle:
        return self.vehicles[VehicleId(1, number)]

    def sent(self, number: int, at_s: float, result: int | None = None) -> bool:
        """Return whether a vehicle is sent a command at a time; let it answer."""
        command = self.at(number).commands.due(after(Instant(0), at_s))
        if command is not None and result is not None:
            self.at(number).commands.acknowledge(CommandAck(command.command, result), after(Instant(0), at_s))
        return command is not None


class Preflight:
    """Lets all vehicles begin, or none."""

    passed = True
    boot_timeout_s = 600.0


def test_none_is_commanded_before_all_have_answered() -> None:
    ground = Ground()
    ground.receive(1)
    ground.advance(1.0)
    assert not ground.sent(1, 1.0)
    ground.receive(2)
    ground.advance(2.0)
    assert [ground.sent(number, 2.0) for number in (1, 2)] == [True, True]


def test_none_is_commanded_before_it_is_allowed_and_waiting_for_that_costs_no_time() -> None:
    ground = Ground()
    ground.preflight.passed = False
    ground.receive(1, 2)
    for at_s in (1.0, 100.0):
        ground.advance(at_s)
        assert not ground.sent(1, at_s)
        assert ground.at(1).start_up.held
    ground.preflight.passed = True
    ground.advance(101.0)
    assert ground.sent(1, 101.0)
    assert ground.given_up == []


@pytest.mark.parametrize("together", [True, False])
def test_who_can_stand_begins_when_all_are_ready(together: bool) -> None:
    """With a quarter of frames lost, one of four vehicles was led past another that still climbed, 5 m away."""
    ground = Ground(together=together)
    ground.receive(1, 2)
    ground.advance(1.0)
    ground.receive(2, mode=m.PLANE_MODE_GUIDED)
    ground.advance(2.0)
    assert ground.at(2).start_up.finished == (not together)
    ground.receive(1, mode=m.PLANE_MODE_GUIDED)
    for at_s in (2.1, 2.2):
        ground.advance(at_s)
    assert [ground.at(number).start_up.finished for number in (1, 2)] == [True, True]
    assert ground.given_up == []


def test_who_restarts_meanwhile_waits_for_the_others_too() -> None:
    ground = Ground(together=True)
    waits = ground.at(2).start_up.steps[-1]
    ground.at(1).restart(Instant(0))
    assert ground.at(1).start_up.steps[-1] is waits
    ground.receive(1, 2)
    ground.receive(2, mode=m.PLANE_MODE_GUIDED)
    ground.at(1).start_up.index = len(ground.at(1).start_up.steps) - 2
    ground.advance(1.0)
    assert not ground.at(2).start_up.finished


def test_who_never_answers_is_named_with_where_it_should_be_heard_after_30_s() -> None:
    ground = Ground()
    ground.receive(1)
    ground.advance(CONNECT_LIMIT_S - 0.1)
    assert ground.given_up == []
    ground.advance(CONNECT_LIMIT_S + 0.1)
    assert ground.given_up == ["no vehicle 2 answered at udpin:127.0.0.1:14560 in 30 s"]


def test_the_wait_begins_when_vehicles_may_be_up() -> None:
    ground = Ground()
    ground.flight.since = after(Instant(0), 200.0)
    ground.advance(200.0 + CONNECT_LIMIT_S - 0.1)
    assert ground.given_up == []
    ground.advance(200.0 + CONNECT_LIMIT_S + 0.1)
    assert ground.given_up == ["no vehicle 1, 2 answered at udpin:127.0.0.1:14550, udpin:127.0.0.1:14560 in 30 s"]


def test_one_that_falls_silent_again_in_flight_is_waited_for_without_an_end() -> None:
    ground = Ground(Phase.FLYING)
    ground.receive(1)
    ground.advance(CONNECT_LIMIT_S + 100.0)
    assert ground.given_up == []


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (PLANE.but(type=m.MAV_TYPE_QUADROTOR), "ARDUPILOTMEGA QUADROTOR"),
        (PLANE.but(autopilot=m.MAV_AUTOPILOT_PX4), "PX4 FIXED_WING"),
    ],
)
def test_another_family_is_refused_before_any_takes_off_and_not_in_flight(kind: Heartbeat, words: str) -> None:
    for phase, expected in (
        (Phase.CONNECTING, [f"vehicle 2 says that it is a {words}; allowed: ArduPlane"]),
        (Phase.FLYING, []),
    ):
        ground = Ground(phase)
        ground.receive(1)
        ground.receive(2, kind=kind)
        ground.advance(1.0)
        assert ground.given_up == expected


def test_a_vehicle_is_ready_once_its_last_step_is_done_and_this_is_said_once() -> None:
    ground = Ground()
    ground.receive(1, 2)
    ground.advance(1.0)
    ground.sent(1, 1.0, m.MAV_RESULT_ACCEPTED)
    ground.receive(1, mode=m.PLANE_MODE_GUIDED)
    for at_s in (2.0, 3.0):
        ground.advance(at_s)
    assert ground.logged.of("ready") == ground.logged.of("ready", 1) == ["in the air and following setpoints"]


@pytest.mark.parametrize(("phase", "ends"), [(Phase.CONNECTING, True), (Phase.ASSEMBLING, True), (Phase.FLYING, False)])
def test_a_step_that_takes_too_long_ends_the_run_but_once_the_path_has_begun_only_that_vehicle_s_part(
    phase: Phase, ends: bool
) -> None:
    ground = Ground(phase)
    ground.receive(1, 2)
    ground.advance(1.0)
    ground.advance(20.9)
    assert ground.given_up == ground.logged == []
    ground.receive(1, mode=m.PLANE_MODE_GUIDED)
    for at_s in (21.1, 30.0):
        ground.advance(at_s)
    said = "vehicle 2: not done within 20 s after we set mode GUIDED"
    assert ground.given_up[:1] == ([said] if ends else [])
    assert ground.logged.of("abandoned") == ([] if ends else [said])


def test_a_refusal_is_passed_on_with_its_result_and_the_vehicle_s_own_words() -> None:
    ground = Ground()
    ground.receive(1, 2)
    ground.advance(1.0)
    ground.sent(2, 1.0, m.MAV_RESULT_DENIED)
    ground.at(2).telemetry.store(Statustext(m.MAV_SEVERITY_CRITICAL, "PreArm: Compass not calibrated"))
    ground.advance(1.1)
    assert ground.given_up == [
        "vehicle 2: refused when we set mode GUIDED (DO_SET_MODE: DENIED); it said: 'PreArm: Compass not calibrated'"
    ]


def test_of_a_refused_message_interval_it_is_said_which_message() -> None:
    ground = Ground()
    ask = CommandLong(2, 1, m.MAV_CMD_SET_MESSAGE_INTERVAL, 0, float(m.MAVLINK_MSG_ID_VFR_HUD), 1e5)
    for number in (1, 2):
        step = StartUpStep("asked for telemetry", lambda seen: False, lambda seen: (ask,), 20.0)
        ground.at(number).start_up = StartUp((step,))
    ground.receive(1, 2)
    ground.advance(1.0)
    ground.sent(2, 1.0, m.MAV_RESULT_DENIED)
    ground.advance(1.1)
    said = "vehicle 2: refused when we asked for telemetry (SET_MESSAGE_INTERVAL of message 74: DENIED)"
    assert ground.given_up == [said]


@pytest.mark.parametrize(("phase", "left"), [(Phase.FLYING, True), (Phase.ASSEMBLING, False)])
def test_who_is_on_the_ground_once_the_path_has_begun_is_left_to_its_pilot_for_good(phase: Phase, left: bool) -> None:
    ground = Ground(phase, takes_off=True)
    ground.receive(1, 2)
    ground.advance(1.0)
    assert ground.sent(2, 1.0) is not left
    assert bool(ground.logged.of("abandoned", 2)) is left
    if left:
        for at_s in (2.0, 1000.0):
            ground.advance(at_s)
            assert not ground.sent(2, at_s)
        assert len(ground.logged.of("abandoned", 2)) == 1
        assert ground.given_up == []


@pytest.mark.parametrize("phase", [Phase.ENDING, Phase.LOITERING])
def test_at_the_end_of_a_flight_none_is_started_any_more(phase: Phase) -> None:
    ground = Ground(phase)
    ground.receive(1, 2)
    ground.advance(1.0)
    assert not ground.sent(1, 1.0)


def test_the_leader_is_ready_when_it_flies_in_the_formation_a_virtual_one_when_all_do() -> None:
    ground = Ground()
    led = Beginning(load_scenario(scenario(vehicles={"count": 2})), ground.vehicles)
    followers = [{"id": number, "role": "follower"} for number in (1, 2)]
    alone = Beginning(load_scenario(scenario(vehicles=followers)), ground.vehicles)
    ground.at(1).member, ground.at(2).member = Member.FLYING, Member.STARTING
    assert led.may_begin(Instant(0))
    assert not alone.may_begin(Instant(0))
    ground.at(2).member = Member.FLYING
    assert alone.may_begin(Instant(0))
    ground.at(1).member = Member.PARTED
    assert not led.may_begin(Instant(0))
