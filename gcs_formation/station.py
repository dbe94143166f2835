"""The ground station: an engine around the control cycle, which passes on what arrives and sends what is due."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

from airlink.clock import NANOSECONDS, NEVER, Instant, after, seconds_between
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, Engine
from airlink.frame import Frame, FrameWriter
from airlink.messages import Message
from airlink.messages.command import ParamValue
from airlink.messages.mission import MissionCount, MissionItemInt
from airlink.messages.system import Heartbeat, Statustext, Timesync
from airlink.signing.signed_links import SignedLinks
from airlink.stream_parser import ParserCounts
from formation_scenario import Scenario
from gcs_formation.core.each_second import commands_anybody
from gcs_formation.core.feature import features, take_endings
from gcs_formation.core.parts import Parts
from gcs_formation.core.stages import core_stages, ordered
from gcs_formation.fleet.heartbeats import HEARTBEAT
from gcs_formation.fleet.several_links import receivers
from gcs_formation.link.link_health import Connection
from gcs_formation.link.vehicle_links import Link
from gcs_formation.mission.gate import UNCHECKED, PreFlightOptions
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.recorder import Detail, Event, Recorder, Tick
from gcs_formation.vehicle.vehicle import Vehicle

AWAY_NS: Final = NANOSECONDS // 5
"""A timer overdue by more than this means that the station was held up and datagrams have waited in its queue."""
ALONE_S: Final = 1.0
"""Longest hold-up of the station without effect on failsafes, such as PX4's on missing setpoints."""


