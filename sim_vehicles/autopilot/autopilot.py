"""An emulated autopilot without its main loop: its parts, what it is asked and commanded, and the hooks of its family.

What handles messages and commands, and what builds telemetry, knows a vehicle as an `Autopilot`. Above them,
`vehicle.Vehicle` adds the main loop that calls them; each family of autopilots is a subclass of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.endpoint import Address
from airlink.messages import Message
from airlink.messages.command import SetPositionTargetGlobalInt, SetPositionTargetLocalNed
from airlink.messages.system import Statustext
from formation_scenario.stored_landing import items_of, landing_position
from sim_vehicles.airframe.battery import Battery, throttle_of
from sim_vehicles.airframe.body import Body
from sim_vehicles.airframe.environment import Environment
from sim_vehicles.airframe.motion import Estimate, Motion
from sim_vehicles.autopilot.estimator_errors import StateEstimator
from sim_vehicles.autopilot.mission_items import Item, of_landing
from sim_vehicles.autopilot.missions import Missions, home_of
from sim_vehicles.autopilot.modes_and_failsafe import FlightMode, GroundStationFailsafe, Request
from sim_vehicles.autopilot.onboard_log import OnboardLog
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.autopilot.sensors import sensors_of
from sim_vehicles.autopilot.streams import Builders, Streams
from sim_vehicles.board_clock import BoardClock
from sim_vehicles.config import FleetConfig
from sim_vehicles.link import Link

INFO: Final = m.MAV_SEVERITY_INFO
WARNING: Final = m.MAV_SEVERITY_WARNING
CRITICAL: Final = m.MAV_SEVERITY_CRITICAL
Distortion = Callable[[Motion, Instant], Motion]
Setpoint = SetPositionTargetLocalNed | SetPositionTargetGlobalInt


@mypyc_attr(acyclic=True, free_list_len=1)
class GivenCommand:
    """A command, from either kind of message."""

    def __init__(
        self,
        command: int,
        frame: int,
        params: tuple[float, float, float, float],
        lat_rad: float,
        lon_rad: float,
        z: float,
        *,
        in_integers: bool,
    ) -> None:
        """Take MAV_CMD, MAV_FRAME, `param1` to `param4`, and a position, whose `z` refers to the frame.

        `in_integers`: the position was sent as integers, in COMMAND_INT.
        """
        self.command = command
        self.frame = frame
        self.params = params
        self.lat_rad = lat_rad
        self.lon_rad = lon_rad
        self.z = z
        self.in_integers = in_integers


@mypyc_attr(allow_interpreted_subclasses=True)
class Autopilot(ABC):
    """An emulated autopilot and its body; what families must and may override comes last."""

    emulates: ClassVar[str]
    """The family of autopilots, as the station knows it, that it is like."""
    mav_type: ClassVar[int]
    capabilities: ClassVar[int]
    """Those of the real one (MAV_PROTOCOL_CAPABILITY), though not all are emulated."""
    version: ClassVar[int] = 4 << 24 | 7 << 16
    unasked: ClassVar[Mapping[int, int]]
    """Messages that it sends without a request, and every how many ns."""
    builders: ClassVar[Builders[Autopilot]]
    """All that it can send."""
    handlers: ClassVar[Mapping[int, Callable[[Any, GivenCommand], int]]]
    """MAV_CMD -> what carries it out on this vehicle, and returns the MAV_RESULT; all others are UNSUPPORTED."""
    asks_time: ClassVar[bool] = True
    """Whether it asks others for their time (TIMESYNC)."""
    tells_time_at_once: ClassVar[bool] = False
    """Whether it answers TIMESYNC as it comes, not in its main loop."""
    stores_missions: ClassVar[bool] = True
    """Whether missions can be written to it."""
    locks: ClassVar[bool] = False
    """Whether its link receives the first sender alone, until it restarts."""
    boot_mode: ClassVar[FlightMode]
    """Its pilot's mode at boot."""
    ground_mode: ClassVar[FlightMode]
    """Its pilot's mode on the ground, once it is up."""
    air_mode: ClassVar[FlightMode]
    """Its pilot's mode where it starts in the air."""
    guided_mode: ClassVar[FlightMode]
    """The mode in which it follows a ground station."""
    by_hand: ClassVar[frozenset[int]]
    """Modes whose HEARTBEAT lacks the flag GUIDED_ENABLED."""
    armed_text: ClassVar[str] = "Throttle armed"
    disarmed_text: ClassVar[str] = "Throttle disarmed"
    failsafe_off_text: ClassVar[str] = "GCS Failsafe Off"
    reports_unarmable: ClassVar[bool] = False
    """Whether it says again and again why it can't be armed."""

    now: Instant
    """Instant of the present cycle of its main loop."""
    clock: BoardClock
    streams: Streams[Autopilot]
    failsafe: GroundStationFailsafe
    disarm_at: Instant
    report_at: Instant
    """When it says next why it can't be armed."""
    battery: Battery | None
    """Its battery; None: it tells one that isn't drained."""
    onboard_log: OnboardLog | None = None
    """Its own log, if it writes one."""
    reboots: bool
    """Whether it was commanded to restart."""
    ignores: bool
    """Whether a fault has it acknowledge orders and do nothing."""

    def __init__(self, index: int, fleet: FleetConfig, body: Body, environment: Environment) -> None:
        """Put together the parts of vehicle number `index` of a fleet; it has yet to boot."""
        self.fleet, self.origin, self.config = fleet, fleet.origin, fleet.vehicles[index]
        self.body, self.environment = body, environment
        self.parameters = self.make_parameters()
        self.pilot = self.make_pilot()
        self.link = Link(fleet.sockets_of(index), self.config, fleet.utc_at_0_us, locks=self.locks)
        start, origin = self.config.start, self.origin
        landing = None if self.config.landing is None else landing_position(self.config.landing, start)
        self.missions = self.make_missions(home_of(start, origin))
        self.missions.items += () if landing is None else tuple(map(of_landing, items_of(landing, origin)))
        self.sender: Address = self.config.endpoint.address
        """Sender of the last frame."""
        self.sticks = False
        """Whether a pilot has its transmitter."""
        self._sensors = sensors_of(self.config, fleet, environment.failures)
        self.wanders: bool = isinstance(self._sensors, StateEstimator)
        """Whether its control loops fly by an estimate that is wrong."""
        self.keys: Any = self.config.own_keys
        """The keys of a family of an extension, typed by its own model."""
        self.distort: Distortion | None = None
        """Changes what telemetry has of the motion, by a fault."""
        self._exact = Estimate(None)
        """The estimate of a vehicle whose sensors have no errors."""

    def arm(self, *, force: bool) -> bool:
        """Arm; refused before the vehicle is ready, unless forced."""
        if not self.armable and not force and self.parameters["ARMING_CHECK"]:
            self.say(CRITICAL, f"PreArm: {self.unarmable}")
            return False
        self.set_utc()
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
            granted = self.crash(Request.FORCE_DISARM)
        else:
            granted = self.pilot.request(Request.FORCE_DISARM if force else Request.DISARM)
        if granted and before:
            self.say(INFO, self.disarmed_text)
        if granted:
            self.tell_heartbeat()
        return granted

    def crash(self, request: Request) -> bool:
        """Fall to the ground, if its condition allows the request; return whether it did."""
        granted = self.pilot.request(request)
        if granted:
            self.body.ground()
        return granted

    def take_heartbeat(self, system: int, mav_type: int) -> None:  # noqa: ARG002 - who sends it is enough
        """Note a heartbeat of another system, whose end the failsafe acts on."""
        acted = self.failsafe.active
        self.failsafe.heartbeat(system, self.now)
        if acted and not self.failsafe.active:
            self.say(WARNING, self.failsafe_off_text)

    def drain(self) -> None:
        """Take what has flowed from its battery, if it has one."""
        battery, model, motion = self.battery, self.config.model, self.body.motion
        if battery is not None:
            climb_mps, cruise_mps = model.climb_max_mps, max(self.fleet.cruise_mps, 1.0)
            flies = self.pilot.airborne
            throttle = throttle_of(motion, cruise_mps, climb_mps, hovers=model.hovers) if flies else 0.0
            battery.drain(throttle, self.now)

    def tell_heartbeat(self) -> None:
        """Send a HEARTBEAT now, to all peers."""
        self.broadcast(self.builders[m.MAVLINK_MSG_ID_HEARTBEAT](self))

    def say(self, severity: int, text: str) -> None:
        """Send a text for the operator to all peers."""
        self.broadcast(Statustext(severity, text))

    def broadcast(self, message: Message) -> None:
        """Send a message to all peers."""
        self.link.broadcast(message, self.now)

    def answer(self, message: Message | None) -> None:
        """Send a message to the sender of the last frame; nothing for None."""
        if message is not None:
            self.link.answer(self.sender, message)

    @property
    def ready(self) -> bool:
        """Whether it may be armed, or is in the air."""
        up_s = seconds_between(self.clock.booted, self.now)
        return not self.pilot.booting and (self.pilot.airborne or up_s >= self.fleet.ready_s)

    @property
    def time_ns(self) -> int:
        """Nanoseconds since boot by the vehicle's own clock, which counts microseconds."""
        return self.clock.nanoseconds(self.now) // 1000 * 1000

    @property
    def time_s(self) -> float:
        """Seconds since boot by the vehicle's own clock."""
        return self.clock.seconds(self.now)

    @property
    def utc_us(self) -> int:
        """UTC as it knows it, microseconds since 1970."""
        self.set_utc()
        return self.clock.utc_us(self.now)

    def set_utc(self) -> None:
        """Set UTC by the GNSS receiver, as long as it is disarmed."""
        if not self.pilot.condition.armed:
            self.clock.set_by_receiver(self.now)

    @property
    def sensed(self) -> Motion:
        """Its motion as its sensors measure it, for telemetry; its own control loops use the truth."""
        motion = self.body.shown()
        if self._sensors is not None:
            motion = self._sensors.sense(motion, self.now)
        return motion if self.distort is None else self.distort(motion, self.now)

    def wander(self, now: Instant) -> None:
        """Fly by its estimate: its true velocity is off by as much as that is wrong, in the opposite direction."""
        if isinstance(self._sensors, StateEstimator):
            self.body.unknown_mps = self._sensors.unknown_mps(now)

    @property
    def estimate(self) -> Estimate:
        """What its state estimate and its receiver say, for telemetry."""
        if self._sensors is not None:
            found = self._sensors.estimate(self.body.motion, self.now)
        else:
            found = self._exact
            found.received = self.body.motion
        if self.distort is not None and found.received is not None:
            found.received = self.distort(found.received, self.now)
        return found

    # What its main loop adds, by which faults act on it.

    @abstractmethod
    def restart(self) -> None:
        """Reboot, if its condition allows it."""

    @abstractmethod
    def freeze(self, by: object, *, on: bool) -> None:
        """Hang for as long as anything holds it."""

    @abstractmethod
    def ignore(self, by: object, *, on: bool) -> None:
        """Acknowledge commands without carrying them out for as long as anything holds it."""

    @abstractmethod
    def take_over(self, mode: str | None) -> None:
        """Have its pilot take the sticks and change the mode; None: give it back, in the mode that is commanded."""

    # The hooks of a family: what each must have.

    @abstractmethod
    def make_parameters(self) -> ParameterServer:
        """Return its parameters."""

    @abstractmethod
    def make_pilot(self) -> Pilot:
        """Return who flies it, by sticks, setpoints or a mission."""

    @abstractmethod
    def make_failsafe(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""

    @abstractmethod
    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""

    @abstractmethod
    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed."""

    @abstractmethod
    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once."""

    @abstractmethod
    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Fly to a position, whose height is above the fleet's origin, and stay there or circle it."""

    @abstractmethod
    def take_setpoint(self, setpoint: Setpoint) -> None:
        """Fly by a setpoint of position or velocity, as far as the mode allows."""

    @abstractmethod
    def follow_time(self) -> None:
        """Do what is due by now in its mode; called in every cycle."""

    @abstractmethod
    def landed(self) -> None:
        """Prepare to disarm: it has touched down."""

    # What a family may override.

    @property
    def mode(self) -> FlightMode:
        """Its mode as ground stations know it."""
        return self.pilot.mode

    @property
    def intended(self) -> FlightMode:
        """The mode that was last asked for; a failsafe flies another."""
        return self.mode

    @property
    def in_failsafe(self) -> bool:
        """Whether a failsafe has it act."""
        return self.failsafe.active

    @property
    def armable(self) -> bool:
        """Whether it is ready, its mode can be armed in, and no failsafe prevents it."""
        return self.ready

    @property
    def unarmable(self) -> str:
        """Why it can't be armed, in its own words."""
        return "AHRS: waiting for home"

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return False

    def make_missions(self, home: Item) -> Missions:
        """Return what stores its mission, and tells it to ground stations."""
        return Missions(home, stored=self.stores_missions)

    def forget(self) -> None:
        """Forget, at boot, the state that only the family has."""
        return

    def ask_circle(self, radius_m: float, side: float) -> None:  # noqa: ARG002 - what hovers flies none
        """Take the radius, m, and the side of the circles that it is commanded next."""
        return

    def climb_to(self, height_m: float) -> None:  # noqa: ARG002 - what hovers keeps its own
        """Take a height above the origin that was commanded without a position."""
        return
