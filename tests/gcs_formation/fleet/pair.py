"""A leader and a follower, and what decides on their membership; a test says what is known of them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.system import Heartbeat
from airlink.messages.telemetry import GlobalPositionInt
from flight_model.earth import GeodeticOrigin
from formation_scenario import load_scenario
from gcs_formation.fleet.membership import Membership
from gcs_formation.link.link_health import Connection
from gcs_formation.vehicle.families.arduplane.arduplane import ArduPlane
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.startup import StartUp
from gcs_formation.vehicle.vehicle import Vehicle
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
LEADER, FOLLOWER = VehicleId(1, 1), VehicleId(1, 2)
GUIDED, LOITER, MANUAL = m.PLANE_MODE_GUIDED, m.PLANE_MODE_LOITER, m.PLANE_MODE_MANUAL


class Formation:
    """A leader and a follower in GUIDED, received and answering at 0 s; the test sets the age of their telemetry."""

    def __init__(self, **law: Any) -> None:
        planned = load_scenario(scenario(vehicles={"count": 2}, law={"type": "fuzzy_pid", **law}))
        self.max_age_s = planned.law.max_age_s
        self.vehicles = {identity: vehicle(identity) for identity in (LEADER, FOLLOWER)}
        self.logged, self.ages_s, self.beyond = EventLog(), [0.0, 0.0], set[VehicleId]()
        self.membership = Membership(planned, self.vehicles, self.logged)
        self.estimator: Any = SimpleNamespace(age_s=lambda index, _: self.ages_s[index])
        self.now = Instant(0)
        self.judge(0.0)

    def judge(self, at_s: float, *, received: bool = True) -> Member:
        """Judge all at a time until which they were received; return the follower's membership."""
        self.now = after(Instant(0), at_s)
        for each in self.vehicles.values():
            if received:
                each.connection.record_frame(self.now, heartbeat=True)
                each.round_trips._answered = self.now
        self.membership.update(self.vehicles[LEADER], self.estimator, self.now, connecting=False, beyond=self.beyond)
        return self.follower.member

    def silent(self, at_s: float, of: VehicleId = FOLLOWER) -> Member:
        """Judge at a time when one of them was last received at 0 s, and the other just now."""
        other = LEADER if of == FOLLOWER else FOLLOWER
        self.vehicles[other].connection.record_frame(after(Instant(0), at_s), heartbeat=True)
        self.vehicles[other].round_trips._answered = after(Instant(0), at_s)
        while self.vehicles[of].connection.check(after(Instant(0), at_s)):
            pass
        self.ages_s[0 if of == LEADER else 1] = at_s
        return self.judge(at_s, received=False)

    def told(self, number: VehicleId = FOLLOWER) -> list[float]:
        """Return the modes that a vehicle is being commanded."""
        return [each.param2 for each in self.vehicles[number].commands._waiting if each.command == SET_MODE]

    def reports(self, mode: int, number: VehicleId = FOLLOWER) -> None:
        beat(self.vehicles[number], mode)

    @property
    def follower(self) -> Vehicle:
        return self.vehicles[FOLLOWER]


SET_MODE = m.MAV_CMD_DO_SET_MODE


def vehicle(identity: VehicleId) -> Vehicle:
    made = Vehicle(
        identity,
        (LEADER, FOLLOWER).index(identity),
        ArduPlane(identity.system, ORIGIN, 0.25),
        Connection(0),
        10.0,
    )
    made.start_up = StartUp((), index=0)
    lat_rad, lon_rad, alt_m = ORIGIN.from_ned(30.0 * identity.system, 0.0, -100.0)
    made.telemetry.store(GlobalPositionInt(1.0, lat_rad, lon_rad, alt_m, 100.0, 22.0, 0.0, 0.0, 0.0))
    beat(made, GUIDED)
    return made


def beat(of: Vehicle, mode: int) -> None:
    armed, flies = m.MAV_MODE_FLAG_SAFETY_ARMED, m.MAV_STATE_ACTIVE
    of.telemetry.store(Heartbeat(m.MAV_TYPE_FIXED_WING, m.MAV_AUTOPILOT_ARDUPILOTMEGA, armed, mode, flies))
