"""What every vehicle is sent, whether it flies or not: heartbeats, the mission time, and TIMESYNC probes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Set

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.identity import VehicleId
from airlink.messages import Message
from airlink.messages.system import MISSION_TIME, Heartbeat, NamedValueFloat
from gcs_formation.link.connection import LinkState
from gcs_formation.recorder import Note
from gcs_formation.vehicle.vehicle import Vehicle

HEARTBEAT_S = 1.0
PROBE_S = 0.25
GOLDEN = (math.sqrt(5) - 1) / 2
PROBE_DITHER_S = 0.02
"""Probes are spread over the period of a vehicle's main loop, so that the wait for it averages to half a period."""


class Beacon:
    """Schedules heartbeats and probes, and creates their messages.

    A heartbeat tells an autopilot that somebody looks after it: one that should be commanded, and for which no setpoint
    comes, gets none. Then its own failsafe acts.
    """

    def __init__(self, vehicles: Mapping[VehicleId, Vehicle], note: Note) -> None:
        """Serve `vehicles`, from the first instant on."""
        self.next_probe = Instant(0)
        self._vehicles = vehicles
        self._next_heartbeat = Instant(0)
        self._probes = 0
        self._note, self._withheld = note, frozenset[VehicleId]()

    def hasten(self, now: Instant) -> None:
        """Make the next heartbeat, and the mission time with it, due at once."""
        self._next_heartbeat = now

    def greets(self, now: Instant) -> bool:
        """Return whether a heartbeat is due; if so, schedule the next one."""
        if now < self._next_heartbeat:
            return False
        self._next_heartbeat = after(now, HEARTBEAT_S)
        return True

    def greetings(self, mission_s: float, unguided: Set[VehicleId], now: Instant) -> Iterator[tuple[Vehicle, Message]]:
        """Yield the heartbeat of every vehicle but the `unguided`, and the mission time once there is one."""
        for identity, vehicle in self._vehicles.items():
            if (identity in unguided) != (identity in self._withheld):
                text = "withheld: there is no setpoint for it" if identity in unguided else "sent again"
                self._note(now, "heartbeats", text, vehicle)
            if identity in unguided:
                continue
            yield vehicle, Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
            if math.isfinite(mission_s):
                yield vehicle, NamedValueFloat(seconds_between(Instant(0), now), MISSION_TIME, mission_s)
        self._withheld = frozenset(unguided)

    def probes(self, now: Instant) -> Iterator[tuple[Vehicle, Message]]:
        """Yield a probe for every vehicle that was ever heard, and schedule the next ones."""
        self._probes += 1
        dither_s = PROBE_DITHER_S * ((self._probes * GOLDEN) % 1.0)
        grid_s = (math.floor(seconds_between(Instant(0), now) / PROBE_S) + 1) * PROBE_S
        self.next_probe = after(Instant(0), grid_s + dither_s)
        for vehicle in self._vehicles.values():
            if vehicle.connection.state is not LinkState.SEARCHING:
                yield vehicle, vehicle.probe(now)
