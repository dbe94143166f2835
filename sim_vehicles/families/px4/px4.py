# Compiled by mypyc: it runs every tick.

"""What emulated PX4s have in common, and their commands; the two kinds are in `plane` and `copter`."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from mypy_extensions import mypyc_attr

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from airlink.messages.system import Statustext
from sim_vehicles.airframe.motion import Vector
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.autopilot import CRITICAL, INFO, WARNING, GivenCommand, Setpoint
from sim_vehicles.autopilot.commands import ACCEPTED, DENIED, UNSUPPORTED, CommandHandlers, to_mode
from sim_vehicles.autopilot.modes_and_failsafe import (
    PX4_BY_STICKS,
    PX4_NOT_ARMABLE,
    Condition,
    FlightMode,
    GroundStationFailsafe,
    Px4Mode,
    Request,
    select,
)
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.board_clock import delayed
from sim_vehicles.families.px4 import services
from sim_vehicles.families.px4.services import REJECTED
from sim_vehicles.vehicle import Vehicle

TEXT_BYTES: Final = 50
KEPT_TEXTS: Final = 16
"""Texts that wait for a ground station."""


def _set_mode(vehicle: Px4, given: GivenCommand) -> int:
    main, sub = given.params[1], given.params[2]
    if not int(given.params[0]) & m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED or not (main % 1 == 0.0 and sub % 1 == 0.0):
        return REJECTED
    return ACCEPTED if vehicle.switch(int(main) << 16 | int(sub) << 24) else REJECTED


def _arm_disarm(vehicle: Px4, given: GivenCommand) -> int:
    force = given.params[1] == commands.FORCE
    granted = vehicle.arm(force=force) if given.params[0] == 1.0 else vehicle.disarm(force=force)
    return ACCEPTED if granted else REJECTED


def _take_off(vehicle: Px4, given: GivenCommand) -> int:
    height_m = given.z - vehicle.origin.alt_m if math.isfinite(given.z) else vehicle.parameters["MIS_TAKEOFF_ALT"]
    return ACCEPTED if vehicle.prepare(height_m) else REJECTED


def _reposition(vehicle: Px4, given: GivenCommand) -> int:
    if given.params[1] != m.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE:
        return UNSUPPORTED
    if not vehicle.switch(Px4Mode.HOLD):
        return REJECTED
    vehicle.go_to(given.lat_rad, given.lon_rad, given.z - vehicle.origin.alt_m, given.params[0])
    return ACCEPTED


def _change_speed(vehicle: Px4, given: GivenCommand) -> int:
    """Change the speed; in OFFBOARD, and for an invalid speed, this is accepted without effect."""
    if vehicle.mode is Px4Mode.HOLD and 0.0 < given.params[1] < math.inf:
        vehicle.change_speed(given.params[1])
    return ACCEPTED


def _change_altitude(vehicle: Px4, given: GivenCommand) -> int:
    """Hold at an altitude above sea level, or at the present one if the altitude isn't finite."""
    if not vehicle.switch(Px4Mode.HOLD):
        return REJECTED
    if math.isfinite(given.params[0]):
        vehicle.climb_to(given.params[0] - vehicle.origin.alt_m)
    return ACCEPTED


def _start_mission(vehicle: Px4, _given: GivenCommand) -> int:
    vehicle.say(CRITICAL, "Mission start denied! No valid mission")
    return DENIED


