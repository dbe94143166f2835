"""Emulated PX4s: how they differ from ArduPilot's vehicles, and the fixed wing; the multirotor is in `px4_copter`."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Final

from airlink import mavlink as m
from airlink.clock import NEVER, Instant, after
from airlink.messages.system import Statustext
from sim_vehicles.airframe.motion import Steering
from sim_vehicles.autopilot import position_targets, px4_services
from sim_vehicles.autopilot.board_clock import delayed
from sim_vehicles.autopilot.commands import CommandHandlers
from sim_vehicles.autopilot.message_handler import MessageHandler, Px4MessageHandler
from sim_vehicles.autopilot.modes_and_failsafe import (
    PX4_AS_PLANE,
    PX4_BY_STICKS,
    PX4_NOT_ARMABLE,
    Condition,
    FlightMode,
    GroundStationFailsafe,
    Mode,
    Px4Mode,
    Request,
    select,
)
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import PlanePilot
from sim_vehicles.autopilot.position_targets import Setpoint, Vector
from sim_vehicles.config import VehicleConfig
from sim_vehicles.vehicle import CRITICAL, INFO, Vehicle

TEXT_BYTES: Final = 50
KEPT_TEXTS: Final = 16
"""Texts that wait for a ground station."""
REFERENCE_CLIMB_MPS: Final = 3.0
"""A fixed wing's height reference begins at sea level at boot and rises this fast."""


class Px4(Vehicle):
    """What emulated PX4s have in common."""

    capabilities = 59647
    version = 1 << 24 | 17 << 16
    unasked = px4_services.STREAMS
    builders = px4_services.BUILDERS
    asks_time = False
    tells_time_at_once = True
    stores_missions = False
    locks = True
    guided_mode = Px4Mode.HOLD
    by_hand = PX4_BY_STICKS
    armed_text = "Armed by external command"
    disarmed_text = "Disarmed"
    command_handlers: ClassVar[CommandHandlers] = px4_services.HANDLERS
    """What carries out each command that it knows."""
    flown: ClassVar[Mapping[Px4Mode, FlightMode]]
    """Its modes, and for each the mode of ArduPilot that its pilot flies."""
    mode: Px4Mode
    intended: Px4Mode
    """What was last asked for; a failsafe flies another."""
    _rise_m: float
    _lost: bool
    _greeted: bool
    _unsaid: list[Statustext]
    _texts: int
    _fresh_until: Instant

    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return PX4's parameters for its kind."""
        return px4_services.Px4Parameters(px4_services.parameters(config, self.fleet.config.cruise_mps))

    @abstractmethod
    def change_speed(self, speed_mps: float) -> None:
        """Fly at a speed in HOLD from now on."""

    @abstractmethod
    def change_height(self, height_m: float) -> None:
        """Fly at a height above the origin in HOLD."""

    @abstractmethod
    def lift_off(self, height_m: float) -> None:
        """Begin to climb to a height above home."""

    @abstractmethod
    def follow(self, message: Setpoint) -> None:
        """Fly a setpoint of OFFBOARD."""

    @property
    def fresh(self) -> bool:
        """Whether the last setpoint is younger than COM_OF_LOSS_T."""
        return self.now < self._fresh_until

    @property
    def armable(self) -> bool:
        """Whether it is ready, and its mode can be armed in: its inputs are there, and it doesn't end a flight."""
        lacks = not self.fresh if self.mode is Px4Mode.OFFBOARD else self.mode in PX4_BY_STICKS and not self.sticks
        return self.ready and not lacks and self.mode not in PX4_NOT_ARMABLE

    @property
    def in_failsafe(self) -> bool:
        """Whether its ground station's heartbeats or its setpoints are missing."""
        return self.failsafe.active or self._lost

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already; the next HEARTBEAT reports it."""
        if mode is not self.mode:
            self.mode = Px4Mode(mode)
            self.pilot.enter(self.flown[self.mode], self.body.motion)
            self.pilot.silent_at = self._fresh_until if self.mode is Px4Mode.OFFBOARD else NEVER
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
        self.intended, self._lost = Px4Mode(chosen), False
        self.enter(self.intended)
        if self.pilot.condition is Condition.ARMED:
            self._climb_in_takeoff()
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm, and take off if that is its mode; refused while it isn't armable."""
        if not force and not self.armable:
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
        if granted and landed and self.mode in PX4_NOT_ARMABLE:
            self.switch(Px4Mode.HOLD)
        return granted

    def prepare(self, height_m: float) -> bool:
        """Change to TAKEOFF on the ground, to a height; armed, it climbs. Return whether that was allowed."""
        self._rise_m = height_m
        return not self.pilot.airborne and self.switch(Px4Mode.TAKEOFF)

    def message_handler(self) -> MessageHandler:
        """Return what takes its messages, and knows PX4's commands."""
        return Px4MessageHandler(self, self.command_handlers)

    def failsafe_of(self) -> GroundStationFailsafe:
        """Return its failsafe for the end of the ground station's heartbeats."""
        return px4_services.LinkLoss(self.parameters)

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
        if self.mode is Px4Mode.OFFBOARD and not self.fresh and self.pilot.airborne:
            self._lost = True
            self.say(CRITICAL, "Offboard control signal lost")
            self.enter(px4_services.LOST_STREAM.get(int(self.parameters["COM_OBL_RC_ACT"]), Px4Mode.RTL))
        elif self.mode is Px4Mode.TAKEOFF and self.pilot.airborne and self.pilot.takeoff_m is None:
            self.intended = Px4Mode.HOLD
            self.enter(Px4Mode.HOLD)

    @abstractmethod
    def fly_there(self, place_m: Vector, speed_mps: float) -> None:
        """Fly straight to a place, north, east and above the origin, and stay there; a speed of 0 or less is none."""

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float, speed_mps: float = 0.0) -> None:
        """Fly to a place, unless its height isn't finite; a speed of 0 or less is none."""
        if math.isfinite(height_m):
            north_m, east_m, _ = self.fleet.origin.to_ned(lat_rad, lon_rad, self.fleet.origin.alt_m)
            self.fly_there((north_m, east_m, height_m), speed_mps)

    def airspeed(self, speed_mps: float) -> float:
        """Return an airspeed limited to its range; that it is limited is not reported."""
        return min(max(speed_mps, self.parameters["FW_AIRSPD_MIN"]), self.parameters["FW_AIRSPD_MAX"])

    def tell_heartbeat(self) -> None:
        """Report a change at once by CURRENT_MODE, if that was requested; heartbeats come once a second."""
        if self.streams.interval_us(m.MAVLINK_MSG_ID_CURRENT_MODE) > 0:
            self.broadcast(px4_services.current_mode(self))

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
        if (refusal := position_targets.refusal_of_px4(setpoint)) is not None:
            self.say(CRITICAL, refusal)
        else:
            self._fresh_until = after(self.now, self.parameters["COM_OF_LOSS_T"])
            if self._lost:
                self._lost = False
                self.enter(Px4Mode.OFFBOARD)
            if self.mode is Px4Mode.OFFBOARD:
                self.follow(setpoint)
                self.pilot.silent_at = self._fresh_until

    def say_kept(self) -> None:
        """Send the texts that were kept until a ground station's first heartbeat."""
        self._greeted = True
        for text in self._unsaid:
            self.broadcast(text)
        self._unsaid.clear()

    def _climb_in_takeoff(self) -> None:
        """Begin to climb if TAKEOFF is its mode, by default to MIS_TAKEOFF_ALT."""
        if self.mode is Px4Mode.TAKEOFF:
            self.disarm_at = NEVER
            self.lift_off(self._rise_m or self.parameters["MIS_TAKEOFF_ALT"])

    def forget(self) -> None:
        """Forget modes, setpoints and texts, at boot."""
        self.mode = self.intended = Px4Mode.HOLD
        self._rise_m, self._lost, self._greeted, self._texts = 0.0, False, False, 0
        self._unsaid, self._fresh_until = [], self.now


