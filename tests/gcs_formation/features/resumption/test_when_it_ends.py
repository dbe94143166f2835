"""When a resumed flight ends before it begins again, and in which words; and what vehicles are asked until then."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import after
from airlink.endpoint import VehicleId
from airlink.messages.command import ParamRequestRead, ParamValue
from airlink.messages.system import Heartbeat
from formation_scenario import Scenario, load_scenario
from gcs_formation.features.resumption.feature import FEATURE
from gcs_formation.features.resumption.takeover import WAIT_S
from gcs_formation.link.link_health import LinkState
from gcs_formation.mission.past_flight import RecordedVehicle
from gcs_formation.phases import Cause, Phase
from gcs_formation.vehicle.member import Member
from tests.flights.conftest import scenario
from tests.gcs_formation.features.resumption.test_takeover import EACH, FIRST, PARAMETERS, SECOND, THIRD, Resuming

LATE_S = WAIT_S + 0.1
LEFT_IN_GUIDED = "and the flight had left it in GUIDED"


def virtually_led() -> Scenario:
    slots = {1: [-20, -20, 0], 2: [-20, 20, 0], 3: [-50, 0, 0]}
    followers = [{"id": number, "role": "follower"} for number in slots]
    return load_scenario(scenario(vehicles=followers, formation={"shape": "custom", "slots_m": slots}))


def decided(flight: Resuming, identity: VehicleId, mode: int, height_m: float = 100.0) -> Any:
    """Let a vehicle be found in a mode, and its failsafe's parameters be read where they are asked for."""
    vehicle = flight.receive(identity, mode, height_m)
    if not flight.takeover.may_act(vehicle, flight.at(0.1)):
        flight.tell_parameters(vehicle)
        assert flight.takeover.may_act(vehicle, flight.at(0.2))
    return vehicle


def test_if_none_is_received_for_5_s_there_is_nothing_to_take_over() -> None:
    flight = Resuming()
    assert not flight.takeover.settled(flight.at(WAIT_S))
    assert flight.takeover.failure(flight.at(WAIT_S)) is None
    assert flight.takeover.failure(flight.at(LATE_S)) == "no vehicle to take over: none got ready"
    assert not flight.takeover.took_any


def test_where_none_flew_all_are_waited_for() -> None:
    flight = Resuming(flew=())
    assert flight.takeover.waits_for(flight.at(1.0)) == [flight.vehicles[each] for each in EACH]


def test_vehicles_that_were_left_alone_are_named_by_reason_with_how_to_take_those_in_the_air() -> None:
    flight = Resuming(silent_s=1.0)
    decided(flight, FIRST, m.PLANE_MODE_RTL)
    decided(flight, SECOND, m.PLANE_MODE_MANUAL, 0.0)
    assert flight.takeover.failure(flight.at(0.3)) is None, "the third is waited for"
    decided(flight, THIRD, m.PLANE_MODE_RTL)
    assert flight.takeover.failure(flight.at(0.3)) == (
        f"no vehicle to take over: vehicle 1, 3: in RTL, {LEFT_IN_GUIDED}; vehicle 2: on the ground; "
        "--take takes those in the air"
    )
    assert not flight.takeover.took_any
    assert flight.logged.of("takeover", 2) == ["left as it is: on the ground"]


def test_where_all_are_on_the_ground_the_flight_is_to_be_flown_from_its_start() -> None:
    flight = Resuming()
    for identity in EACH:
        decided(flight, identity, m.PLANE_MODE_MANUAL, 0.0)
    assert flight.takeover.requests(flight.at(0.5)) == [], "no failsafe needs to explain its mode"
    assert flight.takeover.failure(flight.at(0.5)) == (
        "no vehicle to take over: vehicle 1, 2, 3: on the ground; fly it from its start, by its scenario"
    )


