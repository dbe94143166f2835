"""One emulated vehicle's side of the protocol: frames in, frames out, on the turns of its main loop."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Literal

from airlink import mavlink as m
from airlink.clock import Instant, after, seconds_between
from airlink.endpoint import Address
from airlink.frame import Frame, FrameWriter, StreamParser
from airlink.messages import (
    CommandAck,
    CommandInt,
    CommandLong,
    Message,
    NamedValueFloat,
    RequestDataStream,
    SetMode,
    Statustext,
    Timesync,
)
from sim_vehicles import commands
from sim_vehicles.config import FaultKind, VehicleConfig
from sim_vehicles.modes import Condition, Mode, Request, select
from sim_vehicles.pilot import Pilot
from sim_vehicles.streams import Streams
from sim_vehicles.telemetry import BUILDERS
from sim_vehicles.vehicle_clock import VehicleClock

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet

INITIALISING_S = 1.0
READY_S = 3.0
"""After boot: a real one's estimator takes 23 s."""
TIMESYNC_S = 10.0
PEER_FORGOTTEN_S = 10.0
MAX_PEERS = 16
MAX_INBOX = 4096
"""Datagrams kept for the next turn; more are dropped, as a full serial buffer would."""
MISSION_TIME = "MISSION_T"
NOTICE, CRITICAL = m.MAV_SEVERITY_NOTICE, m.MAV_SEVERITY_CRITICAL

StateName = Literal["north_m", "east_m", "height_m", "climb_mps", "airspeed_mps", "heading_rad"]
CommandName = Literal["speed_mps", "heading_rad", "height_m"]


