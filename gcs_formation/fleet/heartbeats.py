"""Schedules heartbeats, the mission time and TIMESYNC requests."""

from __future__ import annotations

import math
from collections.abc import Collection, Set
from typing import Final

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import VehicleId
from airlink.messages import MISSION_TIME, Message
from airlink.messages.system import Heartbeat, NamedValueFloat
from flight_model.autopilot_model import finite
from gcs_formation.link.link_health import LinkState
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.vehicle import Vehicle

HEARTBEAT_S: Final = 1.0
HEARTBEAT: Final = Heartbeat(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
PROBE_S: Final = 0.25
FAILOVER_PROBE_S: Final = 0.2
"""Period of requests on each of several links, by which one that dies is found within a second."""
GOLDEN: Final = (math.sqrt(5) - 1) / 2
OFTEN_PROBE_S: Final = 0.1
"""Period of requests to a vehicle whose clock is still uncertain by jitter: the uncertainty goes with its root."""
MAX_LOSS: Final = 0.02
"""With more loss the link may be full, and isn't loaded with more requests."""
SPREAD: Final = math.sqrt(2.0) - 1.0
PROBE_DITHER_S: Final = 0.02
"""Requests are spread over the period of a vehicle's main loop, so that the wait for it averages to half a period."""


class HeartbeatScheduler:
    """Schedules heartbeats and TIMESYNC requests, and creates their messages.

    A heartbeat shows an autopilot that it is being controlled. So a vehicle that should follow setpoints, but has none,
    gets no heartbeats either, and its own failsafe acts.
    """

    def __init__(
        self,
        vehicles: dict[VehicleId, Vehicle],
        log_event: LogEvent,
        narrow: Collection[VehicleId] = (),
        radios: RadioReports | None = None,
        tick_s: float = 0.0,
    ) -> None:
        """Start with both due at once; `narrow`: vehicles to which nothing more is sent than needed.

        Nor is it to those behind a radio, as far as `radios` have reported. Heartbeats leave at ticks, `tick_s` apart.
        """
        self.next_probe = Instant(0)
        self._vehicles, self._narrow, self._radios = vehicles, set(narrow), radios
        self._due = dict[VehicleId, Instant]()
        """When each vehicle is due for its next request."""
        self._next_common = Instant(0)
        """When those that haven't been asked yet are."""
        self._slower = dict[VehicleId, tuple[float, bool]]()
        """The periods of requests to vehicles, s, and whether they are irregular."""
        self._next_heartbeat, self._half_tick_s = Instant(0), tick_s / 2.0
        self._log_event, self._withheld = log_event, frozenset[VehicleId]()
        self._missed = list[Vehicle]()
        """Vehicles of a resumed flight that haven't been received yet: their failsafe may be about to act."""

    def spare(self, identity: VehicleId, period_s: float, *, irregular: bool) -> None:
        """Send a vehicle requests at this period, or irregularly at this mean period, unless more of them pay."""
        self._slower[identity] = period_s, irregular

    def resume(self, at: Instant) -> None:
        """Send no TIMESYNC request before a flight is resumed, then heartbeats whenever another vehicle is received."""
        self.next_probe = self._next_common = at
        self._missed = list(self._vehicles.values())

    def hasten(self, now: Instant) -> None:
        """Make the next heartbeat, and the mission time with it, due at once."""
        self._next_heartbeat = now

    def heartbeat_due(self, now: Instant) -> bool:
        """Return whether a heartbeat is due; if so, schedule the next one.

        It leaves at the tick nearest to its second: ticks needn't divide one, as at 3 Hz, and still it is one a second.
        """
        if self._missed:
            missed = [each for each in self._missed if each.connection.state is LinkState.SEARCHING]
            if len(missed) < len(self._missed):
                self._missed = missed
                self.hasten(now)
        late_s = seconds_between(self._next_heartbeat, now)
        if late_s < -self._half_tick_s:
            return False
        self._next_heartbeat = after(self._next_heartbeat if late_s <= self._half_tick_s else now, HEARTBEAT_S)
        return True

    def heartbeats(self, mission_s: float, unguided: Set[VehicleId], now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return the heartbeat of every vehicle but the `unguided`, and the mission time once there is one.

        A vehicle that is armed for this flight and hasn't reported its home is asked for it.
        """
        found = list[tuple[Vehicle, Message]]()
        for identity, vehicle in self._vehicles.items():
            if (identity in unguided) != (identity in self._withheld):
                text = "withheld: there is no setpoint for it" if identity in unguided else "sent again"
                self._log_event(now, "heartbeats", text, vehicle)
            if identity in unguided:
                vehicle.left_alone(now)
                continue
            found.append((vehicle, HEARTBEAT))
            if finite(mission_s):
                since_0_s = seconds_between(Instant(0), now)
                found.append((vehicle, NamedValueFloat(since_0_s, MISSION_TIME, mission_s)))
            if vehicle.home_unreported:
                found.append((vehicle, vehicle.ask(vehicle.autopilot.home_request())))
        self._withheld = frozenset(unguided)
        return found

    def probes(self, now: Instant) -> list[tuple[Vehicle, Message]]:
        """Return a TIMESYNC request for each vehicle that was ever received and is due, and schedule the next ones.

        When a vehicle is due depends on its own link alone, so that a change of one link leaves the others as they are.
        """
        received = [each for each in self._vehicles.values() if _is_received(each)]
        asked = [each for each in received if now >= self._due_of(each)]
        if now >= self._next_common:
            self._next_common = _next_probe(now, PROBE_S)
        for each in asked:
            self._due[each.identity] = self._next(each, now)
        self.next_probe = min([self._next_common, *(self._due_of(each) for each in received)])
        return [(vehicle, vehicle.probe(now)) for vehicle in asked]

    def _due_of(self, vehicle: Vehicle) -> Instant:
        """Return when a vehicle is due for its next request; one that hasn't been asked yet, with the others."""
        return self._due.get(vehicle.identity, self._next_common)

    def _next(self, vehicle: Vehicle, now: Instant) -> Instant:
        """Return when a vehicle's next request is due.

        Over a full link these are irregular, so that the other messages, which come at regular times, delay them as
        often on the way up as on the way down (RFC 2330, 11.1: "Poisson sampling").
        """
        period_s, irregular = self._slower.get(vehicle.identity, (PROBE_S, False))
        if vehicle.links is not None and not irregular:
            often = vehicle.links.doubtful(now) or self._pays(vehicle, now)
            return _next_probe(now, OFTEN_PROBE_S if often else FAILOVER_PROBE_S)
        if irregular:
            share = (seconds_between(Instant(0), now) / period_s * GOLDEN + vehicle.index * SPREAD) % 1.0
            return after(now, period_s * (0.5 + share))
        return _next_probe(now, OFTEN_PROBE_S if self._pays(vehicle, now) else period_s)

    def _pays(self, vehicle: Vehicle, now: Instant) -> bool:
        """Return whether more requests would tell its clock better, and its link has room for them."""
        if not vehicle.clock.wants_more or vehicle.identity in self._narrow or vehicle.sequence.loss >= MAX_LOSS:
            return False
        return self._radios is None or self._radios.of(vehicle.connection, now) is None


def _is_received(vehicle: Vehicle) -> bool:
    """Return whether a vehicle was ever received, on any link."""
    if vehicle.links is None:
        return vehicle.connection.state is not LinkState.SEARCHING
    return any(link.connection.state is not LinkState.SEARCHING for link in vehicle.each_link)


def _next_probe(now: Instant, period_s: float) -> Instant:
    """Return the next time on the grid of a period, each spread by its number in golden-section steps."""
    number = math.floor(seconds_between(Instant(0), now) / period_s) + 1
    return after(Instant(0), number * period_s + PROBE_DITHER_S * ((number * GOLDEN) % 1.0))
