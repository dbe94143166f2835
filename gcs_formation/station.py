"""The ground station: an engine that determines the order of all steps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airlink.clock import NANOSECONDS, Instant, after, seconds_between
from airlink.endpoint import Address, Endpoint, VehicleId
from airlink.engine import Datagram, Engine
from airlink.frame import Frame, FrameWriter, ParserCounts
from airlink.messages import Message
from airlink.messages.command import ParamValue
from airlink.messages.system import Heartbeat, Statustext, Timesync
from airlink.signing.signed_links import SignedLinks, receiver_of
from flight_model.autopilot_model import FlightState
from formation_scenario import Scenario
from gcs_formation.budget.link_budget import link_budget
from gcs_formation.controller import FormationController
from gcs_formation.errors import NotFiniteError
from gcs_formation.estimation.estimator import Sample
from gcs_formation.fleet.common_clock import CommonClock
from gcs_formation.fleet.conformance import ConformanceMonitor
from gcs_formation.fleet.down_watch import DownWatch
from gcs_formation.fleet.margin_watch import DesignWatch, MarginWatch
from gcs_formation.fleet.membership_and_succession import Membership
from gcs_formation.fleet.pilots_and_fence import PilotsAndFence
from gcs_formation.fleet.routing_and_dispatch import HEARTBEAT, Dispatch, FloodWatch, HeartbeatScheduler, Senders
from gcs_formation.fleet.signature_watch import SignatureWatch
from gcs_formation.fleet.stream_loss import stream_losses
from gcs_formation.fleet.telemetry_watch import MessageIntervals, TelemetryWatch
from gcs_formation.from_scenario import as_known, narrow_links, planned
from gcs_formation.link.link_health import LinkState
from gcs_formation.link.radio_reports import RadioReports
from gcs_formation.mission.course import Course, Orders
from gcs_formation.mission.reconfiguration import Reconfiguration
from gcs_formation.mission.resumption import WAIT_S, Resumption, Takeover
from gcs_formation.mission.starting import UNCHECKED, PreFlight, PreFlightOptions, Starting
from gcs_formation.phases import COMMANDED, OVER, Cause, Phase
from gcs_formation.recorder import Detail, Event, Recorder, Tick
from gcs_formation.telemetry_health.monitor import TelemetryHealth
from gcs_formation.vehicle.vehicle import Vehicle

AWAY_NS: Final = NANOSECONDS // 5
"""A timer overdue by more than this means that the station was held up and datagrams have waited in its queue."""
ALONE_S: Final = 1.0
"""Longest hold-up of the station without effect on failsafes, such as PX4's on missing setpoints."""