class Vehicle:
    """An emulated ArduPlane: its link, its modes, its messages. How it flies is the fleet's arrays' business."""

    def __init__(self, index: int, config: VehicleConfig, fleet: Fleet, now: Instant) -> None:
        """Boot at `now`."""
        self.index = index
        self.config = config
        self.now = now
        self.steering = fleet.steering
        self.origin_alt_m = fleet.config.origin_alt_m
        self.streams = Streams()
        self._fleet = fleet
        self._writer = FrameWriter(config.identity.system, m.MAV_COMP_ID_AUTOPILOT1)
        fixed = config.endpoint.kind == "udpout"
        self._parsers: dict[Address, StreamParser] = {}
        self._heard: dict[Address, Instant] = {config.endpoint.address: now} if fixed else {}
        self._fixed_peer = config.endpoint.address if fixed else None
        self._inbox: deque[tuple[Address, bytes]] = deque()
        self._sender = config.endpoint.address
        self.frozen = False
        start_condition = Condition.BOOTING_IN_AIR if config.start.in_air else Condition.BOOTING
        self.pilot = Pilot(index, config, fleet.steering, fleet.config.cruise_mps, start_condition)
        self._boot(now)
        if config.start.in_air:
            self._come_up(Mode.GUIDED)

    # State, as the messages tell it.

    @property
    def time_ns(self) -> int:
        """Nanoseconds since boot by the vehicle's own clock."""
        return self._clock.nanoseconds(self.now)

    @property
    def time_s(self) -> float:
        """Seconds since boot by the vehicle's own clock."""
        return self._clock.seconds(self.now)

    @property
    def ready(self) -> bool:
        """Whether it may be armed, or flies."""
        up_s = seconds_between(self._clock.booted, self.now)
        return not self.pilot.condition.booting and (self.pilot.airborne or up_s >= READY_S)

    def state(self, name: StateName) -> float:
        """Return one element of the fleet's state."""
        return float(getattr(self._fleet.state, name)[self.index])

    def commanded(self, name: CommandName) -> float:
        """Return one element of what the model is told."""
        return float(getattr(self._fleet.command, name)[self.index])

    def turn_rate(self) -> float:
        """Return psi', rad/s."""
        return float(self._fleet.turn_rate_rps[self.index])

    def drift(self) -> tuple[float, float, float]:
        """Return what carries it through the air: north, east, down."""
        north, east, down = self._fleet.drift_mps[:, self.index].tolist()
        return north, east, down

    def ground_velocity(self) -> tuple[float, float, float]:
        """Return north, east, down in m/s."""
        north, east, down = self.drift()
        speed, heading = self.state("airspeed_mps"), self.state("heading_rad")
        return (
            north + speed * math.cos(heading),
            east + speed * math.sin(heading),
            down - self.state("climb_mps"),
        )

    def geodetic(self) -> tuple[float, float, float]:
        """Return latitude, longitude (rad) and altitude above sea level."""
        return self._fleet.origin.from_ned(self.state("north_m"), self.state("east_m"), -self.state("height_m"))

    def home(self) -> tuple[float, float, float]:
        """Return home: latitude, longitude (rad) and altitude above sea level."""
        start = self.config.start
        return self._fleet.origin.from_ned(start.north_m, start.east_m, -self.pilot.home_height_m)

    # What is done to it.

    def receive(self, peer: Address, data: bytes) -> None:
        """Keep a datagram for the next turn of the main loop."""
        if len(self._inbox) < MAX_INBOX:
            self._inbox.append((peer, data))

    def turn(self, now: Instant) -> None:
        """Take one turn of the main loop: boot, listen, fly on, tell."""
        self.now = now
        if self.frozen or self.pilot.condition is Condition.CRASHED:
            self._inbox.clear()
            return
        if self.pilot.condition.booting and seconds_between(self._clock.booted, now) >= INITIALISING_S:
            self._come_up(Mode.MANUAL)
        while self._inbox:
            self._listen(*self._inbox.popleft())
        if self.pilot.progress(self._fleet.state):
            self._tell_heartbeat()
        self._ask_time()
        for message_id in self.streams.take_due():
            self._broadcast(BUILDERS[message_id](self))

    def strike(self, fault: FaultKind, now: Instant) -> None:
        """Let a fault happen."""
        if fault == "freeze":
            self.frozen = True
        elif fault == "crash":
            self.pilot.request(Request.CRASH)
        elif self.pilot.request(Request.RESTART):
            self._boot(now)

    def enter(self, mode: Mode) -> None:
        """Change the mode, and say so at once."""
        if mode is self.pilot.mode and mode is Mode.GUIDED:
            return
        self.pilot.enter(mode, self._fleet.state)
        self._tell_heartbeat()

    def arm(self, *, force: bool) -> bool:
        """Arm; refused before the vehicle is ready."""
        if not self.ready and not force:
            self.say(CRITICAL, "PreArm: AHRS: waiting for home")
            return False
        if not self.pilot.request(Request.ARM):
            return False
        self.pilot.enter(self.pilot.mode, self._fleet.state) if not self.pilot.airborne else None
        if self.pilot.mode is Mode.TAKEOFF:
            self.steering.speed_mps[self.index] = self._fleet.config.cruise_mps
        self.say(NOTICE, "Throttle armed")
        self._tell_heartbeat()
        return True

    def disarm(self, request: Request) -> bool:
        """Disarm; refused in flight unless by force."""
        if not self.pilot.request(request):
            return False
        self.say(NOTICE, "Throttle disarmed")
        self._tell_heartbeat()
        return True

    def circle_here(self) -> None:
        """Circle the present place at the present target height."""
        height_m = float(self.steering.height_m[self.index])
        self.pilot.circle(self.state("north_m"), self.state("east_m"), height_m)

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Circle a place; the height is left alone when setpoints came before."""
        north_m, east_m, _ = self._fleet.origin.to_ned(lat_rad, lon_rad, self.origin_alt_m)
        if self.pilot.guided_by_setpoints:
            height_m = float(self.steering.height_m[self.index])
        self.pilot.circle(north_m, east_m, height_m)

    def answer(self, message: Message) -> None:
        """Send to whoever asked."""
        self._fleet.send(self.index, self._sender, self._writer.encode(message))

    def say(self, severity: int, text: str) -> None:
        """Send words for a person to everyone."""
        self._broadcast(Statustext(severity, text))

    # The protocol.

    def _boot(self, now: Instant) -> None:
        self._clock = VehicleClock(now, self.config.clock_offset_s, self.config.clock_drift)
        self.streams = Streams()
        self._next_timesync = after(now, TIMESYNC_S)
        self.pilot.mode = Mode.INITIALISING
        self.pilot.guided_by_setpoints = False

    def _come_up(self, mode: Mode) -> None:
        self.pilot.request(Request.BOOTED)
        self.pilot.mode = mode
        if self.pilot.airborne:
            self.pilot.hold_heading(self._fleet.state)

    def _listen(self, peer: Address, data: bytes) -> None:
        parser = self._parsers.get(peer)
        if parser is None:
            if len(self._parsers) >= MAX_PEERS:
                self._forget_oldest()
            parser = self._parsers[peer] = StreamParser()
        self._heard[peer] = self.now
        self._sender = peer
        for frame in parser.feed(data):
            self._take(frame)

    def _forget_oldest(self) -> None:
        oldest = min(self._parsers, key=lambda peer: self._heard.get(peer, Instant(0)))
        del self._parsers[oldest]
        if oldest != self._fixed_peer:
            self._heard.pop(oldest, None)

    def _take(self, frame: Frame) -> None:
        match frame.message:
            case CommandInt() | CommandLong() as command if self._is_for_us(command.target_system):
                result = commands.execute(self, commands.order(command))
                self.answer(CommandAck(command.command, result, 0, 0, frame.system, frame.component))
            case SetMode() as request if self._is_for_us(request.target_system):
                mode = select(self.pilot.condition, request.custom_mode)
                if mode is not None:
                    self.enter(mode)
            case RequestDataStream() as request if self._is_for_us(request.target_system):
                self.streams.set_all(request.req_message_rate if request.start_stop else 0.0)
            case Timesync(tc1_ns=0) as request:
                self.answer(Timesync(self.time_ns, request.ts1_ns))
            case NamedValueFloat(name=name, value=value) if name == MISSION_TIME and math.isfinite(value):
                self._fleet.environment.mission_told(value, self.now)
            case _:
                pass

    def _is_for_us(self, target_system: int) -> bool:
        return target_system in (0, self.config.identity.system)

    def _ask_time(self) -> None:
        if self.now >= self._next_timesync:
            self._next_timesync = after(self.now, TIMESYNC_S)
            self._broadcast(Timesync(0, self.time_ns))

    def _tell_heartbeat(self) -> None:
        self._broadcast(BUILDERS[m.MAVLINK_MSG_ID_HEARTBEAT](self))

    def _broadcast(self, message: Message) -> None:
        """Send to the peer we're pointed at, or to everyone who was heard lately."""
        raw = self._writer.encode(message)
        if self._fixed_peer is not None:
            self._fleet.send(self.index, self._fixed_peer, raw)
            return
        for peer, heard in self._heard.items():
            if seconds_between(heard, self.now) <= PEER_FORGOTTEN_S:
                self._fleet.send(self.index, peer, raw)
