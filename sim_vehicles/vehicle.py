"""One emulated vehicle's side of the protocol: frames in, frames out, in the cycles of its main loop."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, assert_never

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.engine import Datagram
from airlink.frame import Frame
from airlink.messages import MISSION_TIME, Message
from airlink.messages.command import (
    CommandAck,
    CommandInt,
    CommandLong,
    LogEntry,
    LogRequestList,
    RequestDataStream,
    SetMode,
)
from airlink.messages.mission import MissionAck, MissionItem, MissionItemInt
from airlink.messages.system import Heartbeat, NamedValueFloat, Statustext, Timesync
from formation_scenario.surroundings import DEFAULT_MODE, Fault
from sim_vehicles.airframe.motion import Estimate, Motion, Steering
from sim_vehicles.airframe.sensors import sensors_of
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.board_clock import BoardClock
from sim_vehicles.autopilot.missions import Missions, Sender, home_of
from sim_vehicles.autopilot.modes_and_failsafe import FailsafeKeys, FlightMode, GroundStationFailsafe, Request
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.autopilot.telemetry import BUILDERS, Builders, Streams
from sim_vehicles.config import VehicleConfig
from sim_vehicles.link import Link

if TYPE_CHECKING:
    from sim_vehicles.autopilot.commands import GivenCommand
    from sim_vehicles.fleet import Fleet

INITIALISING_S: Final = 1.0
TIMESYNC_S: Final = 10.0
INFO, WARNING, CRITICAL = m.MAV_SEVERITY_INFO, m.MAV_SEVERITY_WARNING, m.MAV_SEVERITY_CRITICAL


class Vehicle(ABC):
    """An emulated autopilot: its link, modes and messages; its body flies."""

    mav_type: ClassVar[int]
    capabilities: ClassVar[int]
    """Those of the real one (MAV_PROTOCOL_CAPABILITY), though not all are emulated."""
    version: ClassVar[int] = 4 << 24 | 7 << 16
    unasked: ClassVar[Mapping[int, int]]
    """Messages that it sends without a request, and every how many ns."""
    builders: ClassVar[Builders] = BUILDERS
    """All that it can send."""
    asks_time: ClassVar[bool] = True
    """Whether it asks others for their time (TIMESYNC)."""
    stores_missions: ClassVar[bool] = True
    """Whether missions can be written to it."""
    tells_time_at_once: ClassVar[bool] = False
    """Whether it answers TIMESYNC as it comes, not in its main loop."""
    locks: ClassVar[bool] = False
    """Whether its link hears the first sender alone, until it restarts."""
    guided_mode: ClassVar[FlightMode]
    ground_mode: ClassVar[FlightMode]
    """On the ground, once it is up."""
    boot_mode: ClassVar[FlightMode]
    by_hand: ClassVar[frozenset[int]]
    """Modes in which it doesn't choose its own way, by HEARTBEAT's flags."""
    failsafe_keys: ClassVar[FailsafeKeys]
    armed_text: ClassVar[str] = "Throttle armed"
    disarmed_text: ClassVar[str] = "Throttle disarmed"
    handlers: ClassVar[dict[int, Callable[[Any, GivenCommand], int]]]
    """What carries out each command that it knows."""

    now: Instant
    streams: Streams
    failsafe: GroundStationFailsafe
    _up: Instant
    _next_timesync: Instant
    disarm_at: Instant
    reboots: bool
    """Whether it was told to restart."""
    ignores: bool
    _lasting: list[Fault]
    """Faults that haven't ended."""
    _clock: BoardClock

    def __init__(self, index: int, config: VehicleConfig, fleet: Fleet, now: Instant) -> None:
        """Boot at `now`; a vehicle that starts in the air has booted at once."""
        self.index, self.config, self.fleet = index, config, fleet
        self.body = fleet.bodies[index]
        self.wake = now
        """When its next cycle has something to do."""
        self.parameters = self.parameters_of(config)
        self.pilot = self.pilot_of(config, self.body.steering)
        self.link = Link(index, config, locks=self.locks)
        self.missions = Missions(lambda: home_of(config.start, fleet.origin), stored=self.stores_missions)
        self._sensors = sensors_of(config, fleet.origin, fleet.config.seed)
        self._asker = config.endpoint.address
        self._frames: list[tuple[Address, Frame]] | None = None
        """What was read at the beginning of this cycle."""
        self._tells_time_at_once, self._handlers = self.tells_time_at_once, self.handlers
        self._exact = Estimate(None)
        """What a vehicle without errors of its sensors estimates, apart from its motion."""
        self._boot(now, config.clock_offset_s)
        if config.start.in_air:
            self._come_up(self.guided_mode)

    @property
    def time_ns(self) -> int:
        """Nanoseconds since boot by the vehicle's own clock, which counts microseconds."""
        return self._clock.nanoseconds(self.now) // 1000 * 1000

    @property
    def time_s(self) -> float:
        """Seconds since boot by the vehicle's own clock."""
        return self._clock.seconds(self.now)

    @property
    def utc_us(self) -> int:
        """UTC as it knows it, microseconds since 1970."""
        self._set_utc()
        return self._clock.utc_us(self.now)

    def _set_utc(self) -> None:
        if not self.pilot.condition.armed:
            self._clock.set_by_receiver(self.now)

    @property
    def ready(self) -> bool:
        """Whether it may be armed, or is in the air."""
        up_s = seconds_between(self._clock.booted, self.now)
        return not self.pilot.booting and (self.pilot.airborne or up_s >= self.fleet.config.ready_s)

    @property
    def sensed(self) -> Motion:
        """Its motion as its sensors measure it, for telemetry; its own control loops use the truth."""
        motion = self.body.shown()
        return motion if self._sensors is None else self._sensors.sense(motion, self.now)

    @property
    def estimate(self) -> Estimate:
        """What its state estimate and its receiver say, for telemetry."""
        if self._sensors is not None:
            return self._sensors.estimate(self.body.motion, self.now)
        self._exact.received = self.body.motion
        return self._exact

    def receive(self, datagram: Datagram, now: Instant) -> None:
        """Keep a datagram for the next cycle of the main loop: not for one before `now` that is still to be made up."""
        if self._tells_time_at_once and not (self._frozen or self.pilot.crashed):
            asked = self.link.time_asked(datagram, now)
            if asked is not None:
                told_ns = self._clock.nanoseconds(now) // 1000 * 1000
                self.link.answer(datagram.peer, Timesync(told_ns, asked.ts1_ns))
                return
        self.link.receive(datagram, now)
        self.wake = min(self.wake, now)

    # A cycle of the main loop, in the order in which the fleet has each vehicle run through it.

    def read(self, now: Instant) -> bool:
        """Begin a cycle: boot, read what has arrived; return False for a vehicle that does nothing (any more)."""
        self.now = now
        if self._frozen or self.pilot.crashed:
            self.link.ignore()
            self.wake = NEVER
            return False
        if self.pilot.booting and now >= self._up:
            self._come_up(self.ground_mode)
        self._frames = self.link.frames(now) if self.link.next_arrival <= now else None
        return True

    def act(self) -> None:
        """Do what the frames that were read ask for, and what is due by now."""
        now, frames = self.now, self._frames
        if frames is not None:
            for peer, frame in frames:
                self._asker = peer
                self._take(frame)
            self._frames = None
        if self.reboots:
            self._restart()
        if self.pilot.under_way and self.pilot.progress(self.body.motion):
            self.tell_heartbeat()
            if not self.pilot.airborne:
                self.landed()
        if now >= self.disarm_at:
            self.disarm_at = NEVER
            self.disarm(force=False)
        safe_mode = self.failsafe.due_mode(now)
        if safe_mode is not None and self.pilot.airborne:
            self.say(CRITICAL, "Failsafe. Long event on: GCS")
            self.enter(safe_mode)
        self.follow_time()

    def tell(self) -> bool:
        """Send what is due besides its streams; return whether one of these is."""
        now = self.now
        if now >= self._next_timesync:
            self._next_timesync = after(now, TIMESYNC_S)
            self.broadcast(Timesync(0, self.time_ns))
        listed = self.parameters.next_of_list()
        if listed is not None:
            self.link.answer(*listed)
        if now >= self.missions.next_due():
            for peer, message in self.missions.reminders(now):
                self.link.answer(peer, message)
        return now >= self.streams.next_due

    def stream(self) -> bool:
        """Send the next message of its streams that is due; return whether there is another."""
        return self.streams.send_next(self, self.now)

    def plan(self) -> None:
        """End the cycle: set when there is next something to do other than to read frames."""
        if self.parameters.listing or self.pilot.under_way or self.flies_mission:
            self.wake = self.now
            return
        # Two by two: compiled, that is no call.
        wake = min(self.streams.next_due, self._next_timesync)
        wake = min(wake, self._up if self.pilot.booting else NEVER)
        wake = min(wake, self.link.next_arrival)
        wake = min(wake, self.failsafe.deadline())
        wake = min(wake, self.missions.next_due())
        wake = min(wake, self.disarm_at)
        self.wake = min(wake, self.pilot.silent_at)

    def inject(self, fault: Fault, now: Instant, *, ends: bool) -> None:
        """Begin or end a fault."""
        self.wake = self.now = now
        match fault.kind:
            case "crash":
                self._crash(Request.CRASH)
            case "freeze":
                self._note_lasting(fault, ends=ends)
                self.streams.leave_out(now)
            case "ignore":
                self._note_lasting(fault, ends=ends)
            case "restart":
                self._restart()
            case "pilot":
                if not self._frozen:
                    self.switch(self.guided_mode if ends else self.mode_named(fault.mode or DEFAULT_MODE))
            case _:
                assert_never(fault.kind)

    def _note_lasting(self, fault: Fault, *, ends: bool) -> None:
        """Take note of a fault that lasts: of two that overlap the later end counts."""
        if not ends:
            self._lasting.append(fault)
        elif fault in self._lasting:
            self._lasting.remove(fault)
        kinds = {each.kind for each in self._lasting}
        self._frozen, self.ignores = "freeze" in kinds, "ignore" in kinds

    def arm(self, *, force: bool) -> bool:
        """Arm; refused before the vehicle is ready, unless forced."""
        if not self.ready and not force and self.parameters["ARMING_CHECK"]:
            self.say(CRITICAL, "PreArm: AHRS: waiting for home")
            return False
        self._set_utc()
        before = self.pilot.condition.armed
        if not self.pilot.arm(self.body.motion):
            return False
        if not before:
            self.say(INFO, self.armed_text)
        self.tell_heartbeat()
        self.broadcast(self.builders[m.MAVLINK_MSG_ID_HOME_POSITION](self))
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm; refused in flight, unless forced: then it crashes."""
        before = self.pilot.condition.armed
        if force and self.pilot.airborne:
            granted = self._crash(Request.FORCE_DISARM)
        else:
            granted = self.pilot.request(Request.FORCE_DISARM if force else Request.DISARM)
        if granted and before:
            self.say(INFO, self.disarmed_text)
        if granted:
            self.tell_heartbeat()
        return granted

    def answer(self, message: Message | None) -> None:
        """Send a message to the peer that asked; nothing for None."""
        if message is not None:
            self.link.answer(self._asker, message)

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return False

    @abstractmethod
    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return its parameters."""

    @abstractmethod
    def pilot_of(self, config: VehicleConfig, steering: Steering) -> Pilot:
        """Return who flies it, by sticks, setpoints or a mission."""

    @abstractmethod
    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once."""

    @abstractmethod
    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed."""

    @abstractmethod
    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""

    @abstractmethod
    def landed(self) -> None:
        """Prepare to disarm: it has touched down."""

    @abstractmethod
    def follow_time(self) -> None:
        """Do what is due by now in its mode."""

    @abstractmethod
    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Fly to a place, whose height is above the fleet's origin, and stay there or circle it."""

    def ask_circle(self, radius_m: float, side: float) -> None:  # noqa: ARG002 - what stands flies none
        """Take the radius, m, and the side of the circles that it is told next."""
        return

    def climb_to(self, height_m: float) -> None:  # noqa: ARG002 - what stands keeps its own
        """Take a height above the origin that was told without a place."""
        return

    def fly_to(self, item: MissionItem | MissionItemInt) -> int:
        """Fly at once to a position or a height that came as a mission item; return the MAV_MISSION_RESULT."""
        return commands.fly_to(self, item)

    def failsafe_of(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""
        return GroundStationFailsafe(self.parameters, self.failsafe_keys)

    def heed(self, system: int, message: Heartbeat) -> None:  # noqa: ARG002 - the sender alone counts
        """Take a heartbeat of another system."""
        self.failsafe.heartbeat(system, self.now)

    def obey(self, message: CommandInt | CommandLong) -> tuple[int, ...]:
        """Carry out a command; return each MAV_RESULT to acknowledge it with."""
        given = commands.received(message)
        if self.ignores and given.command in commands.ORDERS:
            return (commands.ACCEPTED,)
        handler = self._handlers.get(given.command)
        return (commands.UNSUPPORTED if handler is None else handler(self, given),)

    def take_other(self, frame: Frame) -> bool:  # noqa: ARG002 - of the family's own there is none
        """Take a message of the family's own; return whether it is one."""
        return False

    def take_mode(self, message: SetMode, frame: Frame) -> bool:  # noqa: ARG002 - nobody is answered
        """Change to a mode by the old message; return whether that was allowed."""
        custom = bool(message.base_mode & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        return custom and (self.ignores or self.switch(message.custom_mode))

    def _boot(self, now: Instant, clock_offset_s: float) -> None:
        self.now = now
        self._frozen = self.ignores = self.reboots = False
        self._lasting = list[Fault]()
        config, at_0_us = self.config, self.fleet.config.utc_at_0_us
        self._clock = BoardClock(now, clock_offset_s, config.clock_drift, at_0_us, config.utc_error_s)
        self._up = after(now, INITIALISING_S)
        self._next_timesync = after(now, TIMESYNC_S) if self.asks_time else NEVER
        self.disarm_at = NEVER
        self.streams = Streams(now, self.unasked, self.builders)
        self.failsafe = self.failsafe_of()
        self.link.restart()
        self.missions.restart()
        self.pilot.restart(self.boot_mode)

    def _restart(self) -> None:
        if self.pilot.request(Request.RESTART):
            self._boot(self.now, 0.0)

    def _come_up(self, mode: FlightMode) -> None:
        self.pilot.request(Request.BOOTED)
        self.pilot.enter(mode, self.body.motion)
        if self.pilot.airborne:
            self.pilot.fly_straight(self.body.motion)

    def _crash(self, request: Request) -> bool:
        granted = self.pilot.request(request)
        if granted:
            self.body.ground()
        return granted

    def _take(self, frame: Frame) -> None:
        message = frame.message
        if isinstance(message, (CommandInt, CommandLong)):
            for result in self.obey(message):
                self.answer(CommandAck(message.command, result, 0, 0, frame.system, frame.component))
        elif isinstance(message, Timesync) and message.tc1_ns == 0:
            self.answer(Timesync(self.time_ns, message.ts1_ns))
        elif isinstance(message, Heartbeat):
            self.heed(frame.system, message)
        else:
            self._take_seldom(frame)

    def _take_seldom(self, frame: Frame) -> None:
        match message := frame.message:
            case RequestDataStream():
                rate_hz = message.req_message_rate if message.start_stop else 0
                self.streams.set_group(message.req_stream_id, rate_hz, self.now)
            case SetMode():
                self.take_mode(message, frame)
            case LogRequestList():
                self.answer(LogEntry(0, 0, 0, 0, 0))
            case NamedValueFloat(name=name, value=value) if name == MISSION_TIME and math.isfinite(value):
                self.fleet.environment.hear_mission_time(value, self.now)
            case MissionItem() | MissionItemInt() if message.current in commands.AT_ONCE:
                result = m.MAV_MISSION_ACCEPTED if self.ignores else self.fly_to(message)
                self.answer(MissionAck(frame.system, frame.component, result))
            case Message() if not self.take_other(frame):
                sender = Sender(self._asker, frame.system, frame.component)
                for answer in self.parameters.answers(message, sender) or self.missions.take(message, sender, self.now):
                    self.answer(answer)
            case _:
                pass

    def tell_heartbeat(self) -> None:
        """Send a HEARTBEAT now, to all peers."""
        self.broadcast(self.builders[m.MAVLINK_MSG_ID_HEARTBEAT](self))

    def say(self, severity: int, text: str) -> None:
        """Send a text for the operator to all peers."""
        self.broadcast(Statustext(severity, text))

    def broadcast(self, message: Message) -> None:
        """Send a message to all peers."""
        self.link.broadcast(message, self.now)