def test_one_that_was_taken_over_and_then_by_its_pilot_is_named_so() -> None:
    flight = Resuming()
    taken = decided(flight, FIRST, m.PLANE_MODE_GUIDED)
    for identity in (SECOND, THIRD):
        decided(flight, identity, m.PLANE_MODE_MANUAL, 0.0)
    assert flight.takeover.failure(flight.at(0.5)) is None
    taken.leave_to_pilot(flight.at(1.0))
    assert flight.takeover.failure(flight.at(1.0)) == (
        "no vehicle to take over: vehicle 1: taken by its pilot since; vehicle 2, 3: on the ground"
    )


def test_a_virtual_leader_needs_all_and_another_one_of_them() -> None:
    for near, failure in (
        ((), "a virtual leader flies at the centroid of all vehicles, and not all can be taken over"),
        ((FIRST,), None),
    ):
        flight = Resuming(near=near, planned=None if near else virtually_led())
        for identity in (FIRST, THIRD):
            decided(flight, identity, m.PLANE_MODE_GUIDED)
        assert flight.takeover.failure(flight.at(LATE_S)) == failure
        decided(flight, SECOND, m.PLANE_MODE_GUIDED)
        assert flight.takeover.failure(flight.at(LATE_S)) is None


def test_with_a_virtual_leader_the_flight_goes_on_once_all_follow_and_none_is_made_leader() -> None:
    flight = Resuming(near=(), planned=virtually_led())
    for identity in (THIRD, FIRST):
        flight.vehicles[identity].member = Member.FLYING
        assert not flight.takeover.may_begin(flight.at(2.0 * LATE_S))
    flight.vehicles[SECOND].member = Member.FLYING
    assert flight.takeover.may_begin(flight.at(0.0))
    assert flight.led == []


def test_one_that_is_received_is_waited_for_until_it_is_decided_on_or_given_up() -> None:
    flight = Resuming()
    vehicle = flight.receive(SECOND, m.PLANE_MODE_GUIDED)
    assert not flight.takeover.settled(flight.at(100.0))
    start_up: Any = SimpleNamespace(asked_for_telemetry=True, abandoned=True, left=False, finished=False, acted=False)
    vehicle.start_up = start_up
    assert flight.takeover.settled(flight.at(100.0))
    assert not flight.takeover.settled(flight.at(WAIT_S)), "the others are silent"
    flight.vehicles[FIRST].connection.state = LinkState.LOST
    assert not flight.takeover.settled(flight.at(100.0)), "it was received"


@pytest.mark.parametrize("lacks", ["a request for telemetry", "a position", "a heartbeat", "nothing"])
def test_nothing_is_decided_before_telemetry_was_asked_for_and_is_complete(lacks: str) -> None:
    flight = Resuming()
    vehicle = flight.receive(THIRD, m.PLANE_MODE_GUIDED)
    if lacks == "a request for telemetry":
        vehicle.start_up.asked_for_telemetry = False  # type: ignore[misc]
    elif lacks == "a position":
        vehicle.telemetry.motion = None
    elif lacks == "a heartbeat":
        vehicle.telemetry.heartbeat = None
    assert flight.takeover.may_act(vehicle, flight.at(0.1)) is (lacks == "nothing")
    assert len(flight.logged) == (lacks == "nothing")


def test_what_was_decided_once_stays_and_is_reported_once() -> None:
    flight = Resuming()
    vehicle = decided(flight, FIRST, m.PLANE_MODE_GUIDED)
    kind = m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA
    vehicle.telemetry.store(Heartbeat(*kind, 0, m.PLANE_MODE_MANUAL, m.MAV_STATE_STANDBY))
    assert flight.takeover.may_act(vehicle, flight.at(0.5))
    assert len(flight.logged) == 1
    assert not vehicle.is_left


