"""One vehicle's state in the station: its link, telemetry, commands and start-up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import LONG_AGO, NANOSECONDS, NEVER, Instant, seconds_between
from airlink.endpoint import Address, VehicleId
from airlink.frame import Frame
from airlink.messages import KINDS, Message
from airlink.messages.command import CommandAck
from airlink.messages.system import CurrentMode, Heartbeat, SystemTime, Timesync
from airlink.messages.telemetry import Attitude, GlobalPositionInt, HomePosition
from flight_model.autopilot_model import FlightState, Setpoint
from gcs_formation.estimation.airspeed import AirspeedCheck
from gcs_formation.link.clock_by_command import ClockByCommand
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import TURN_S, FrameHistory
from gcs_formation.link.link_health import STALE_AFTER_S, Connection, JitterMeter, LinkState, SequenceTracker
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.source_binding import SourceBinding
from gcs_formation.link.vehicle_links import Link, Links, links_by
from gcs_formation.vehicle.autopilot_family import Autopilot, Command, StartUpStep
from gcs_formation.vehicle.command_delivery import (
    GAP_S,
    UNDER_WAY,
    CommandQueue,
    EffectWatch,
    Outcome,
    SetpointChannel,
)
from gcs_formation.vehicle.pilots_choice import PilotsChoice
from gcs_formation.vehicle.sampler import Sampler
from gcs_formation.vehicle.setpoint_delivery import SetpointDelivery
from gcs_formation.vehicle.startup import StartUp, TakeOff
from gcs_formation.vehicle.telemetry import Telemetry

ACCEPTED: Final = m.MAV_RESULT_ACCEPTED
UNANSWERED_S: Final = 1.5
"""Longest time without an answer from a vehicle that hears the ground station."""
UNANSWERED_PROBES: Final = 3.0
"""More of it, in periods of TIMESYNC requests that a full link makes rarer."""
JITTERS: Final = 10.0
"""A link without loss is never silent for longer than this multiple of its jitter."""
CLOCK_LIMIT_NS: Final = 2**62 - 1


class Member(Enum):
    """A vehicle's membership in the formation."""

    STARTING = "starting"
    FLYING = "flying in formation"
    PARTED = "parted by its pilot"
    UNHEARD = "not heard: told nothing until it is"
    HOLDING = "told to loiter"
    RETURNING = "told to come back"
    HOMEWARD = "sent home"


class SendingLimits:
    """What a full link leaves to a vehicle."""

    def __init__(self) -> None:
        """Start without any."""
        self.probe_s = 0.0
        """Shortest time between two TIMESYNC requests."""
        self.full = ""
        """What shows that its link is full, in words; empty if nothing does."""


CIRCLING: Final = (Member.HOLDING, Member.RETURNING)
"""Memberships in which a vehicle may be loitering as commanded."""