class Station(Engine):
    """Flies one scenario. It reads no clock and opens no socket; its record goes to the recorder."""

    newest: Tick | None = None
    """The last tick that was recorded."""

    def __init__(
        self,
        scenario: Scenario,
        recorder: Recorder,
        until_s: float | None = None,
        utc_at_0_s: float | None = None,
        caution: PreFlightOptions = UNCHECKED,
        resumed: Resumption | None = None,
        signing: SignedLinks | None = None,
    ) -> None:
        """Prepare a flight; nothing happens before the first timer. `until_s`: mission time at which to end early.

        `utc_at_0_s` is UTC at instant 0, s since 1970, if the machine's clock is set to it; `caution`: checks before
        the first command; `resumed`: the flight to resume; `signing`: the links' keys, if any has one.
        """
        stated, narrow, scenario = scenario, narrow_links(scenario), as_known(scenario)
        self.scenario, self.controller = scenario, FormationController(scenario)
        self.controlled_ticks = self.recorded_ticks = self.frames_refused = 0
        """Ticks at which the formation was commanded; all recorded ticks since the first take-off; valid frames that
        weren't accepted as any vehicle's."""
        self.last_tick: Tick | None = None
        self._recorder, self._receiver, self._until_s = (
            recorder,
            receiver_of(signing),
            math.inf if until_s is None else until_s,
        )
        self._endpoints, self.networks, self.vehicles = planned(scenario)
        # A socket is one of MAVLink's channels, and frames are numbered by channel (guide, "Packet Serialization").
        self._channels = [FrameWriter(*scenario.station.ids) for _ in self._endpoints]
        note, fleet = self._note, (self.vehicles, self._note)
        membership, self._dispatch = Membership(scenario, *fleet), Dispatch(scenario, self.vehicles)
        self.preflight = PreFlight(scenario, self.vehicles, caution, note, self._fail)
        self.course = Course(scenario, self.controller, membership, self._dispatch, *fleet, self.preflight)
        self.flight, self._membership, self.margins = self.course.flight, membership, MarginWatch(scenario, *fleet)
        self._senders = Senders(self.vehicles, self.networks, self.flight, note, self.course.fail, scenario.station.ids)
        self._flood, self._telemetry, self.down, self.signatures = (
            FloodWatch(note),
            TelemetryWatch(*fleet),
            DownWatch(self.vehicles),
            SignatureWatch(signing, self._receiver, self.networks, *fleet),
        )
        self.radio_reports, self._pilots_and_fence, self._health = (
            RadioReports((each.connection for each in self.vehicles.values()), self.signatures.is_open),
            PilotsAndFence(scenario, *fleet),
            TelemetryHealth(self.vehicles, self.controller.estimator.filters, self.controller.models, note),
        )
        self.design = DesignWatch(scenario, self.vehicles, (self.controller.retune, self.margins.retune), note)
        self._common_clock, self._takeover = CommonClock(self.vehicles, utc_at_0_s, note), Takeover(resumed, *fleet)
        self._starting = Starting(
            self.vehicles,
            self._endpoints,
            self.flight,
            self.preflight,
            self._takeover,
            note,
            self.course.fail,
            together=scenario.hovers and not scenario.start.in_air and resumed is None,
        )
        self._reconfiguration = Reconfiguration(scenario, self.controller, *fleet)
        self.orders = Orders(scenario, self.course, self._reconfiguration, note)
        self._heartbeats, self._message_intervals = (
            HeartbeatScheduler(*fleet, narrow, self.radio_reports),
            MessageIntervals(*fleet),
        )
        self.budget = link_budget(stated, *fleet, self.radio_reports, self._heartbeats)
        self._conformance, self.losses = (
            ConformanceMonitor(scenario, self.controller, *fleet),
            stream_losses(self.vehicles),
        )
        self._each, self._period_s = list(self.vehicles.values()), 1.0 / scenario.law.rate_hz
        # _restarts: how many restarts of each vehicle have been handled
        self._out, self._next_tick, self._restarts = list[Datagram](), Instant(0), [0] * len(self._each)
        if resumed is not None:
            self._resume(resumed)

    def _resume(self, resumed: Resumption) -> None:
        self.flight.resume(resumed.at, resumed.path_began)
        self._heartbeats.resume(resumed.at)
        self._next_tick = resumed.at
        self._reconfiguration.resume(resumed)
        self.orders.resume(resumed.mission_s)

    # The engine's interface.

    def endpoints(self) -> tuple[Endpoint, ...]:
        """Return the sockets: one for each different endpoint of the scenario."""
        return self._endpoints

    def datagrams_to_send(self) -> list[Datagram]:
        """Remove and return the datagrams to send now."""
        out, self._out = self._out, []
        return out

    def next_timer(self) -> Instant | None:
        """Return the instant of the next tick, TIMESYNC request or delayed setpoint; None after the run's end."""
        if self.flight.ended:
            return None
        soonest = min(self._next_tick, self._heartbeats.next_probe)
        return min(soonest, self._dispatch.due)

    def known_peers(self) -> frozenset[Address]:
        """Return the vehicles' addresses, as of the last tick."""
        return self._senders.peers(self._next_tick)

    def left_unread(self, octets: int) -> None:
        """Count what strangers sent and nobody read."""
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
            self._recorder.frames(now, raws)

    def handle_timer(self, now: Instant) -> None:
        """Do what is due: TIMESYNC requests and delayed setpoints at any time, everything else at ticks."""
        if self._was_away(now):
            for vehicle in self._each:
                vehicle.round_trips.forget_requests(now)
                if seconds_between(self._next_tick, now) > ALONE_S:
                    vehicle.left_alone(now)
        if now >= self._heartbeats.next_probe:
            self._send_all(self._heartbeats.probes(now), now)
        if now >= self._next_tick:
            self.tick(now)
        self._send_all(self._dispatch.pop_due(now), now)

    # A tick, in the order of its steps.

    def tick(self, now: Instant) -> None:
        """Run one tick: links, start-up, membership, setpoints, record."""
        self._schedule_tick(now)
        if self._heartbeats.heartbeat_due(now):
            self._watch_slowly(now)
            unguided = self._dispatch.unguided(now)
            self._send_all(self._heartbeats.heartbeats(self.flight.mission_time_s(now), unguided, now), now)
        self._common_clock.watch(now)
        self._watch_links(now)
        self._start_vehicles(now)
        self._send_commands(now)
        self._take_samples(now)
        if self.flight.phase is not Phase.LOITERING:
            self._judge_members(now)
            self._message_intervals.watch(now)
        self._conformance.judge_commands(now)
        self._conformance.judge_answers(now)
        self._conformance.judge_refusals(now)
        self._conformance.judge_silence(now)
        if self.flight.phase in COMMANDED:
            self._fly(now)
        else:
            self._conformance.stand_down()
            self._look_on(now)
        self._send_all(self._dispatch.stand_ins(now), now)
        if self.flight.phase in OVER:
            self.course.bring_to_end(now)

    def _watch_slowly(self, now: Instant) -> None:
        """Watch what changes slowly, once a second."""
        if self.flight.phase in COMMANDED:
            self.design.watch(now)
        self._watch_parts(now)
        self._send_all(self.budget.watch(now, self.margins.used), now)
        self._telemetry.watch_noise(now, [each.noise for each in self.controller.estimator.filters])
        self._telemetry.watch_airspeeds(now)
        for each in self.losses.values():
            each.watch()
        if self.flight.phase not in OVER and not self.flight.ended:
            all_down = self.down.watch(now)
            if all_down is not None:
                self.course.fail(all_down, now)
        self.signatures.watch(now)
        self._out += self._greetings(now)
        self._flood.watch(now, self.received(), self.refused())
        self._pilots_and_fence.watch(now)

    def _watch_parts(self, now: Instant) -> None:
        """Watch what vehicles have from outside, and delay margins, which a law may fail to state."""
        for each in self._each:
            own = each.round_trips.own
            failure = each.autopilot.failure if own is None else own.failure or each.autopilot.failure
            if failure is not None:
                self.course.fail_by(failure, now, begun=self.commands_anybody)
        try:
            self.margins.watch(now, self._reconfiguration.leader, self.controller.lags.misfit)
        except NotFiniteError as error:
            self.controller.fault = self.controller.fault or error

    def _was_away(self, now: Instant) -> bool:
        late = now - AWAY_NS
        overdue = late > self._next_tick or late > self._heartbeats.next_probe or late > self._dispatch.due
        return overdue and not self.flight.ended

    def _judge_members(self, now: Instant) -> None:
        """Decide which vehicles fly in the formation, and which one succeeds a lost leader."""
        changes, estimator, leader = self._reconfiguration, self.controller.estimator, self._reconfiguration.leader
        connecting, beyond = self.flight.phase is Phase.CONNECTING, self.margins.beyond
        sinking = self._conformance.sinking

        def replaceable() -> bool:
            return changes.successor(sinking, now) is not None

        if leader and not connecting:
            sinks = leader.identity in sinking
            if self._membership.leader_lost(leader, estimator, now, replaceable, beyond, sinks=sinks):
                changes.succeed(sinking, now)
        self._membership.judge(changes.leader, estimator, now, connecting=connecting, beyond=beyond)

    @property
    def commands_anybody(self) -> bool:
        """Whether any vehicle heard is commanded: by a step of its start-up, in the formation, or at the end."""
        commands = self.flight.phase in COMMANDED or self.flight.phase is Phase.LOITERING
        heard = (each for each in self._each if each.connection.state is not LinkState.SEARCHING)
        return any(commands or each.start_up.acted for each in heard)

    def bad_frames(self, identity: VehicleId) -> int:
        """Return the number of invalid frames from a vehicle's address."""
        connection = self.vehicles[identity].connection
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

    def _watch_links(self, now: Instant) -> None:
        for vehicle in self._each:
            link = vehicle.connection
            if not link.in_order(now) and link.check(now, vehicle.sequence.loss):
                self._note_link(vehicle, now)

    def _start_vehicles(self, now: Instant) -> None:
        for place, vehicle in enumerate(self._each):
            if vehicle.restarts > self._restarts[place]:
                self._restarts[place] = vehicle.restarts
                self.controller.estimator.forget(vehicle.column)
                self._health.forget(vehicle.column)
                self._note(now, "restarted", "its clock has begun anew", vehicle)
        self._send_all(self.preflight.requests(now), now)
        self.preflight.watch()
        self._starting.advance(now)
        if self.preflight.rehearsed:
            self.course.end_rehearsal(now)
        if self.flight.phase is Phase.CONNECTING:
            self._begin(now)

    def _begin(self, now: Instant) -> None:
        """Begin to command the formation if its leader follows setpoints; a flight resumed while ending is ended."""
        takeover, resumed = self._takeover, self._takeover.resumed
        leads, reason = self._has_leader(now) and self.preflight.passed, takeover.failure(now)
        if reason is not None:
            self.course.fail(reason, now, begun=takeover.took_any)
        elif resumed is not None and resumed.ending:
            if takeover.settled(now) and (leads or takeover.waited(now, 2.0 * WAIT_S)):
                if leads:
                    self.course.move(Cause.LEADER_READY, now)
                self.course.stop(now)
        elif leads and self.course.move(Cause.LEADER_READY, now):
            self.design.watch(now, begins=True)

    def _has_leader(self, now: Instant) -> bool:
        """Return whether the leader follows setpoints; in a resumed flight, let another vehicle lead if needed."""
        resumed = self._takeover.resumed
        if resumed is None or not resumed.near:
            return self._starting.leader_ready(self.scenario.leader)
        leader = self._takeover.leader(now)
        if leader is not None:
            self._reconfiguration.lead(leader, now)
        return leader is not None

    def _send_commands(self, now: Instant) -> None:
        commands = list[tuple[Vehicle, Message]]()
        for vehicle in self._each:
            command = vehicle.commands.due(now)
            if command is not None:
                commands.append((vehicle, command))
        self._send_all(commands, now)

    def _take_samples(self, now: Instant) -> None:
        """Take new samples before vehicles are judged by their age, in case the station was held up."""
        if self.flight.phase not in COMMANDED:
            return
        samples: list[Sample | None] = [None] * self.controller.columns
        leader, commanded = self.controller.plan.leader, self.last_tick
        for vehicle in self._each:
            column = vehicle.column
            leads = column == leader
            reported = vehicle.sampler.new(now, flew=vehicle.flew, leads=leads)
            height_m = math.nan if commanded is None or not commanded.active[column] else commanded.setpoints[column][2]
            samples[column] = self._health.examine(column, reported, height_m, now, leads=leads)
        self.controller.take(samples)

    def _fly(self, now: Instant) -> None:
        controller = self.controller
        late = self.course.waited_long_enough(self.last_tick, now)
        mission_s = self.flight.mission_time_s(now)
        opening = self.course.opening
        self.orders.advance(now)
        if opening is None:
            self._reconfiguration.advance(now, mission_s)
        links, hold_s = self._dispatch.links(controller.plan.leader, self._conformance.doubted, now)
        for number, each in self.losses.items():
            if self.vehicles[number].column == controller.plan.leader:
                links[controller.plan.leader].loss = each.loss
        heights_m = None if opening is None else opening.steer(links, now)
        phase, used, shares = self.flight.phase, self.margins.used, self.margins.bandwidth
        tick = controller.step(
            now, mission_s, phase.value, links, used, shares, begin_regardless=late, heights_m=heights_m
        )
        self._dispatch.take(tick, hold_s, now)
        controller.history.note(self._dispatch.held(tick))
        self.last_tick = tick
        self._record(tick)
        self._conformance.judge_motion(tick, now)
        for event in tick.events:
            self._recorder.event(event)
        self.controlled_ticks += 1
        if controller.fault is not None:
            self.course.fail_by(controller.fault, now)
        begins = phase is Phase.ASSEMBLING and controller.guidance.started
        over = mission_s >= self.scenario.duration_s  # possible for a resumed flight; False before the path (NaN)
        if begins and not over and self.course.move(Cause.PATH_BEGUN, now):
            self._heartbeats.hasten(now)
        if opening is None:
            self.course.end_in_time(self._until_s, now)
        elif opening.over(now):
            self.course.move(Cause.OPENED, now)

    def _look_on(self, now: Instant) -> None:
        """Record the vehicles' states while none is commanded, once one has taken off."""
        if self.flight.ended:
            return
        self.orders.advance(now)
        if not self.recorded_ticks and not any(vehicle.airborne for vehicle in self.vehicles.values()):
            return
        links, _ = self._dispatch.links(self.controller.plan.leader, self._conformance.doubted, now)
        seen = dict[int, tuple[FlightState, float]]()
        for vehicle in self._each:
            found = vehicle.sampler.extrapolated(now)
            if found is not None:
                seen[vehicle.column] = found
        mission_s, phase = self.flight.mission_time_s(now), self.flight.phase.value
        self._record(self.controller.look_on(now, mission_s, phase, links, seen))

    def _record(self, tick: Tick) -> None:
        self._recorder.tick(tick)
        self.newest = tick
        self.recorded_ticks += 1

    # Events and messages.

    def _note(
        self,
        now: Instant,
        kind: str,
        text: str,
        vehicle: Vehicle | None = None,
        details: Mapping[str, Detail] | None = None,
    ) -> None:
        """Record an event of a vehicle or the run: the `Note` of all parts of the station."""
        self._recorder.event(Event(now, kind, text, vehicle.identity if vehicle else None, details or {}))

    def _fail(self, text: str, now: Instant) -> None:
        """End the run: the `GiveUp` of parts created before `course`."""
        self.course.fail(text, now)

    def _note_link(self, vehicle: Vehicle, now: Instant) -> None:
        link = vehicle.connection
        self._note(now, "link", link.state.value, vehicle, {"peer": str(link.peer)})

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
        elif vehicle.take(frame, now, timed=timed):
            self._note_link(vehicle, now)
        if isinstance(message, ParamValue):
            self.preflight.take(vehicle, message, now)

    def _take_other(self, frame: Frame, datagram: Datagram, now: Instant) -> None:
        """Take a frame that is no vehicle's."""
        if not self.radio_reports.take(frame, datagram, now):
            self.frames_refused += 1

    def _take_word(self, vehicle: Vehicle, frame: Frame, now: Instant, timed: bool) -> None:
        """Take a frame that may show another mode, a text or a restart, and record the change."""
        seen = vehicle.telemetry
        mode, texts = seen.custom_mode, seen.texts_reported
        if vehicle.take(frame, now, timed=timed):
            self._note_link(vehicle, now)
        if seen.custom_mode != mode:
            self._note(now, "mode", vehicle.autopilot.mode_name(seen), vehicle)
        if seen.texts_reported != texts:
            self._note(now, "statustext", seen.texts[-1], vehicle)
            self._membership.hear(vehicle, seen.texts[-1], now)

    def _send_all(self, messages: list[tuple[Vehicle, Message]], now: Instant) -> None:
        raws, datagrams, signing = list[bytes](), list[Datagram](), self.signatures.signing
        for vehicle, message in messages:
            peer = vehicle.connection.peer
            if peer is not None:
                socket = vehicle.connection.socket
                raw = self._channels[socket].encode(message)
                vehicle.frames_out += 1
                vehicle.bytes_out += len(raw)
                raws.append(raw)
                if signing is not None:
                    raw = signing.seal(socket, raw, now)
                datagrams.append(Datagram(socket, peer, raw))
        if raws:
            self._recorder.frames(now, raws)
            self._out += datagrams