@pytest.mark.parametrize(
    ("known", "mode", "height_m", "words"),
    [
        (RecordedVehicle("LOITER", parted=False, flew=True), m.PLANE_MODE_LOITER, 100.0, "taken over in LOITER"),
        (RecordedVehicle("RTL", parted=False, flew=True), m.PLANE_MODE_GUIDED, 100.0, "taken over in GUIDED"),
        (RecordedVehicle("GUIDED", parted=False, flew=True), m.PLANE_MODE_RTL, 0.0, "left as it is: on the ground"),
        (
            RecordedVehicle("GUIDED", parted=True, flew=True),
            m.PLANE_MODE_RTL,
            100.0,
            "left as it is: in RTL, its pilot's or its failsafe's already before; --take takes it",
        ),
    ],
)
def test_where_no_failsafe_matters_none_is_read(known: RecordedVehicle, mode: int, height_m: float, words: str) -> None:
    flight = Resuming()
    flight.known[SECOND] = known
    assert flight.takeover.may_act(flight.receive(SECOND, mode, height_m), flight.at(0.1))
    assert flight.takeover.requests(flight.at(0.2)) == []
    assert flight.logged.of("takeover", 2) == [words]


def test_one_without_a_failsafe_that_goes_home_is_left_alone() -> None:
    flight = Resuming(silent_s=600.0)
    vehicle = flight.receive(FIRST, m.PLANE_MODE_RTL)
    assert flight.takeover.may_act(vehicle, flight.at(0.1)) is False
    flight.tell_parameters(vehicle, failsafe=False)
    assert flight.takeover.may_act(vehicle, flight.at(0.2))
    assert flight.logged.of("takeover") == [f"left as it is: in RTL, {LEFT_IN_GUIDED}; --take takes it"]


def test_a_resumed_flight_does_not_begin_where_the_scenario_has_it() -> None:
    assert Resuming().takeover.from_start is False


def test_each_vehicle_whose_mode_may_be_its_failsafes_is_asked_for_its_own_parameters() -> None:
    flight = Resuming()
    each = [flight.receive(identity, m.PLANE_MODE_RTL) for identity in (FIRST, THIRD)]
    for vehicle in (*each, *each):
        assert not flight.takeover.may_act(vehicle, flight.at(0.1))
    asked = flight.takeover.requests(flight.at(0.2))
    assert all(isinstance(request, ParamRequestRead) for _, request in asked)
    assert {vehicle.identity: request.target_system for vehicle, request in asked} == {FIRST: 1, THIRD: 3}  # type: ignore[attr-defined]
    stray = ParamValue(next(iter(PARAMETERS)), 1.0, m.MAV_PARAM_TYPE_REAL32, 1000, 0)
    flight.takeover.receive_parameter(flight.vehicles[SECOND], stray, flight.at(0.3))
    flight.tell_parameters(each[0])
    assert [flight.takeover.may_act(vehicle, flight.at(0.4)) for vehicle in each] == [True, False]


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        (m.PLANE_MODE_RTL, "in RTL at the flight's end"),
        (m.PLANE_MODE_LOITER, "in LOITER at the flight's end"),
        (m.PLANE_MODE_CRUISE, f"in CRUISE, {LEFT_IN_GUIDED}; --take takes it"),
    ],
)
def test_of_a_flight_that_was_ending_those_are_left_that_have_ended_it(mode: int, words: str) -> None:
    flight = Resuming(ending=True, silent_s=1.0)
    vehicle = decided(flight, SECOND, mode)
    assert flight.logged.of("takeover") == [f"left as it is: {words}"]
    assert vehicle.is_left


def test_a_flight_that_was_ending_is_over_once_none_is_left_that_follows_setpoints() -> None:
    for ending in (True, False):
        flight = Resuming(ending=ending, silent_s=1.0)
        assert not flight.takeover.is_over(flight.at(LATE_S)), "none is received"
        decided(flight, FIRST, m.PLANE_MODE_RTL)
        assert flight.takeover.is_over(flight.at(LATE_S)) is ending
        assert (flight.takeover.failure(flight.at(LATE_S)) is None) is ending
        decided(flight, SECOND, m.PLANE_MODE_GUIDED)
        assert flight.takeover.took_any
        assert not flight.takeover.is_over(flight.at(LATE_S))


