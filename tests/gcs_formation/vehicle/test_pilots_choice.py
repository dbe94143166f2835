"""A pilot takes over a PX4, although each setpoint commands Hold and would undo any other mode at once."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.frame import FrameWriter
from airlink.messages import Message
from airlink.messages.command import CommandAck
from airlink.messages.system import CurrentMode, Heartbeat
from airlink.messages.telemetry import GlobalPositionInt
from airlink.stream_parser import StreamParser
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.fleet.membership import Membership
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.families.px4.plane import Px4Plane
from gcs_formation.vehicle.families.px4.px4 import LOITER, RTL
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)


class Flight:
    """One PX4 that flies in the formation, in Hold."""

    def __init__(self) -> None:
        identity = VehicleId(1, 1)
        self.plane = Vehicle(identity, 0, Px4Plane(1, ORIGIN, 0.25), Connection(0), 10.0)
        self.plane.start_up = StartUp(())
        self.plane.start_up.index, self.plane.member = 1, Member.FLYING
        keys = scenario(vehicles={"count": 2}, law={"type": "fuzzy_pid"})
        self.membership = Membership(load_scenario(keys), {identity: self.plane}, EventLog())
        self.now, self._writer = Instant(0), FrameWriter(1, 1)
        lat_rad, lon_rad, alt_m = ORIGIN.from_ned(0.0, 0.0, -80.0)
        self.receive(GlobalPositionInt(1.0, lat_rad, lon_rad, alt_m, 80.0, 0.0, 0.0, 0.0, 0.0))
        self.beats(LOITER)

    def receive(self, message: Message) -> None:
        (frame,) = StreamParser().feed(self._writer.encode(message))
        self.plane.receive(frame, self.now)

    def beats(self, mode: int) -> Member:
        """Take a heartbeat a second later, and judge."""
        self.now = after(self.now, 1.0)
        base = m.MAV_MODE_FLAG_SAFETY_ARMED | m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self.receive(Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_PX4, base, mode, m.MAV_STATE_ACTIVE))
        return self.judge()

    def judge(self) -> Member:
        estimator: Any = SimpleNamespace(age_s=lambda *_: 0.0)
        self.membership.update(None, estimator, self.now, connecting=False)
        return self.plane.member


@pytest.fixture
def flight() -> Flight:
    return Flight()


def test_a_mode_seen_between_two_setpoints_is_the_pilots_and_is_commanded_again(flight: Flight) -> None:
    flight.receive(CurrentMode(0, RTL))
    flight.receive(CurrentMode(0, LOITER))  # by the next setpoint, before the first judgement
    assert flight.judge() is Member.PARTED
    command = flight.plane.commands.due(flight.now)
    assert command == flight.plane.autopilot.set_mode(RTL)


def test_it_stays_the_pilots_until_heartbeats_after_the_acknowledgement_show_hold(flight: Flight) -> None:
    flight.receive(CurrentMode(0, RTL))
    assert flight.judge() is Member.PARTED
    assert [flight.beats(LOITER) for _ in range(4)] == [Member.PARTED] * 4  # setpoints command Hold: no acknowledgement
    assert flight.plane.commands.due(flight.now) is not None
    flight.receive(CommandAck(m.MAV_CMD_DO_SET_MODE, m.MAV_RESULT_ACCEPTED))
    assert [flight.beats(RTL) for _ in range(3)] == [Member.PARTED] * 3
    assert flight.beats(LOITER) is Member.FLYING  # the pilot gives it back


def test_its_own_hold_is_no_pilots_choice(flight: Flight) -> None:
    flight.receive(CurrentMode(0, LOITER))
    assert flight.judge() is Member.FLYING