class Px4Plane(Px4):
    """An emulated fixed-wing PX4."""

    mav_type = m.MAV_TYPE_FIXED_WING
    flown = PX4_AS_PLANE
    boot_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    ground_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    air_mode = PX4_AS_PLANE[Px4Mode.HOLD]
    flier: PlanePilot
    """Its pilot, typed as such."""

    def pilot_of(self, config: VehicleConfig, steering: Steering) -> PlanePilot:
        """Return who flies a fixed wing."""
        self.flier = PlanePilot(config, steering, self.parameters)
        return self.flier

    def change_speed(self, speed_mps: float) -> None:
        """Fly at an airspeed in HOLD from now on."""
        self.flier.change_speed(self.airspeed(speed_mps), math.inf)

    def change_height(self, height_m: float) -> None:
        """Circle at a height above the origin."""
        self.flier.change_height(height_m)

    def lift_off(self, height_m: float) -> None:
        """Roll and climb."""
        self.pilot.enter(Mode.TAKEOFF, self.body.motion)
        self.flier.take_off(height_m, self.body.motion)

    def follow(self, message: Setpoint) -> None:
        """Fly to a place at its trim speed, whatever speed is asked for; a velocity without a place is ignored."""
        place_m = position_targets.place_of(self, message)
        if place_m is not None:
            self.flier.change_speed(self.parameters["FW_AIRSPD_TRIM"], math.inf)
            self.flier.circle(*place_m)

    def follow_time(self) -> None:
        """Crash if it took off before its height reference had risen to the field's altitude."""
        super().follow_time()
        climbs = self.mode is Px4Mode.TAKEOFF and self.pilot.airborne
        if climbs and REFERENCE_CLIMB_MPS * self.time_s < self.fleet.origin.alt_m:
            self.crash(Request.CRASH)

    def fly_there(self, place_m: Vector, speed_mps: float) -> None:
        """Fly straight to a place far away, and circle it."""
        if speed_mps > 0.0:
            self.flier.change_speed(self.airspeed(speed_mps), math.inf)
        self.flier.circle(*place_m)