class Vehicle:
    """All state of one vehicle. It takes frames and encodes messages; the station transports them.

    Where it is heard, and what is measured there, is that of the link in use; while a frame is taken, of the link on
    which it came.
    """

    connection: Connection
    round_trips: RoundTrips
    clock: ClockSync
    source_binding: SourceBinding
    """Decides which of several senders with its id is the vehicle."""
    history: FrameHistory
    """Tells its news from copies and late frames."""
    jitter: JitterMeter
    sequence: SequenceTracker

    frames_lost_at: Instant = LONG_AGO
    """When frames of it were last missing."""
    holds_from: Instant = LONG_AGO
    """When it was last commanded to loiter while the others fly on."""

    def __init__(
        self,
        identity: VehicleId,
        column: int,
        autopilot: Autopilot,
        connection: Connection | Sequence[Connection],
        telemetry_rate_hz: float,
        *,
        by_utc: bool = False,
        airspeed_check: AirspeedCheck | None = None,
        setpoint_gap_s: float = GAP_S,
    ) -> None:
        """Start with a vehicle not heard yet; `by_utc`: its stamps are mapped by UTC once that is known.

        An `airspeed_check` decides whether a fixed wing's airspeeds are plausible. Acknowledgements of setpoints may
        come `setpoint_gap_s` late. Of several connections each is a link of its own.
        """
        self.identity, self.column, self.autopilot = identity, column, autopilot
        """Its id, and its index in every list of a tick."""
        connections = [connection] if isinstance(connection, Connection) else connection
        self.each_link = links_by(connections, autopilot.loop_s, by_utc=by_utc)
        self.links = Links(self.each_link) if len(self.each_link) > 1 else None
        """Which of them is in use; None if it has but one."""
        self._see(self.each_link[0])
        self.setpoints, self.limits, self.commands = (
            SetpointDelivery(autopilot, setpoint_gap_s),
            SendingLimits(),
            CommandQueue(),
        )
        self.stands_after_s, self.returns_after_s = autopilot.stands_after_s, autopilot.returns_after_s
        """Defaults of its autopilot family."""
        self.telemetry = Telemetry(autopilot.origin, autopilot.stands)
        self.sampler = Sampler(self.telemetry, autopilot, self.round_trips, self.source_binding, airspeed_check)
        """Turns its telemetry into samples of its present state."""
        self.messages_in = vec[i64]([0] * len(KINDS))
        """Number of messages received of each kind, indexed by `kind.place`."""
        self.unknown_in: dict[int, int] = {}  # number of messages of other kinds, by their ids
        self.start_up_hz = self.rates_hz = dict(autopilot.rates_hz(telemetry_rate_hz, utc=by_utc))
        """Rates of messages, Hz: those that its start-up asks for, or that come without a request, and those now."""
        self._at_last: tuple[StartUpStep, ...] = ()
        """Steps after those of its autopilot in each start-up."""
        self.start_up = self._started_afresh()
        # holds_at_m: the height at which it was last commanded to loiter while the others fly on; unfit: why its
        # telemetry can't be flown by in the formation, sent_home: why it is to fly home while they fly on, or empty
        self.member, self.holds_at_m, self.unfit, self.sent_home = Member.STARTING, math.nan, "", ""
        self.bytes_in, self.bytes_out, self._by_command = 0, 0, ClockByCommand()
        self.effects, self.pilots_choice, self.take_off = EffectWatch(), PilotsChoice(), TakeOff()
        self.restarts, self._flew_before = 0, False
        """Number of restarts of its clock; whether it may have been flying at the last one."""
        self.alone_at = LONG_AGO
        """When its failsafe last had reason to act, by the lack of setpoints, heartbeats or a link."""

    @property
    def setpoint_channels(self) -> list[SetpointChannel]:
        """The channels of airspeed, heading and height, which may be one; empty if setpoints aren't acknowledged."""
        return self.setpoints.channels

    @property
    def follows_setpoints(self) -> bool:
        """Whether it is ready, in the mode in which it follows setpoints, and no pilot has chosen another mode."""
        ready = self.start_up.finished and self.pilots_choice.mode is None
        return ready and self.autopilot.takes_setpoints(self.telemetry)

    def see(self, link: Link) -> None:
        """See it by one of its links: the one on which a frame came, or the one in use."""
        if link.connection is not self.connection:
            self._see(link)
            self.sampler.see(link.round_trips, link.source_binding)

    def _see(self, link: Link) -> None:
        self.connection, self.round_trips, self.clock = link.connection, link.round_trips, link.clock
        self.source_binding, self.history = link.source_binding, link.history
        self.jitter, self.sequence = link.jitter, link.sequence

    def try_port(self, socket: int, peer: Address, now: Instant) -> Links:
        """Try a link that isn't named; what comes there isn't taken before it has been shown to be the vehicle's."""
        if self.links is None:
            self.links = Links(self.each_link)
        self.links.try_port(socket, peer, now)
        return self.links

    def drop_port(self, link: Link) -> None:
        """Drop a link that was tried: it isn't the vehicle's."""
        self.each_link.remove(link)
        if len(self.each_link) == 1:
            self.links = None

    def take(self, frame: Frame, now: Instant, *, timed: bool = True) -> bool:
        """Take a frame of this vehicle's autopilot; return whether the link's state changed.

        `timed`: it was read on arrival; a frame that waited in our queue doesn't tell the link's delay.
        """
        message, sequence = frame.message, self.sequence
        if message is not None and self.history.copies_come(now) and not math.isnan(message.boot_s()):
            sequence.return_to(frame.sequence)
        if self.history.may_be_copy and not sequence.may_follow(frame.sequence, now, self.connection.last_heard):
            sequence.doubt(frame.sequence)
        elif sequence.observe(frame.sequence, now, self.connection.last_heard):
            self.setpoints.lost_at = self.frames_lost_at = now
        changed = self.connection.heard(now, heartbeat=isinstance(message, Heartbeat))
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
            self.telemetry.take(message)
        return changed

    def _is_old_or_unproven(self, frame: Frame, links: Links, now: Instant, *, timed: bool) -> bool:
        """Return whether a frame is no news, as one that another link has brought before; what it measures is taken."""
        message, link = frame.message, links.of(self.connection)
        self.sequence.silence = None  # how long the vehicle sent is known: other links may have brought it
        if isinstance(message, Timesync) or links.is_news(frame, link):
            return False
        self.bytes_in += len(frame.raw)
        if isinstance(message, GlobalPositionInt) and link.on_trial_since != NEVER:
            link.compare_position(self.telemetry.apart_m(message))
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
            self.messages_in[frame.message.kind().place] += 1

    def overlook(self, frame: Frame) -> None:
        """Count a frame of this vehicle that is no news."""
        copy = self.history.was_copy
        if not copy:
            self._count(frame)
        self.sequence.overtaken(frame.sequence, copy=copy)

    @property
    def frames_in(self) -> int:
        """Number of frames received from it."""
        return sum([int(each.sequence.received + each.sequence.repeated) for each in self.each_link])

    @property
    def frames_out(self) -> int:
        """Number of frames sent to it."""
        return sum([each.frames_out for each in self.each_link])

    def leave_to_pilot(self, now: Instant) -> None:
        """Send nothing more until its pilot has put it into the guided mode."""
        self.commands.begin((), now)
        wait = StartUpStep("left it to its pilot", self.autopilot.takes_setpoints, timeout_s=math.inf)
        self.start_up = StartUp((wait,), abandoned=True, left=True)

    @property
    def is_left(self) -> bool:
        """Whether it was left to its pilot, who hasn't handed it back yet."""
        return self.start_up.left and not self.start_up.finished

    @property
    def unanswered_s(self) -> float:
        """Time from its newest answer to its last frame, s."""
        return self.round_trips.unanswered_s(self.connection.last_heard)

    @property
    def hears(self) -> bool:
        """Whether it answers as often as it must if it hears the ground station; rarer requests are allowed for."""
        return self.unanswered_s <= UNANSWERED_S + UNANSWERED_PROBES * self.limits.probe_s

    @property
    def flies_on(self) -> bool:
        """Whether it flies in its guided mode, which isn't the mode in which it loiters."""
        autopilot = self.autopilot
        guided = self.telemetry.custom_mode == autopilot.guided_mode != autopilot.loiter_mode
        return self.airborne and guided

    def left_alone(self, now: Instant) -> None:
        """Record that setpoints, heartbeats or the link are missing, on which its failsafe may act."""
        self.alone_at = now

    def end_silence(self, at: Instant) -> None:
        """Count the frames missing since it was last heard as lost, if it flew and was silent beyond its jitter.

        A vehicle on the ground isn't counted: it may have been switched off. `at`: the end of the flight.
        """
        heard, jitter_s = self.connection.last_heard, self.jitter.jitter_s
        usual_s = STALE_AFTER_S + (0.0 if math.isnan(jitter_s) else JITTERS * jitter_s)
        if seconds_between(heard, at) >= usual_s and self.flew:
            self.sequence.break_off(heard, at)

    @property
    def airborne(self) -> bool:
        """Whether it flies, by its last telemetry; False after its link is lost."""
        return self.connection.state is not LinkState.LOST and self.flew

    @property
    def flew(self) -> bool:
        """Whether it was flying when last heard."""
        return self.autopilot.is_airborne(self.telemetry)

    @property
    def may_fly(self) -> bool:
        """Whether it isn't known to be on the ground.

        It flies; or it flew before a restart and hasn't reported since that it is grounded; or it is armed and doesn't
        report whether it flies; or it is above the ground without a heartbeat.
        """
        seen, autopilot = self.telemetry, self.autopilot
        if autopilot.is_airborne(seen) or autopilot.is_grounded(seen):
            return autopilot.is_airborne(seen)
        return self._flew_before or seen.aloft or (seen.armed and not autopilot.says_grounded(seen))

    @property
    def refusal(self) -> str:
        """The command under insistence that it refuses, with its answer; empty if there is none."""
        asked, answer = self.commands.under_way, self.commands.refused_with
        if asked is None or answer is None:
            return ""
        effect, name = self.autopilot.effect(asked), m.name_of("MAV_CMD", asked.command)
        result = f"{name}: {m.name_of('MAV_RESULT', answer)}"
        return result if effect is None else f"{effect.description} ({result})"

    @property
    def circles(self) -> bool:
        """Whether its mode is one in which it circles, or may be by its last command."""
        if self.telemetry.custom_mode == self.autopilot.circling_mode:
            return True
        return self.autopilot.circling_mode >= 0 and (self.member in CIRCLING or self.may_loiter)

    @property
    def may_loiter(self) -> bool:
        """Whether a vehicle that flies in the formation may still obey an earlier command to loiter.

        This holds until it acknowledges the mode in which it follows setpoints.
        """
        waiting = self.commands.insists and self.commands.outcome is Outcome.WAITING
        return waiting and self.member is Member.FLYING

    @property
    def flies_home_m(self) -> tuple[float, float] | None:
        """North and east of its home, m, if it is in the mode in which it flies there; None if not, or if unknown."""
        return self.telemetry.home_m if self.telemetry.custom_mode == self.autopilot.home_mode else None

    def new_setpoints(self, setpoint: Setpoint, where: FlightState, at: Instant) -> list[Message]:
        """Return the messages of a setpoint to send at an instant: those with news, and those that are due again.

        `where` is the vehicle's state when the setpoint takes effect. What it holds from then on is in `setpoints`.
        """
        if self.links is not None and at < self.links.drains_until:
            self.forget_setpoints()  # those sent before, on a slower link, may come after these
        round_trip_s = 0.0 if math.isnan(self.clock.one_way_s) else 2.0 * self.clock.one_way_s
        messages = self.setpoints.messages(setpoint, where, at, round_trip_s, self.stands_after_s)
        if self.setpoint_channels:
            self.sequence.asked += len(messages)
        return messages

    def forget_setpoints(self) -> None:
        """Send all setpoints again: the vehicle may have received others meanwhile."""
        self.autopilot.forget_setpoints()
        self.setpoints.forget()

    @property
    def home_unreported(self) -> bool:
        """Whether it has been armed for this flight but hasn't reported its home."""
        return self.member is not Member.STARTING and self.telemetry.armed and self.telemetry.home_m is None

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
            self.take_off.watch(self.telemetry)

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
        trips.hear(now)
        overtaken = self.history.copies_come(now) and answer.ts1_ns < trips.answered_to
        trips.answered_to = max(trips.answered_to, Instant(answer.ts1_ns))
        if timed and not overtaken:  # while copies come, one overtaken is the copy of an answer that was lost
            self._measure(answer, now)

    def _take_home(self, message: HomePosition, now: Instant, timed: bool) -> None:
        self.telemetry.take(message)
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
            self._begin_again()
        elif self.clock.samples == 1 and answer.tc1_ns > TURN_S * NANOSECONDS:
            self.jitter.forget()  # the first answer shows that earlier stamps had wrapped

    def _begin_again(self) -> None:
        """Take note that its clock has restarted: each link shows that, the one in use counts."""
        if self.links is None or self.connection is self.links.in_use.connection:
            self.restart()
        else:
            self._forget_numbers()

    def restart(self) -> None:
        """Start afresh after the vehicle's clock has restarted: earlier knowledge of it is void."""
        self.restarts += 1
        self._flew_before = self.may_fly
        self.telemetry.forget()
        self._forget_numbers()
        if self.links is not None:
            self.links.restart()
        self.effects = EffectWatch()
        self.take_off = TakeOff()
        self.forget_setpoints()
        self.rates_hz = self.start_up_hz
        self.start_up = self._started_afresh()

    def _forget_numbers(self) -> None:
        """Forget what a restart makes void of the link by which it is seen."""
        self.source_binding.refused_stamp_s = math.nan
        self.sequence.restart()
        self.history.restart()
        self.jitter.forget()

    def end_start_up_with(self, step: StartUpStep) -> None:
        """Add a last step to its start-up, and to that after each restart."""
        self._at_last = (step,)
        self.start_up.steps = (*self.start_up.steps, step)

    def _started_afresh(self) -> StartUp:
        return StartUp((*self.autopilot.start_up(self.start_up_hz), *self._at_last), self.autopilot.start_up_modes)

    def _acknowledged(self, ack: CommandAck, now: Instant) -> None:
        # Older autopilots, and MAVLink 1, don't say whom they answer (0).
        ours = self.autopilot.station
        if ack.target_system not in (0, ours.system) or ack.target_component not in (0, ours.component):
            return
        self.sequence.answers += 1
        self.round_trips.hear(now)
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
