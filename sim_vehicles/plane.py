"""An emulated ArduPlane: what it does otherwise than other families, its flight by a mission among it.

Source: ArduPilot documentation, "Plane: AUTO mode". The vehicle flies straight from its position to the item's;
circles have the radius WP_LOITER_RAD, whatever the item asks for.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.messages.mission import MissionItemReached
from flight_model.earth import GeodeticOrigin
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.autopilot import commands
from sim_vehicles.autopilot.board_clock import delayed
from sim_vehicles.autopilot.failsafe import LONG_FAILSAFE
from sim_vehicles.autopilot.missions import E7, Item, Missions
from sim_vehicles.autopilot.modes import STRAIGHT_ON, FlightMode, Mode, select
from sim_vehicles.autopilot.parameters import ParameterServer, planes
from sim_vehicles.autopilot.pilot import Pilot, Target
from sim_vehicles.autopilot.telemetry import UNASKED
from sim_vehicles.config import VehicleConfig
from sim_vehicles.vehicle import WARNING, Vehicle

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet

MOST_STEPS = 100
"""Items completed in one cycle of the main loop; a mission that exceeds it only jumps, and counts as ended."""
ON_CIRCLE = 1.2
"""Turns and seconds of a circle count from within this many radii of its centre."""
CIRCLES = frozenset({m.MAV_CMD_NAV_LOITER_UNLIM, m.MAV_CMD_NAV_LOITER_TURNS, m.MAV_CMD_NAV_LOITER_TIME})
PLACES = CIRCLES | {m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_TAKEOFF}
"""Commands that take time to fly; all others are completed at once."""


class Leg(NamedTuple):
    """The item being flown: start and end, north and east, and height, m from the origin."""

    seq: int
    start_m: tuple[float, float]
    to_m: tuple[float, float]
    height_m: float


class MissionFlight:
    """Flies a vehicle through its mission while it is armed and in AUTO."""

    def __init__(self, missions: Missions, pilot: Pilot, parameters: ParameterServer, origin: GeodeticOrigin) -> None:
        """Steer by `pilot`."""
        self._missions, self._pilot, self._parameters, self._origin = missions, pilot, parameters, origin
        self._jumps: Counter[int] = Counter()
        self._leg: Leg | None = None
        self._circling_since: Instant | None = None
        self._circling_from_rad = 0.0

    def resume(self) -> None:
        """Restart the current item, or start the mission: AUTO was entered, or the vehicle was armed in it."""
        self._leg = None
        self._missions.state = m.MISSION_STATE_ACTIVE
        if self._missions.current == 0:
            self._jumps.clear()
            self._missions.choose(0)

    def pause(self) -> None:
        """Suspend the current item: another mode was entered."""
        if not self.over:
            self._missions.state = m.MISSION_STATE_PAUSED

    @property
    def over(self) -> bool:
        """Whether the mission has been flown to its end."""
        return self._missions.state == m.MISSION_STATE_COMPLETE

    def turn(self, motion: Motion, now: Instant) -> list[int]:
        """Run one cycle of the main loop; return the items completed. At the mission's end its state is complete."""
        missions, done = self._missions, list[int]()
        for _ in range(MOST_STEPS):
            if missions.current == 0:
                break
            seq, item = missions.current, missions.items[missions.current]
            if self._leg is None or self._leg.seq != seq:
                self._begin(seq, item, motion)
            if not self._is_done(item, motion, now):
                return done
            if item.command in PLACES:
                done.append(seq)
            self._advance(item)
        missions.current, missions.state = 0, m.MISSION_STATE_COMPLETE
        return done

    def _begin(self, seq: int, item: Item, motion: Motion) -> None:
        here = motion.north_m, motion.east_m
        height_m = item.z - (self._origin.alt_m if item.frame == m.MAV_FRAME_GLOBAL else 0.0)
        if item.z == 0.0 and item.frame != m.MAV_FRAME_GLOBAL:
            height_m = motion.height_m
        self._leg = Leg(seq, here, self._place(item) if item.x or item.y else here, height_m)
        self._circling_since = None
        if item.command == m.MAV_CMD_NAV_TAKEOFF:
            self._pilot.take_off(height_m, motion)
        elif item.command in CIRCLES:
            self._pilot.circle(*self._leg.to_m, height_m)
        elif item.command == m.MAV_CMD_NAV_WAYPOINT:
            self._pilot.target = Target(*self._leg.to_m, here)
            self._pilot.change_height(height_m)
        elif item.command == m.MAV_CMD_DO_CHANGE_SPEED and self._parameters.is_airspeed(item.params[1]):
            self._pilot.change_speed(item.params[1], math.inf)

    def _is_done(self, item: Item, motion: Motion, now: Instant) -> bool:
        if item.command not in PLACES:
            return True
        if not self._pilot.airborne or self._leg is None:
            return False
        if item.command == m.MAV_CMD_NAV_TAKEOFF:
            return self._pilot.takeoff_m is None
        north_m, east_m = self._leg.to_m[0] - motion.north_m, self._leg.to_m[1] - motion.east_m
        if item.command in CIRCLES:
            return self._has_circled(item, math.hypot(north_m, east_m), motion, now)
        self._pilot.steer(math.atan2(east_m, north_m), course=True, lateral_mps2=math.inf)
        leg_m = self._leg.to_m[0] - self._leg.start_m[0], self._leg.to_m[1] - self._leg.start_m[1]
        passed = north_m * leg_m[0] + east_m * leg_m[1] <= 0.0
        return passed or math.hypot(north_m, east_m) <= (item.params[1] or self._parameters["WP_RADIUS"])

    def _has_circled(self, item: Item, distance_m: float, motion: Motion, now: Instant) -> bool:
        """Return whether the circle has been flown for the time, or the number of turns, that the item asks for."""
        if self._circling_since is None:
            if distance_m > ON_CIRCLE * self._pilot.radius_m:
                return False
            self._circling_since, self._circling_from_rad = now, motion.heading_rad
        if item.command == m.MAV_CMD_NAV_LOITER_TIME:
            return seconds_between(self._circling_since, now) >= item.params[0]
        turns = abs(motion.heading_rad - self._circling_from_rad) / math.tau
        return item.command == m.MAV_CMD_NAV_LOITER_TURNS and turns >= item.params[0]

    def _advance(self, item: Item) -> None:
        """Select the next item, or the one that this item jumps to; 0 at the end."""
        missions, seq = self._missions, self._missions.current
        missions.current = seq + 1 if seq + 1 < len(missions.items) else 0
        target, times = item.params[:2]
        if item.command == m.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            missions.current = 0
        elif item.command == m.MAV_CMD_DO_JUMP and (times < 0 or self._jumps[seq] < times):
            self._jumps[seq] += 1
            missions.current = int(target) if 0 < target < len(missions.items) else 0
        self._leg = None

    def _place(self, item: Item) -> tuple[float, float]:
        lat_rad, lon_rad = math.radians(item.x / E7), math.radians(item.y / E7)
        return self._origin.to_ned(lat_rad, lon_rad, self._origin.alt_m)[:2]


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

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""
        return Mode[name]

    def landed(self) -> None:
        """Disarm a while after it has touched down."""
        self.disarm_at = delayed(self.now, self.parameters["LAND_DISARMDELAY"])

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