UNHEEDED: Final = (
    m.MAV_CMD_DO_SET_ROI_LOCATION,
    m.MAV_CMD_DO_SET_ROI_NONE,
    m.MAV_CMD_DO_SET_ROI,
    m.MAV_CMD_DO_GO_AROUND,
    m.MAV_CMD_RUN_PREARM_CHECKS,
    m.MAV_CMD_REQUEST_PROTOCOL_VERSION,
)
"""Accepted without effect here: they concern a camera, a go-around, checks and the protocol version."""
HANDLERS: Final[CommandHandlers[Px4]] = {
    **dict.fromkeys(UNHEEDED, lambda _vehicle, _given: ACCEPTED),
    m.MAV_CMD_DO_SET_MODE: _set_mode,
    m.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    m.MAV_CMD_NAV_TAKEOFF: _take_off,
    m.MAV_CMD_NAV_RETURN_TO_LAUNCH: to_mode(Px4Mode.RTL, REJECTED),
    m.MAV_CMD_NAV_LAND: to_mode(Px4Mode.LAND, REJECTED),
    m.MAV_CMD_DO_REPOSITION: _reposition,
    m.MAV_CMD_SET_MESSAGE_INTERVAL: services.set_interval,
    m.MAV_CMD_GET_MESSAGE_INTERVAL: services.get_interval,
    m.MAV_CMD_REQUEST_MESSAGE: services.request_message,
    m.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: commands.reboot(DENIED),
    m.MAV_CMD_GET_HOME_POSITION: commands.HANDLERS[m.MAV_CMD_GET_HOME_POSITION],
    m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: commands.HANDLERS[m.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES],
    m.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    m.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    m.MAV_CMD_MISSION_START: _start_mission,
}
"""What all PX4s take."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Px4(Vehicle):
    """What emulated PX4s have in common."""

    capabilities = 59647
    version = 1 << 24 | 17 << 16
    unasked = services.STREAMS
    builders = services.BUILDERS
    asks_time = False
    tells_time_at_once = True
    stores_missions = False
    locks = True
    guided_mode = Px4Mode.HOLD
    by_hand = PX4_BY_STICKS
    armed_text = "Armed by external command"
    disarmed_text = "Disarmed"
    failsafe_off_text = "GCS connection regained"
    handlers: ClassVar[CommandHandlers[Any]] = HANDLERS
    flown: ClassVar[Mapping[Px4Mode, FlightMode]]
    """Its modes, and for each the mode of ArduPilot that its pilot flies."""
    _mode: Px4Mode
    _intended: Px4Mode
    _rise_m: float
    _lost: bool
    _greeted: bool
    _unsaid: list[Statustext]
    _texts: int
    _fresh_until: Instant

    def make_parameters(self) -> ParameterServer:
        """Return PX4's parameters for its kind."""
        return services.Px4Parameters(services.parameters(self.config, self.fleet.cruise_mps))

    @abstractmethod
    def change_speed(self, speed_mps: float) -> None:
        """Fly at a speed in HOLD from now on."""

    @abstractmethod
    def lift_off(self, height_m: float) -> None:
        """Begin to climb to a height above home."""

    @abstractmethod
    def follow(self, message: Setpoint) -> None:
        """Fly a setpoint of OFFBOARD."""

    @property
    def mode(self) -> Px4Mode:
        """Its mode as ground stations know it; its pilot flies one of ArduPilot's."""
        return self._mode

    @property
    def intended(self) -> Px4Mode:
        """The mode that was last asked for; a failsafe flies another."""
        return self._intended

    @property
    def fresh(self) -> bool:
        """Whether the last setpoint is younger than COM_OF_LOSS_T."""
        return self.now < self._fresh_until

    @property
    def armable(self) -> bool:
        """Whether it is ready, and its mode can be armed in: its inputs are there, and it doesn't end a flight."""
        lacks = not self.fresh if self._mode is Px4Mode.OFFBOARD else self._mode in PX4_BY_STICKS and not self.sticks
        return self.ready and not lacks and self._mode not in PX4_NOT_ARMABLE and not self._misses_station

    @property
    def _misses_station(self) -> bool:
        """Whether no ground station is received, though NAV_DLL_ACT is to act on that."""
        failsafe = self.failsafe
        return isinstance(failsafe, services.LinkLoss) and failsafe.lost(self.now)

    def lose_station(self) -> None:
        """Act while it is armed, on the ground too: hold, then NAV_DLL_ACT. Disarmed it only can't be armed.

        Source: PX4, `Failsafe::checkStateAndMode`, `RcAndDataLinkChecks`.
        """
        mode = self.failsafe.trigger()
        if mode is not None and self.pilot.condition.armed:
            self.say(CRITICAL, "GCS connection lost, failsafe")
            self.enter(mode)

    @property
    def in_failsafe(self) -> bool:
        """Whether its ground station's heartbeats or its setpoints are missing."""
        return self.failsafe.active or self._lost

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already; the next HEARTBEAT reports it."""
        if mode is not self._mode:
            self._mode = Px4Mode(mode)
            self.pilot.enter(self.flown[self._mode], self.body.motion)
            self.pilot.silent_at = self._fresh_until if self._mode is Px4Mode.OFFBOARD else NEVER
            self.tell_heartbeat()

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed.

        Armed, OFFBOARD needs setpoints, and modes of a pilot need a transmitter; disarmed, none needs anything.
        """
        chosen = select(self.pilot.condition, number, frozenset(self.flown) - {Px4Mode.ORBIT})
        lacks = (chosen == Px4Mode.OFFBOARD and not self.fresh) or (chosen in PX4_BY_STICKS and not self.sticks)
        if chosen is None or (lacks and self.pilot.condition.armed):
            named = "this mode" if chosen is None else Px4Mode(chosen).name.capitalize()
            self.say(CRITICAL, f"Switching to {named} is currently not available")
            return False
        self._intended, self._lost = Px4Mode(chosen), False
        self.enter(self._intended)
        if self.pilot.condition is Condition.ARMED:
            self._climb_in_takeoff()
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm, and take off if that is its mode; refused while it isn't armable."""
        if not force and not self.armable:
            if self._misses_station:
                self.say(WARNING, "Preflight Fail: No connection to the GCS")
            self.say(CRITICAL, "Arming denied: Resolve system health failures first")
            return False
        if self.pilot.condition.armed:
            return True
        self.set_utc()
        if not self.pilot.request(Request.ARM):
            return False
        self.say(INFO, self.armed_text)
        self.disarm_at = delayed(self.now, self.parameters["COM_DISARM_PRFLT"])
        self._climb_in_takeoff()
        self.tell_heartbeat()
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm, and wait in HOLD if the flight has ended in a landing."""
        landed = not self.pilot.airborne and self.pilot.condition.armed
        granted = super().disarm(force=force)
        if granted and landed and self._mode in PX4_NOT_ARMABLE:
            self.switch(Px4Mode.HOLD)
        return granted

    def prepare(self, height_m: float) -> bool:
        """Change to TAKEOFF on the ground, to a height; armed, it climbs. Return whether that was allowed."""
        self._rise_m = height_m
        return not self.pilot.airborne and self.switch(Px4Mode.TAKEOFF)

    def make_message_handler(self) -> services.Px4MessageHandler:
        """Return what takes its messages."""
        return services.Px4MessageHandler(self)

    def make_failsafe(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""
        return services.LinkLoss(self.parameters)

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name; one that PX4 doesn't have becomes HOLD."""
        named = Px4Mode.__members__.get(name, Px4Mode.HOLD)
        return named if named in self.flown else Px4Mode.HOLD

    def landed(self) -> None:
        """Disarm a while after it has touched down."""
        self.disarm_at = delayed(self.now, self.parameters["COM_DISARM_LAND"])

    def follow_time(self) -> None:
        """Leave OFFBOARD once setpoints are too old, and TAKEOFF once it is complete."""
        if self.now >= self.pilot.silent_at:
            self.pilot.silent_at = NEVER
        if self._mode is Px4Mode.OFFBOARD and not self.fresh and self.pilot.airborne:
            self._lost = True
            self.say(CRITICAL, "Offboard control signal lost")
            self.enter(services.LOST_STREAM.get(int(self.parameters["COM_OBL_RC_ACT"]), Px4Mode.RTL))
        elif self._mode is Px4Mode.TAKEOFF and self.pilot.airborne and self.pilot.takeoff_m is None:
            self._intended = Px4Mode.HOLD
            self.enter(Px4Mode.HOLD)

    @abstractmethod
    def fly_there(self, position_m: Vector, speed_mps: float) -> None:
        """Fly straight to a position, north, east and above the origin, and stay; a speed of 0 or less is none."""

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float, speed_mps: float = 0.0) -> None:
        """Fly to a position, unless its height isn't finite; a speed of 0 or less is none."""
        if math.isfinite(height_m):
            north_m, east_m, _ = self.origin.to_ned(lat_rad, lon_rad, self.origin.alt_m)
            self.fly_there((north_m, east_m, height_m), speed_mps)

    def tell_heartbeat(self) -> None:
        """Report a change at once by CURRENT_MODE, if that was requested; heartbeats come once a second."""
        if self.streams.interval_us(m.MAVLINK_MSG_ID_CURRENT_MODE) > 0:
            self.broadcast(services.current_mode(self))

    def say(self, severity: int, text: str) -> None:
        """Send a text, in chunks if it is long; keep it as long as no ground station's heartbeat has come."""
        self._texts = self._texts % 255 + 1
        long = len(text) >= TEXT_BYTES
        for number in range(0, len(text) + 1 if long else 1, TEXT_BYTES):
            part = Statustext(
                severity, text[number : number + TEXT_BYTES], self._texts if long else 0, number // TEXT_BYTES
            )
            if self._greeted:
                self.broadcast(part)
            elif len(self._unsaid) < KEPT_TEXTS:
                self._unsaid.append(part)

    def take_setpoint(self, setpoint: Setpoint) -> None:
        """Take a setpoint, and fly it in OFFBOARD; if OFFBOARD was left because none came, return to it."""
        if (refusal := services.refusal_of(setpoint)) is not None:
            self.say(CRITICAL, refusal)
        else:
            self._fresh_until = after(self.now, self.parameters["COM_OF_LOSS_T"])
            if self._lost:
                self._lost = False
                self.enter(Px4Mode.OFFBOARD)
            if self._mode is Px4Mode.OFFBOARD:
                self.follow(setpoint)
                self.pilot.silent_at = self._fresh_until

    def take_heartbeat(self, system: int, mav_type: int) -> None:
        """Note a ground station's heartbeat, and send the texts that were kept until the first."""
        if mav_type != m.MAV_TYPE_GCS:
            return
        super().take_heartbeat(system, mav_type)
        self._greeted = True
        for text in self._unsaid:
            self.broadcast(text)
        self._unsaid.clear()

    def _climb_in_takeoff(self) -> None:
        """Begin to climb if TAKEOFF is its mode, by default to MIS_TAKEOFF_ALT."""
        if self._mode is Px4Mode.TAKEOFF:
            self.disarm_at = NEVER
            self.lift_off(self._rise_m or self.parameters["MIS_TAKEOFF_ALT"])

    def forget(self) -> None:
        """Forget modes, setpoints and texts, at boot."""
        self._mode = self._intended = Px4Mode.HOLD
        self._rise_m, self._lost, self._greeted, self._texts = 0.0, False, False, 0
        self._unsaid, self._fresh_until = [], self.now
