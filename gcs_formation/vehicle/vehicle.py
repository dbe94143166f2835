"""One vehicle in the station: takes its frames, and encodes messages to it."""

from __future__ import annotations

import math
from typing import Final

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, NEVER, Instant, seconds_between
from airlink.frame import Frame
from airlink.messages import Message
from airlink.messages.command import CommandAck
from airlink.messages.system import CurrentMode, Heartbeat, SystemTime, Timesync
from airlink.messages.telemetry import Attitude, GlobalPositionInt, HomePosition
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.link.frame_history import TURN_S
from gcs_formation.link.frame_loss import STALE_AFTER_S
from gcs_formation.link.vehicle_links import Links
from gcs_formation.vehicle.command_delivery import (
    UNDER_WAY,
    EffectWatch,
    Outcome,
)
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.startup import StartUp, TakeOff
from gcs_formation.vehicle.startup_step import Command, StartUpStep
from gcs_formation.vehicle.vehicle_state import VehicleState

ACCEPTED: Final = m.MAV_RESULT_ACCEPTED
JITTERS: Final = 10.0
"""A link without loss is never silent for longer than this multiple of its jitter."""
CLOCK_LIMIT_NS: Final = 2**62 - 1


class Vehicle(VehicleState):
    """Takes a vehicle's frames, and encodes messages to it; the station transports them."""

    def leave_to_pilot(self, now: Instant) -> None:
        """Send nothing more until its pilot has put it into the guided mode."""
        self.commands.send((), now)
        self.start_up = self._left_to_pilot(())

    def _left_to_pilot(self, before: tuple[StartUpStep, ...]) -> StartUp:
        """Return the start-up that waits for the pilot; a family that needs a stream for its mode keeps it."""
        wait = StartUpStep("left it to its pilot", self.autopilot.takes_setpoints, timeout_s=math.inf)
        return StartUp((*before, wait), abandoned=True, left=True, acted=self.start_up.acted)

    def left_alone(self, now: Instant) -> None:
        """Record that setpoints, heartbeats or the link are missing, on which its failsafe may act."""
        self.alone_at = now

    def end_silence(self, at: Instant) -> None:
        """Count the frames missing since it was last received as lost, if it flew and was silent beyond its jitter.

        A vehicle on the ground isn't counted: it may have been switched off. `at`: the end of the flight.
        """
        last, jitter_s = self.connection.last_received, self.jitter.jitter_s
        usual_s = STALE_AFTER_S + (0.0 if math.isnan(jitter_s) else JITTERS * jitter_s)
        if seconds_between(last, at) >= usual_s and self.flew:
            self.sequence.break_off(last, at)

    def receive(self, frame: Frame, now: Instant, *, timed: bool = True) -> bool:
        """Take a frame of this vehicle's autopilot; return whether the link's state changed.

        `timed`: it was read on arrival; a frame that waited in our queue doesn't tell the link's delay.
        """
        message, sequence = frame.message, self.sequence
        if message is not None and self.history.copies_come(now) and not math.isnan(message.boot_s()):
            sequence.return_to(frame.sequence)
        if self.history.may_be_copy and not sequence.may_follow(frame.sequence, now, self.connection.last_received):
            sequence.doubt(frame.sequence)
        elif sequence.observe(frame.sequence, now, self.connection.last_received):
            self.setpoints.lost_at = self.frames_lost_at = now
            self.connection.skipped(now)
        changed = self.connection.record_frame(now, heartbeat=isinstance(message, Heartbeat))
        turned_s = self.source_binding.turned_s
        if turned_s and isinstance(message, (GlobalPositionInt, Attitude, SystemTime)):
            message.time_boot_s += turned_s
        if self.links is not None and self._is_old_or_unproven(frame, self.links, now, timed=timed):
            return changed
        self._count(frame)
        if isinstance(message, GlobalPositionInt):
            self._take_position(message, now, timed)
        elif isinstance(message, CommandAck):
            self._acknowledged(message, now)
        elif isinstance(message, Timesync):
            self._take_probe(message, now, timed)
        elif isinstance(message, SystemTime):
            self._take_utc(message)
        elif isinstance(message, (CurrentMode, HomePosition)):
            self._take_seldom(message, now, timed)
        elif isinstance(message, Heartbeat):
            self._take_heartbeat(message, now)
        elif message is not None:
            self.telemetry.store(message)
        return changed

    def _is_old_or_unproven(self, frame: Frame, links: Links, now: Instant, *, timed: bool) -> bool:
        """Return whether a frame is no news, as one that another link has brought before; what it measures is taken."""
        message, link = frame.message, links.of(self.connection)
        self.sequence.silence = None  # how long the vehicle sent is known: other links may have brought it
        if isinstance(message, Timesync) or links.is_news(frame, link):
            return False
        self.bytes_in += len(frame.raw)
        if isinstance(message, GlobalPositionInt) and link.on_trial_since != NEVER:
            link.compare_position(self.telemetry.separation_m(message))
        if isinstance(message, GlobalPositionInt) and timed:
            self.jitter.observe(message.time_boot_s, now, self.clock.drift)
        elif isinstance(message, SystemTime):
            self._take_utc(message)
        return True

    def _count(self, frame: Frame) -> None:
        self.bytes_in += len(frame.raw)
        if frame.message is None:
            self.unknown_in[frame.message_id] = self.unknown_in.get(frame.message_id, 0) + 1
        else:
            self.messages_in[frame.message.kind().index] += 1

    def overlook(self, frame: Frame) -> None:
        """Count a frame of this vehicle that is no news."""
        copy = self.history.was_copy
        if not copy:
            self._count(frame)
        self.sequence.overtaken(frame.sequence, copy=copy)

    def new_setpoints(self, setpoint: Setpoint, where: FlightState, at: Instant) -> list[Message]:
        """Return the messages of a setpoint to send at an instant: those with news, and those that are due again.

        `where` is the vehicle's state when the setpoint takes effect. What it holds from then on is in `setpoints`.
        """
        if self.links is not None and at < self.links.drains_until:
            self.forget_setpoints()  # those sent before, on a slower link, may come after these
        round_trip_s = 0.0 if math.isnan(self.clock.one_way_s) else 2.0 * self.clock.one_way_s
        messages = self.setpoints.messages(setpoint, where, at, round_trip_s, self.hovers_after_s)
        if self.setpoint_channels:
            self.sequence.asked += len(messages)
        return messages

    def forget_setpoints(self) -> None:
        """Send all setpoints again: the vehicle may have received others meanwhile."""
        self.autopilot.forget_setpoints()
        self.setpoints.invalidate()

    def ask(self, request: Command) -> Command:
        """Return a request whose answer isn't awaited, and count it."""
        self.sequence.asked += 1
        return request

    def probe(self, now: Instant) -> Message:
        """Return a TIMESYNC request, which goes out on each of its links, and count it.

        Of a vehicle that answers none, a command whose answer tells its time.
        """
        if self.links is None and self.autopilot.tells_time_with_home and self._by_command.asks(self.round_trips, now):
            return self.ask(self.autopilot.home_request())
        for link in self.each_link[1:]:
            link.sequence.asked += 1
            link.round_trips.request(now, self.identity.system)
        first = self.each_link[0]
        first.sequence.asked += 1
        return first.round_trips.request(now, self.identity.system)

    def forget_requests(self, now: Instant) -> None:
        """Drop pending TIMESYNC requests, whose answers have waited here."""
        for link in self.each_link:
            link.round_trips.forget_requests(now)

    def _take_position(self, message: GlobalPositionInt, now: Instant, timed: bool) -> None:
        motion, sequence = self.telemetry.motion, self.sequence
        if motion is not None and sequence.silence is not None:
            sequence.sent_for(message.time_boot_s - motion.stamp_s)
        self.telemetry.take_position(message)
        if timed:
            self.jitter.observe(message.time_boot_s, now, self.clock.drift)
            self.take_off.update_position(self.telemetry)

    def _take_utc(self, message: SystemTime) -> None:
        gnss = self.round_trips.gnss
        if gnss is not None:
            gnss.utc(message.time_unix_usec * 1e-6, message.time_boot_s, armed=self.telemetry.armed)

    def _take_heartbeat(self, message: Heartbeat, now: Instant) -> None:
        if message.custom_mode != self.telemetry.custom_mode:
            for channel in self.setpoints.channels:
                channel.retry()
        self.telemetry.take_heartbeat(message)
        commands, autopilot = self.commands, self.autopilot
        command = commands.under_way if commands.insists else None
        effect = None if command is None else autopilot.effect(command)
        if command is not None and effect is not None:
            shown = effect.shown(self.telemetry) == effect.expected
            commands.take_heartbeat(shown=shown, known=autopilot.mode_asked(command) == autopilot.guided_mode, now=now)

    def _take_seldom(self, message: CurrentMode | HomePosition, now: Instant, timed: bool) -> None:
        if isinstance(message, HomePosition):
            self._take_home(message, now, timed)
        elif not self.autopilot.setpoints_set_mode:
            self.telemetry.custom_mode = message.custom_mode
        elif self.member is Member.FLYING:
            self.pilots_choice.see(message.custom_mode, self.autopilot.guided_mode, self.telemetry)

    def _is_of_other_link(self, ack: CommandAck) -> bool:
        """Return whether an acknowledgement is of a request that went out on every link, and not by the one in use."""
        links = self.links
        elsewhere = links is not None and self.connection is not links.in_use.connection
        return elsewhere and ack.command == m.MAV_CMD_SET_MESSAGE_INTERVAL

    def _mode_is_missing(self) -> bool:
        """Return whether an awaited change of mode hasn't happened, although it may have been acknowledged early."""
        command = self.commands.under_way
        if command is None or not self.autopilot.acknowledges_early:
            return False
        asked = self.autopilot.mode_asked(command)
        return asked is not None and asked != self.telemetry.custom_mode

    def _take_probe(self, answer: Timesync, now: Instant, timed: bool) -> None:
        """Take the answer to one of our TIMESYNC requests; ignore requests, and answers to others."""
        if not answer.tc1_ns:
            return
        self.sequence.answers += 1
        if not self.round_trips.is_answer(answer):
            return
        trips = self.round_trips
        trips.record_answer(now)
        overtaken = self.history.copies_come(now) and answer.ts1_ns < trips.answered_to
        trips.answered_to = max(trips.answered_to, Instant(answer.ts1_ns))
        if timed and not overtaken:  # while copies come, one overtaken is the copy of an answer that was lost
            self._measure(answer, now)

    def _take_home(self, message: HomePosition, now: Instant, timed: bool) -> None:
        self.telemetry.store(message)
        if timed and self.autopilot.tells_time_with_home:
            self._by_command.tell(message.time_usec * 1000, now)
            self._measure_by_command()

    def _measure_by_command(self) -> None:
        """Take the answer to a command that tells its time, if it is complete."""
        found = self._by_command.take_answer()
        if found is not None:
            self._measure(*found)

    def _measure(self, answer: Timesync, now: Instant) -> None:
        """Take its time and the round trip of an answer that arrived at `now`."""
        if not 0 < answer.tc1_ns <= CLOCK_LIMIT_NS:
            self.telemetry.implausible += 1
        elif self.source_binding.accepts(answer.tc1_ns / NANOSECONDS, now) and self.round_trips.measure(answer, now):
            self._begin_again(Instant(now - answer.tc1_ns))
        elif self.clock.samples == 1 and answer.tc1_ns > TURN_S * NANOSECONDS:
            self.jitter.drop_sample()  # the first answer shows that earlier stamps had wrapped

    def _begin_again(self, booted: Instant) -> None:
        """Take note that its clock has restarted: each link shows that, the one in use counts."""
        if self.links is None or self.connection is self.links.in_use.connection:
            self.restart(booted)
        else:
            self._forget_numbers()

    def restart(self, booted: Instant) -> None:
        """Start afresh after the vehicle's clock has begun again at `booted`: earlier knowledge of it is void.

        But whom a pilot had by then stays the pilot's, and is requested telemetry alone. That it is to fly home isn't
        knowledge of it either but our decision. It holds while it may fly: no battery is filled in the air, but what
        the autopilot reports of one may begin again at full. On the ground it may get another.
        """
        was_pilots = self.is_left or (self.member is Member.PARTED and self.member_since < booted)
        self.restarts += 1
        self._flew_before = self.may_fly
        if not self._flew_before:
            self.sent_home = ""
        self.telemetry.invalidate()
        self.sampler.restart()
        self._forget_numbers()
        if self.links is not None:
            self.links.restart()
        self.effects = EffectWatch()
        self.take_off = TakeOff()
        self.forget_setpoints()
        self.rates_hz = self.start_up_hz
        self.start_up = self._left_to_pilot(self._requests()) if was_pilots else self._started_afresh()

    def _requests(self) -> tuple[StartUpStep, ...]:
        """Return the steps of its start-up that request telemetry."""
        return tuple([each for each in self._started_afresh().steps if each.every_command_acknowledged])

    def _forget_numbers(self) -> None:
        """Forget what a restart makes void of the link by which it is seen."""
        self.source_binding.refused_stamp_s = math.nan
        self.sequence.restart()
        self.history.restart()
        self.jitter.drop_sample()

    def end_start_up_with(self, step: StartUpStep) -> None:
        """Add a last step to its start-up, and to that after each restart."""
        self._at_last = (step,)
        self.start_up.steps = (*self.start_up.steps, step)

    def _acknowledged(self, ack: CommandAck, now: Instant) -> None:
        # Older autopilots, and MAVLink 1, don't say whom they answer (0).
        ours = self.autopilot.station
        if ack.target_system not in (0, ours.system) or ack.target_component not in (0, ours.component):
            return
        self.sequence.answers += 1
        self.round_trips.record_answer(now)
        if self._is_of_other_link(ack):
            return
        if ack.command == m.MAV_CMD_REQUEST_MESSAGE and ack.result == ACCEPTED:
            self._by_command.acknowledged(now)
            self._measure_by_command()
        if self.commands.outcome is Outcome.WAITING:
            accepted = self.commands.acknowledge(ack, now, early=self._mode_is_missing())
            effect = self.autopilot.effect(accepted) if accepted is not None else None
            if effect is not None:
                self.effects.acknowledged(effect, self.telemetry, now)
        channel = self.setpoints.channel(ack.command)
        if channel is None:
            return
        if ack.result == ACCEPTED:
            channel.acknowledged(now)
        elif ack.result != UNDER_WAY:
            channel.refused(ack.result, self.telemetry.heartbeats, now)