class Station(Engine):
    """Flies one scenario. It reads no clock and opens no socket; its record goes to the recorder."""

    def __init__(
        self,
        scenario: Scenario,
        recorder: Recorder,
        until_s: float | None = None,
        utc_at_0_s: float | None = None,
        caution: PreFlightOptions = UNCHECKED,
        resumed: PastFlight | None = None,
        signing: SignedLinks | None = None,
    ) -> None:
        """Prepare a flight; nothing happens before the first timer. `until_s`: mission time at which to end early.

        `utc_at_0_s` is UTC at instant 0, s since 1970, if the machine's clock is set to it; `caution`: checks before
        the first command; `resumed`: the flight to resume; `signing`: the links' keys, if any has one.
        """
        self._recorder, self._out, self._next_tick = recorder, list[Datagram](), Instant(0)
        self.frames_refused = 0
        """Number of valid frames that weren't accepted as any vehicle's."""
        parts = Parts(scenario, recorder, self._log_event, self._send_all, utc_at_0_s, caution, resumed, signing)
        self.scenario, self.cycle = parts.scenario, parts.cycle
        self.controller, self.phase_machine = parts.controller, parts.phase_machine
        self.flight, self.vehicles, self.networks = self.phase_machine.flight, parts.vehicles, parts.networks
        self.gate, self.orders = parts.gate, parts.orders
        self.signatures, self.radio_reports = parts.signatures, parts.radio_reports
        self._endpoints, self._receiver, self._senders = parts.endpoints, parts.receiver, parts.senders
        self._membership, self._flood = parts.membership, parts.flood
        self._dispatch, self._heartbeats = parts.dispatch, parts.heartbeats
        self._several_links = parts.several_links
        # A socket is one of MAVLink's channels, and frames are numbered by channel (guide, "Packet Serialization").
        self._channels = [FrameWriter(*scenario.station.ids) for _ in self._endpoints]
        self._each, self._period_s = list(self.vehicles.values()), 1.0 / scenario.law.rate_hz
        loaded = features()
        self.features = tuple(loaded)
        """Names of the features that it flies with."""
        self.gate.checks += [each.before_take_off for each in loaded.values() if each.before_take_off]
        take_endings(self.cycle)
        core = core_stages(parts, until_s, self._watch_strangers, self._log_link)
        brought = [stage for each in loaded.values() for stage in each.stages(self.cycle)]
        self.cycle.order(ordered(core, brought))
        if resumed is not None:
            self._next_tick = resumed.at
            parts.resume(resumed)

    @property
    def last_tick(self) -> Tick | None:
        """The last tick that commanded the formation."""
        return self.cycle.last_tick

    @property
    def newest(self) -> Tick | None:
        """The last tick that was recorded."""
        return self.cycle.newest

    @property
    def controlled_ticks(self) -> int:
        """Number of ticks at which the formation was commanded."""
        return self.cycle.controlled_ticks

    @property
    def recorded_ticks(self) -> int:
        """Number of all recorded ticks since the first take-off."""
        return self.cycle.recorded_ticks

    # The engine's interface.

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets: one for each different endpoint of the scenario."""
        return self._endpoints

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        """Return the instant of the next tick, TIMESYNC request or delayed setpoint.

        After the run's end, None, or when parameters are restored.
        """
        if self.flight.ended:
            due = self.gate.restoration.due
            return None if due == NEVER else due
        soonest = min(self._next_tick, self._heartbeats.next_probe)
        return min(soonest, self._dispatch.due)

    def known_peers(self) -> frozenset[Address]:
        """Return the vehicles' addresses, as of the last tick."""
        return self._senders.peers(self._next_tick)

    def left_unread(self, octets: int) -> None:
        """Count what strangers sent and no one read."""
        self._flood.unread_bytes += octets

    def receive(self, datagrams: list[Datagram], now: Instant) -> None:
        """Take datagrams: pass their frames to their vehicles, and count the rest."""
        timed, raws = not self._was_away(now), list[bytes]()
        try:
            for datagram in datagrams:
                frame = self._receiver.first(datagram, now)
                while frame is not None:
                    raws.append(frame.raw)
                    vehicle = self._senders.sender(frame, datagram, now)
                    if vehicle is None:
                        self._take_other(frame, datagram, now)
                    elif vehicle.history.is_news:
                        self._take(vehicle, frame, now, timed)
                    else:
                        vehicle.overlook(frame)
                    frame = frame.following
        finally:
            self._several_links.see_by_those_in_use()
            self._recorder.frames(now, raws)

    def handle_timer(self, now: Instant) -> None:
        """Do what is due: TIMESYNC requests and delayed setpoints at any time, everything else at ticks."""
        if self.gate.restoration.due != NEVER:
            self._send_all(self.gate.restoration.requests(now), now)
        if self.flight.ended:
            return
        if self._was_away(now):
            for vehicle in self._each:
                vehicle.forget_requests(now)
                if seconds_between(self._next_tick, now) > ALONE_S:
                    vehicle.left_alone(now)
        if now >= self._heartbeats.next_probe:
            self._send_all(self._heartbeats.probes(now), now)
        if now >= self._next_tick:
            self.tick(now)
        self._send_all(self._dispatch.pop_due(now), now)

    def tick(self, now: Instant) -> None:
        """Run one control cycle: the stages of `core/stages.py`, and those of features between them."""
        self._schedule_tick(now)
        self.cycle.run(now, second=self._heartbeats.heartbeat_due(now))

    def _watch_strangers(self, now: Instant) -> None:
        self.signatures.report(now)
        self._out += self._greetings(now)
        self._flood.compare(now, self.received(), self.refused())

    def _was_away(self, now: Instant) -> bool:
        late = now - AWAY_NS
        overdue = late > self._next_tick or late > self._heartbeats.next_probe or late > self._dispatch.due
        return overdue and not self.flight.ended

    @property
    def commands_anybody(self) -> bool:
        """Whether any vehicle received is commanded: by a step of its start-up, in the formation, or at the end."""
        return commands_anybody(self.cycle)

    def each_link(self) -> Iterator[tuple[VehicleId, Link]]:
        """Yield each vehicle's links."""
        for identity, vehicle in self.vehicles.items():
            yield from ((identity, link) for link in vehicle.each_link)

    def bad_frames(self, identity: VehicleId) -> int:
        """Return the number of invalid frames from a vehicle's addresses."""
        return sum([self.bad_frames_of(link.connection) for link in self.vehicles[identity].each_link])

    def bad_frames_of(self, connection: Connection) -> int:
        """Return the number of invalid frames from the address of a vehicle's link."""
        return self._receiver.counts(connection.socket, connection.peer).bad

    def received(self) -> ParserCounts:
        """Return the counts of everything received, also from other senders."""
        return self._receiver.total() + ParserCounts(unread_bytes=self._flood.unread_bytes)

    def refused(self) -> int:
        """Return the number of valid frames that weren't accepted as any vehicle's, also for their signatures."""
        return self.frames_refused + self.signatures.frames_refused

    def _schedule_tick(self, now: Instant) -> None:
        """Schedule the next tick on the grid of ticks; missed ticks are skipped."""
        missed = max(0, math.floor(seconds_between(self._next_tick, now) / self._period_s))
        self._next_tick = after(self._next_tick, (missed + 1) * self._period_s)

    # Events and messages.

    def _log_event(
        self,
        now: Instant,
        kind: str,
        text: str,
        vehicle: Vehicle | None = None,
        details: Mapping[str, Detail] | None = None,
    ) -> None:
        """Record an event of a vehicle or the run: the `LogEvent` of all parts of the station."""
        self._recorder.event(Event(now, kind, text, vehicle.identity if vehicle else None, details or {}))

    def _log_link(self, vehicle: Vehicle, now: Instant) -> None:
        link = vehicle.connection
        if vehicle.links is not None:
            self._several_links.log_state(vehicle, link, now)
            return
        self._log_event(now, "link", link.state.value, vehicle, {"peer": str(link.peer)})

    def _greetings(self, now: Instant) -> list[Datagram]:
        """Return a heartbeat for everybody whose timestamps are behind: it tells how late it is."""
        signing, found = self.signatures.signing, list[Datagram]()
        if signing is not None:
            for socket, peer in signing.take_behind():
                raw = self._channels[socket].encode(HEARTBEAT)
                found.append(Datagram(socket, peer, signing.seal(socket, raw, now)))
        return found

    def _take(self, vehicle: Vehicle, frame: Frame, now: Instant, timed: bool) -> None:
        message = frame.message
        if isinstance(message, (Heartbeat, Statustext, Timesync)):
            self._take_word(vehicle, frame, now, timed)
        elif vehicle.receive(frame, now, timed=timed):
            self._log_link(vehicle, now)
        if isinstance(message, ParamValue):
            self.gate.receive_parameter(vehicle, message, now)
            self.gate.take_item(vehicle, message, now)
            self.cycle.beginning.receive_parameter(vehicle, message, now)
        elif isinstance(message, (MissionCount, MissionItemInt)):
            self.gate.take_item(vehicle, message, now)

    def _take_other(self, frame: Frame, datagram: Datagram, now: Instant) -> None:
        """Take a frame that is no vehicle's."""
        if not self.radio_reports.receive(frame, datagram, now):
            self.frames_refused += 1

    def _take_word(self, vehicle: Vehicle, frame: Frame, now: Instant, timed: bool) -> None:
        """Take a frame that may show another mode, a text or a restart, and record the change."""
        seen = vehicle.telemetry
        mode, texts = seen.custom_mode, seen.texts_reported
        if vehicle.receive(frame, now, timed=timed):
            self._log_link(vehicle, now)
        if seen.custom_mode != mode:
            self._log_event(now, "mode", vehicle.autopilot.mode_name(seen), vehicle)
        if seen.texts_reported != texts:
            self._log_event(now, "statustext", seen.texts[-1], vehicle)
            self._membership.receive(vehicle, seen.texts[-1], now)

    def _send_all(self, messages: list[tuple[Vehicle, Message]], now: Instant) -> None:
        raws, datagrams, signing = list[bytes](), list[Datagram](), self.signatures.signing
        for vehicle, message in messages:
            for link in vehicle.each_link if vehicle.links is None else receivers(vehicle, message):
                peer, socket = link.connection.peer, link.connection.socket
                if peer is None:
                    continue
                raw = self._channels[socket].encode(message)
                link.frames_out += 1
                vehicle.bytes_out += len(raw)
                raws.append(raw)
                if signing is not None:
                    raw = signing.seal(socket, raw, now)
                datagrams.append(Datagram(socket, peer, raw))
        if raws:
            self._recorder.frames(now, raws)
            self._out += datagrams
