"""Which vehicles are taken over after the ground station was killed."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.command import ParamValue
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import Attitude, GlobalPositionInt
from flight_model.earth import GeodeticOrigin
from formation_scenario import Scenario, load_scenario
from formation_scenario.slot_assignment import first_arrangement
from gcs_formation.features.resumption.takeover import WAIT_S, Found, Takeover, why_left
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.mission.past_flight import PastFlight, RecordedVehicle
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog


def resumed(*, ending: bool = False, take: bool = False) -> PastFlight:
    return PastFlight(
        at=Instant(70_000_000_000),
        vehicles={},
        mission_s=40.0,
        path_began=Instant(20_000_000_000),
        distance_m=880.0,
        heading_rad=None,
        speed_mps=22.0,
        arrangement=first_arrangement(load_scenario(scenario())),
        slots_m=np.zeros((3, 3)),
        ending=ending,
        take=take,
    )


def found(mode: str, *, airborne: bool = True, by_failsafe: bool = False) -> Found:
    return Found(mode, airborne, mode == "GUIDED" and airborne, mode in ("LOITER", "RTL"), by_failsafe)


GUIDED, LOITER = RecordedVehicle("GUIDED", parted=False, flew=True), RecordedVehicle("LOITER", parted=False, flew=True)
PILOTS = RecordedVehicle("LOITER", parted=True, flew=True)


@pytest.mark.parametrize(
    ("known", "now", "flight", "left"),
    [
        (GUIDED, found("GUIDED"), resumed(), None),
        (GUIDED, found("GUIDED", airborne=False), resumed(), "on the ground"),
        (GUIDED, found("LOITER"), resumed(), "in LOITER, and the flight had left it in GUIDED"),
        (GUIDED, found("RTL"), resumed(), "in RTL, and the flight had left it in GUIDED; --take takes it"),
        (GUIDED, found("RTL"), resumed(take=True), None),
        (GUIDED, found("RTL", by_failsafe=True), resumed(), None),
        (GUIDED, found("LOITER"), resumed(take=True), None),
        (LOITER, found("LOITER"), resumed(), None),  # commanded by the station itself
        (PILOTS, found("LOITER"), resumed(), "in LOITER, its pilot's or its failsafe's already before"),
        (PILOTS, found("RTL", by_failsafe=True), resumed(), "in RTL, its pilot's or its failsafe's already before"),
        (PILOTS, found("RTL"), resumed(take=True), None),
        (PILOTS, found("GUIDED"), resumed(), None),  # given back by its pilot
        (RecordedVehicle("TAKEOFF", parted=False, flew=True), found("TAKEOFF"), resumed(), None),
        (
            RecordedVehicle(None, parted=False, flew=False),
            found("MANUAL"),
            resumed(),
            "in MANUAL, and the flight had left it in an",
        ),
        (LOITER, found("LOITER"), resumed(ending=True), "in LOITER at the flight's end"),
        (GUIDED, found("GUIDED"), resumed(ending=True), None),
        (GUIDED, found("LOITER"), resumed(ending=True), "in LOITER at the flight's end"),
        (GUIDED, found("RTL", by_failsafe=True), resumed(ending=True), None),
        (LOITER, found("LOITER"), resumed(ending=True, take=True), "in LOITER at the flight's end"),
        (LOITER, found("LOITER", by_failsafe=True), resumed(ending=True), "in LOITER at the flight's end"),
        (GUIDED, found("FBWA"), resumed(ending=True, take=True), None),
        (GUIDED, found("RTL"), resumed(ending=True, take=True), None),
    ],
)
def test_who_flies_as_the_flight_or_its_failsafe_left_it_is_taken_and_others_with_take(
    known: RecordedVehicle, now: Found, flight: PastFlight, left: str | None
) -> None:
    reason = why_left(known, flight, now)
    assert (reason is None) == (left is None)
    assert (reason or "").startswith(left or "")


def test_the_leader_is_looked_for_where_it_may_have_come_to() -> None:
    """10 s after the last tick, 50 s after the path's start: 220 m farther, plus 100 m, plus half of that."""
    assert resumed().reach_m == (880.0 - 100.0, 880.0 + 1.5 * 220.0 + 100.0)


ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
FIRST, SECOND, THIRD = EACH = tuple(VehicleId(1, number) for number in (1, 2, 3))
PARAMETERS = {"FS_GCS_ENABL": 1.0, "FS_LONG_ACTN": 1.0, "FS_LONG_TIMEOUT": 5.0}
"""An ArduPlane goes home after 5 s without a ground station."""


