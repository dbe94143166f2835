"""An emulated ArduPlane: what it does otherwise than other families, AUTO among it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.mission import MissionItem, MissionItemInt, MissionItemReached
from sim_vehicles.airframe.motion import Steering
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.failsafe import LONG_FAILSAFE
from sim_vehicles.autopilot.mission_flight import MissionFlight
from sim_vehicles.autopilot.modes import STRAIGHT_ON, FlightMode, Mode, select
from sim_vehicles.autopilot.parameters import ParameterServer, planes
from sim_vehicles.autopilot.pilot import Pilot
from sim_vehicles.autopilot.telemetry import UNASKED
from sim_vehicles.config import VehicleConfig
from sim_vehicles.vehicle import WARNING, Vehicle

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet


class Plane(Vehicle):
    """An emulated ArduPlane."""

    mav_type = m.MAV_TYPE_FIXED_WING
    capabilities = 62319
    unasked = UNASKED
    guided_mode = Mode.GUIDED
    ground_mode = Mode.MANUAL
    boot_mode = Mode.INITIALISING
    by_hand = STRAIGHT_ON | {Mode.INITIALISING}
    failsafe_keys = LONG_FAILSAFE
    handlers = commands.HANDLERS

    def __init__(self, index: int, config: VehicleConfig, fleet: Fleet, now: Instant) -> None:
        """Boot at `now`."""
        super().__init__(index, config, fleet, now)
        self._mission_flight = MissionFlight(self.missions, self.pilot, self.parameters, fleet.origin)

    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return ArduPlane's parameters."""
        return ParameterServer(planes(config, self.fleet.config.cruise_mps))

    def pilot_of(self, config: VehicleConfig, steering: Steering) -> Pilot:
        """Return who flies it, by sticks, setpoints or a mission."""
        return Pilot(config, steering, self.parameters)

    @property
    def flies_mission(self) -> bool:
        """Whether it flies by its stored mission."""
        return self.pilot.mode is Mode.AUTO and self.pilot.condition.armed

    def enter(self, mode: FlightMode) -> None:
        """Change to a mode, unless it is in it already, and report it at once. Without a mission AUTO becomes RTL."""
        if mode is Mode.AUTO and not self.missions.flyable:
            mode = Mode.RTL
        if mode is not self.pilot.mode:
            if self.pilot.mode is Mode.AUTO:
                self._mission_flight.pause()
            self.pilot.enter(mode, self.body.motion)
            self._begin_mission()
            self.tell_heartbeat()

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed. AUTOLAND needs the take-off's direction."""
        mode = select(self.pilot.condition, number)
        if number not in frozenset(Mode):
            self.say(WARNING, f"No such mode {number:g}")
        if mode == Mode.AUTOLAND and (not self.pilot.airborne or self.pilot.landing_rad is None):
            flies = self.pilot.airborne
            self.say(WARNING, "Takeoff initial direction not set" if flies else "Must already be flying!")
            return False
        if mode is not None:
            self.enter(Mode(mode))
        return mode is not None

    def arm(self, *, force: bool) -> bool:
        """Arm, and start the mission if that is its mode."""
        armed = super().arm(force=force)
        if armed:
            self._begin_mission()
        return armed

    def go_to(self, lat_rad: float, lon_rad: float, height_m: float) -> None:
        """Circle a position; a height that a setpoint has set is kept."""
        north_m, east_m, _ = self.fleet.origin.to_ned(lat_rad, lon_rad, self.fleet.origin.alt_m)
        if self.pilot.guided_by_setpoints:
            height_m = self.body.steering.height_m
        self.pilot.circle(north_m, east_m, height_m)

    def fly_to(self, item: MissionItem | MissionItemInt) -> int:
        """Circle a position at once, or climb to a height."""
        return commands.fly_to(self, item)

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""
        return Mode[name]

    def landed(self) -> None:
        """Disarm a while after it has touched down."""
        self.disarm_at = after(self.now, self.parameters["LAND_DISARMDELAY"])

    def _begin_mission(self) -> None:
        if self.flies_mission:
            self._mission_flight.resume()

    def follow_time(self) -> None:
        """Continue a mission."""
        if self.flies_mission:
            for seq in self._mission_flight.turn(self.body.motion, self.now):
                self.broadcast(MissionItemReached(seq))
            if self._mission_flight.over:
                self.enter(Mode.RTL)