class Resumed:
    """The stage of a resumed flight; what it makes of the flight is noted."""

    def __init__(self, *, ending: bool, phase: Phase = Phase.CONNECTING, passed: bool = True) -> None:
        self.flight, self.done = Resuming(ending=ending, silent_s=1.0), list[Any]()
        machine = SimpleNamespace(
            gate=SimpleNamespace(passed=passed),
            fail=lambda text, now, *, begun: self.done.append((text, now, begun)),
            move=lambda cause, now: self.done.append((cause, now)),
            stop=lambda now: self.done.append(("stop", now)),
        )
        cycle: Any = SimpleNamespace(
            beginning=self.flight.takeover, flight=SimpleNamespace(phase=phase), phase_machine=machine
        )
        self.cycle = cycle
        (self.stage,) = FEATURE.stages(cycle)

    def at(self, seconds: float) -> list[Any]:
        """Run the stage; return what it does."""
        self.cycle.now = self.flight.at(seconds)
        before = len(self.done)
        self.stage.run(self.cycle)
        found = self.done[before:]
        assert all(each[1] == self.cycle.now for each in found)
        return [each[0] if len(each) == 2 else each[::2] for each in found]


def test_only_a_flight_that_is_resumed_has_the_stage() -> None:
    cycle: Any = SimpleNamespace(beginning=object())
    assert FEATURE.stages(cycle) == []


@pytest.mark.parametrize("taken", [False, True])
def test_a_flight_without_a_vehicle_to_take_over_fails_and_counts_as_begun_if_one_was_taken(taken: bool) -> None:
    resumed = Resumed(ending=False)
    assert resumed.at(WAIT_S) == []
    if taken:
        decided(resumed.flight, FIRST, m.PLANE_MODE_GUIDED)
        assert resumed.at(LATE_S) == []
        resumed.flight.vehicles[FIRST].leave_to_pilot(resumed.flight.at(6.0))
    ((reason, begun),) = resumed.at(7.0)
    assert reason.startswith("no vehicle to take over: ")
    assert begun is taken


@pytest.mark.parametrize("phase", [Phase.FLYING, Phase.LOITERING, Phase.DONE, Phase.FAILED])
def test_once_it_has_begun_again_it_is_not_ended_by_that(phase: Phase) -> None:
    for ending in (True, False):
        resumed = Resumed(ending=ending, phase=phase)
        decided(resumed.flight, FIRST, m.PLANE_MODE_RTL)
        assert resumed.at(100.0) == []


def test_a_flight_that_had_ended_is_called_off() -> None:
    resumed = Resumed(ending=True)
    decided(resumed.flight, FIRST, m.PLANE_MODE_LOITER)
    assert resumed.at(WAIT_S) == []
    assert resumed.at(LATE_S) == [Cause.CALLED_OFF]


def test_a_flight_that_was_ending_is_led_to_its_end_by_a_vehicle_that_follows() -> None:
    resumed = Resumed(ending=True)
    decided(resumed.flight, FIRST, m.PLANE_MODE_GUIDED)
    resumed.flight.vehicles[FIRST].member = Member.FLYING
    assert resumed.at(WAIT_S) == [], "the others are waited for"
    assert resumed.at(LATE_S) == [Cause.LEADER_READY, "stop"]


@pytest.mark.parametrize(("follows", "passed"), [(False, True), (True, False), (False, False)])
def test_without_one_that_leads_it_is_stopped_after_10_s(follows: bool, passed: bool) -> None:
    resumed = Resumed(ending=True, passed=passed)
    decided(resumed.flight, FIRST, m.PLANE_MODE_GUIDED)
    resumed.flight.vehicles[FIRST].member = Member.FLYING if follows else Member.STARTING
    assert resumed.at(10.0) == []
    assert resumed.at(10.1) == ["stop"]


def test_a_flight_that_was_not_ending_goes_on_by_itself() -> None:
    resumed = Resumed(ending=False)
    decided(resumed.flight, FIRST, m.PLANE_MODE_GUIDED)
    resumed.flight.vehicles[FIRST].member = Member.FLYING
    for seconds in (1.0, LATE_S, 100.0):
        assert resumed.at(seconds) == []
    assert after(resumed.flight.began, 100.0) == resumed.cycle.now