class Resuming:
    """A flight of three that all flew when its record ended, resumed at 70 s; none has been received yet."""

    def __init__(
        self,
        *,
        ending: bool = False,
        silent_s: float = 20.0,
        flew: tuple[VehicleId, ...] = EACH,
        near: tuple[VehicleId, ...] = (FIRST, THIRD, SECOND),
        planned: Scenario | None = None,
    ) -> None:
        self.vehicles = {
            each: Vehicle(each, place, ArduPlane(each.system, ORIGIN, 0.25), Connection(0), 10.0)
            for place, each in enumerate(EACH)
        }
        known = {each: RecordedVehicle("GUIDED", parted=False, flew=each in flew) for each in EACH}
        past = replace(resumed(ending=ending), vehicles=known, near=near, silent_s=silent_s)
        self.logged, self.led = EventLog(), list[VehicleId]()
        changes = SimpleNamespace(lead=lambda leader, _now: self.led.append(leader))
        cycle: Any = SimpleNamespace(
            scenario=planned or load_scenario(scenario()),
            vehicles=self.vehicles,
            log_event=self.logged,
            reconfiguration=changes,
        )
        self.known, self.takeover, self.began = known, Takeover(cycle, past), past.at

    def at(self, seconds: float) -> Instant:
        return after(self.began, seconds)

    def receive(self, identity: VehicleId, mode: int, height_m: float = 100.0) -> Vehicle:
        """Let a vehicle be found in a mode, in flight or on the ground, with all that is needed of its telemetry."""
        vehicle = self.vehicles[identity]
        vehicle.connection.state = LinkState.CONNECTED
        vehicle.telemetry.airspeed_mps = 22.0
        start_up: Any = SimpleNamespace(
            asked_for_telemetry=True, abandoned=False, left=False, finished=False, acted=False
        )
        vehicle.start_up = start_up
        for message in (
            GlobalPositionInt(1.0, ORIGIN.lat_rad, ORIGIN.lon_rad, height_m, height_m, 22.0, 0.0, 0.0, 0.0),
            Attitude(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            Heartbeat(
                m.MAV_TYPE_FIXED_WING,
                m.MAV_AUTOPILOT_ARDUPILOTMEGA,
                m.MAV_MODE_FLAG_SAFETY_ARMED if height_m else 0,
                mode,
                m.MAV_STATE_ACTIVE if height_m else m.MAV_STATE_STANDBY,
            ),
        ):
            vehicle.telemetry.store(message)
        return vehicle

    def tell_parameters(self, vehicle: Vehicle, *, failsafe: bool = True) -> None:
        for name, value in PARAMETERS.items():
            reported = ParamValue(name, value if failsafe else 0.0, m.MAV_PARAM_TYPE_REAL32, 1000, 0)
            self.takeover.receive_parameter(vehicle, reported, self.at(0.0))


def test_those_that_flew_are_waited_for_until_they_are_heard_and_not_for_ever() -> None:
    flight = Resuming(flew=(FIRST, SECOND))
    assert [each.identity for each in flight.takeover.waits_for(flight.at(1.0))] == [FIRST, SECOND]
    flight.receive(SECOND, m.PLANE_MODE_GUIDED)
    assert [each.identity for each in flight.takeover.waits_for(flight.at(WAIT_S))] == [FIRST]
    assert flight.takeover.waits_for(flight.at(WAIT_S + 0.1)) == []


def test_the_former_leader_leads_or_after_a_wait_the_nearest_to_it_that_follows_setpoints() -> None:
    flight = Resuming()
    for identity in (SECOND, THIRD):
        flight.vehicles[identity].member = Member.FLYING
    assert not flight.takeover.may_begin(flight.at(WAIT_S))
    assert flight.takeover.may_begin(flight.at(WAIT_S + 0.1))
    flight.vehicles[FIRST].member = Member.FLYING
    assert flight.takeover.may_begin(flight.at(0.0))
    assert flight.led == [THIRD, FIRST]


def test_a_flight_that_was_ending_doesnt_begin_again() -> None:
    flight = Resuming(ending=True)
    flight.vehicles[FIRST].member = Member.FLYING
    assert flight.takeover.has_leader(flight.at(0.0))
    assert not flight.takeover.may_begin(flight.at(0.0))


def test_one_that_follows_setpoints_is_taken_over_at_once() -> None:
    flight = Resuming()
    vehicle = flight.receive(FIRST, m.PLANE_MODE_GUIDED)
    assert flight.takeover.may_act(vehicle, flight.at(0.1))
    assert flight.takeover.took_any
    assert flight.logged.of("takeover", 1) == ["taken over in GUIDED"]


@pytest.mark.parametrize(("silent_s", "taken"), [(20.0, True), (4.0, False)])
def test_one_that_goes_home_is_taken_over_if_its_failsafe_says_so_and_had_time_to(silent_s: float, taken: bool) -> None:
    flight = Resuming(silent_s=silent_s)
    vehicle = flight.receive(FIRST, m.PLANE_MODE_RTL)
    assert not flight.takeover.may_act(vehicle, flight.at(0.1)), "its parameters aren't known yet"
    assert flight.takeover.requests(flight.at(0.2))
    flight.tell_parameters(vehicle)
    assert flight.logged == []
    assert flight.takeover.may_act(vehicle, flight.at(0.3))
    assert flight.takeover.took_any == taken
    (said,) = flight.logged.of("takeover", 1)
    assert said.endswith("in RTL, sent there by its failsafe" if taken else "in GUIDED; --take takes it")


def test_one_that_circles_at_the_flights_end_is_left_to_circle() -> None:
    flight = Resuming(ending=True, silent_s=0.0)
    vehicle = flight.receive(FIRST, m.PLANE_MODE_LOITER)
    flight.takeover.may_act(vehicle, flight.at(0.1))
    flight.tell_parameters(vehicle)
    flight.takeover.may_act(vehicle, flight.at(0.2))
    (said,) = flight.logged.of("takeover", 1)
    assert said.endswith("in LOITER at the flight's end")
    assert not flight.takeover.is_over(flight.at(0.2)), "others are still waited for"
    assert flight.takeover.is_over(flight.at(WAIT_S + 0.1))
