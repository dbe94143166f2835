"""An emulated ArduPlane: what it does otherwise than other families, its flight by a mission among it.

Source: ArduPilot documentation, "Plane: AUTO mode"; answers of ArduPlane 4.7. The vehicle flies straight from its
position to the item's. Conditions are met at once, and what is done with servos and cameras has no effect.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.frame import Frame
from airlink.messages.command import SetPositionTargetGlobalInt
from airlink.messages.mission import MissionItemReached
from flight_model.autopilot_model import wrap
from flight_model.earth import GeodeticOrigin
from flight_model.energy import GRAVITY_MPS2
from sim_vehicles.airframe.motion import Motion, Steering
from sim_vehicles.autopilot import commands, position_targets
from sim_vehicles.autopilot.board_clock import delayed
from sim_vehicles.autopilot.mission_items import E7, Item
from sim_vehicles.autopilot.missions import Missions
from sim_vehicles.autopilot.modes_and_failsafe import LONG_FAILSAFE, STRAIGHT_ON, FlightMode, Mode, select
from sim_vehicles.autopilot.parameters import LOITER_RADIUS_M, ParameterKind, ParameterServer, floating
from sim_vehicles.autopilot.pilot import PlanePilot, Target
from sim_vehicles.autopilot.telemetry import UNASKED
from sim_vehicles.config import VehicleConfig
from sim_vehicles.vehicle import INFO, WARNING, Vehicle

if TYPE_CHECKING:
    from sim_vehicles.fleet import Fleet

MOST_STEPS = 100
"""Items completed in one cycle of the main loop; a mission that exceeds it only jumps, and counts as ended."""
ON_CIRCLE = 1.2
"""Turns and seconds of a circle count from within this many radii of its centre."""
AT_HEIGHT_M = 5.0
"""A height is reached within this."""
RADIUS_IN = {
    m.MAV_CMD_NAV_LOITER_UNLIM: 2,
    m.MAV_CMD_NAV_LOITER_TURNS: 2,
    m.MAV_CMD_NAV_LOITER_TIME: 2,
    m.MAV_CMD_NAV_LOITER_TO_ALT: 1,
}
"""Commands that circle, and which of the parameters has the side and the radius: 0 and 1 stand for WP_LOITER_RAD."""
TIMED = frozenset({m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_TAKEOFF, m.MAV_CMD_NAV_LAND, *RADIUS_IN}) | {
    m.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT
}
"""Commands that take time to fly; all others are completed at once."""
WIDER_THAN_TIGHTEST = 1.3
"""Radius of circles by that of the tightest turn, if that is more."""
ROLL_LIMIT_DEG = 45.0
JUMPS = frozenset({m.MAV_CMD_DO_JUMP, m.MAV_CMD_DO_JUMP_TAG})


class Leg(NamedTuple):
    """The item being flown, as it was when that began: start and end, north and east, and height, m from the origin."""

    seq: int
    item: Item
    start_m: tuple[float, float]
    to_m: tuple[float, float]
    height_m: float


class MissionFlight:
    """Flies a vehicle through its mission while it is armed and in AUTO."""

    def __init__(
        self, missions: Missions, pilot: PlanePilot, parameters: ParameterServer, origin: GeodeticOrigin
    ) -> None:
        """Steer by `pilot`."""
        self._missions, self._pilot, self._parameters, self._origin = missions, pilot, parameters, origin
        self._jumps: Counter[int] = Counter()
        self._leg: Leg | None = None
        self._circling_since: Instant | None = None
        self._circling_from_rad = 0.0
        self.ended = False
        """Whether nothing is left to fly but home."""

    def resume(self) -> None:
        """Restart the current item, or start the mission: AUTO was entered, or the vehicle was armed in it."""
        self._leg, missions = None, self._missions
        if missions.state == m.MISSION_STATE_COMPLETE or not 0 < missions.current < len(missions.items):
            self._jumps.clear()
            missions.choose(0)
        missions.state, self.ended = m.MISSION_STATE_ACTIVE, False

    def pause(self) -> None:
        """Suspend the current item: another mode was entered."""
        if self._missions.state != m.MISSION_STATE_COMPLETE:
            self._missions.state = m.MISSION_STATE_NOT_STARTED

    def turn(self, motion: Motion, now: Instant) -> list[int]:
        """Run one cycle of the main loop; return the items completed.

        At the mission's end its state is complete; at an item that returns to launch it waits there, as if left.
        """
        missions, done = self._missions, list[int]()
        for _ in range(MOST_STEPS):
            leg = self._leg
            if leg is None or leg.seq != missions.current or not missions.flyable:
                if missions.current >= len(missions.items):
                    break
                leg = self._begin(missions.current, missions.items[missions.current], motion)
            if not self._is_done(leg, motion, now):
                return done
            if leg.item.command in TIMED:
                done.append(leg.seq)
            following = self._following(leg)
            if not following:
                break
            missions.current, self._leg = following, None
        self.ended, waits = True, self._leg is not None and self._leg.item.command == m.MAV_CMD_NAV_RETURN_TO_LAUNCH
        missions.state = m.MISSION_STATE_NOT_STARTED if waits else m.MISSION_STATE_COMPLETE
        return done

    def _begin(self, seq: int, item: Item, motion: Motion) -> Leg:
        here, pilot = (motion.north_m, motion.east_m), self._pilot
        height_m = item.z - (self._origin.alt_m if item.frame == m.MAV_FRAME_GLOBAL else 0.0)
        if item.z == 0.0 and item.frame != m.MAV_FRAME_GLOBAL:
            height_m = motion.height_m
        self._leg = leg = Leg(seq, item, here, self._place(item) if item.x or item.y else here, height_m)
        self._circling_since, pilot.final = None, None
        if item.command in RADIUS_IN:
            pilot.circle(*leg.to_m, height_m, self._radius_m(item))
        elif item.command == m.MAV_CMD_NAV_TAKEOFF:
            pilot.take_off(height_m, motion)
        elif item.command == m.MAV_CMD_NAV_LAND:
            pilot.land_at(*leg.to_m, motion)
        elif item.command == m.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT:
            pilot.change_height(height_m)
            pilot.steer(motion.heading_rad, course=False, lateral_mps2=math.inf)
        elif item.command == m.MAV_CMD_NAV_WAYPOINT:
            pilot.target = Target(*leg.to_m, here)
            pilot.change_height(height_m)
        elif item.command == m.MAV_CMD_DO_CHANGE_SPEED and self._parameters.is_airspeed(item.params[1]):
            pilot.change_speed(item.params[1], math.inf)
        return leg

    def _radius_m(self, item: Item) -> float:
        """Return the radius of an item's circle, negative of one that goes anticlockwise; the side is the item's."""
        asked_m = item.params[RADIUS_IN[item.command]]
        size_m = abs(asked_m) if abs(asked_m) > 1.0 else abs(self._parameters["WP_LOITER_RAD"])
        return math.copysign(size_m, asked_m)

    def _is_done(self, leg: Leg, motion: Motion, now: Instant) -> bool:
        item = leg.item
        if item.command not in TIMED:
            return True
        if not self._pilot.airborne or item.command == m.MAV_CMD_NAV_LAND:
            return False
        if item.command == m.MAV_CMD_NAV_TAKEOFF:
            return self._pilot.takeoff_m is None
        if item.command == m.MAV_CMD_NAV_CONTINUE_AND_CHANGE_ALT:
            return abs(motion.height_m - leg.height_m) < AT_HEIGHT_M
        north_m, east_m = leg.to_m[0] - motion.north_m, leg.to_m[1] - motion.east_m
        if item.command in RADIUS_IN:
            return self._has_circled(leg, math.hypot(north_m, east_m), motion, now)
        self._pilot.steer(math.atan2(east_m, north_m), course=True, lateral_mps2=math.inf)
        leg_m = leg.to_m[0] - leg.start_m[0], leg.to_m[1] - leg.start_m[1]
        passed = north_m * leg_m[0] + east_m * leg_m[1] <= 0.0
        return passed or math.hypot(north_m, east_m) <= (item.params[1] or self._parameters["WP_RADIUS"])

    def _has_circled(self, leg: Leg, distance_m: float, motion: Motion, now: Instant) -> bool:
        """Return whether it has circled for the time, the number of turns, or to the height, that the item asks for."""
        item = leg.item
        if self._circling_since is None:
            if distance_m > ON_CIRCLE * self._pilot.radius_m:
                return False
            self._circling_since, self._circling_from_rad = now, motion.heading_rad
        if item.command == m.MAV_CMD_NAV_LOITER_TIME:
            return seconds_between(self._circling_since, now) >= item.params[0]
        if item.command == m.MAV_CMD_NAV_LOITER_TO_ALT:
            return abs(motion.height_m - leg.height_m) < AT_HEIGHT_M
        turns = abs(motion.heading_rad - self._circling_from_rad) / math.tau
        return item.command == m.MAV_CMD_NAV_LOITER_TURNS and turns >= item.params[0]

    def _following(self, leg: Leg) -> int:
        """Return the number of the next item, or of the one that this item jumps to; 0 at the end."""
        items, seq, item = self._missions.items, leg.seq, leg.item
        following = seq + 1
        target, times = item.params[:2]
        if item.command == m.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return 0
        if item.command in JUMPS and (times < 0 or self._jumps[seq] < times):
            self._jumps[seq] += 1
            following = int(target) if item.command == m.MAV_CMD_DO_JUMP else self._tagged(target)
        return following if 0 < following < len(items) else 0

    def _tagged(self, tag: float) -> int:
        """Return the number of the item that has a tag, 0 if none has."""
        tags = ((each.command, each.params[0]) for each in self._missions.items)
        return next((seq for seq, found in enumerate(tags) if found == (m.MAV_CMD_JUMP_TAG, tag)), 0)

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
    flier: PlanePilot
    """Its pilot, typed as such."""

    def __init__(self, index: int, config: VehicleConfig, fleet: Fleet, now: Instant) -> None:
        """Boot at `now`."""
        self._arrives = False
        """Whether it is on its way to a place that it was told in GUIDED."""
        super().__init__(index, config, fleet, now)
        self._mission_flight = MissionFlight(self.missions, self.flier, self.parameters, fleet.origin)

    def parameters_of(self, config: VehicleConfig) -> ParameterServer:
        """Return ArduPlane's parameters."""
        return ParameterServer(plane_parameters(config, self.fleet.config.cruise_mps))

    def pilot_of(self, config: VehicleConfig, steering: Steering) -> PlanePilot:
        """Return who flies a fixed wing."""
        self.flier = PlanePilot(config, steering, self.parameters)
        return self.flier

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
            self._arrives = False
            self.missions.in_mode = mode is Mode.AUTO
            self._begin_mission()
            self.tell_heartbeat()

    def switch(self, number: float) -> bool:
        """Change to a mode by its number; return whether that was allowed. AUTOLAND needs the take-off's direction."""
        mode = select(self.pilot.condition, number)
        if number not in frozenset(Mode):
            self.say(WARNING, f"No such mode {number:g}")
        if mode == Mode.AUTOLAND and (not self.pilot.airborne or self.flier.landing_rad is None):
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
        if self.flier.guided_by_setpoints:
            height_m = self.body.steering.height_m
        self.flier.circle_guided(north_m, east_m, height_m)
        self._arrives = True

    def ask_circle(self, radius_m: float, side: float) -> None:
        """Take the radius and the side of the circles that it is told next in GUIDED."""
        self.flier.ask_circle(radius_m, side)

    def climb_to(self, height_m: float) -> None:
        """Climb or sink to a height, unless setpoints have told one."""
        if not self.flier.guided_by_setpoints:
            self.flier.change_height(height_m)

    def take_other(self, frame: Frame) -> bool:
        """Take a setpoint of place, of which an ArduPlane flies the height alone; return whether the frame is one.

        Source: ArduPlane, `handle_set_position_target_local_ned` and `..._global_int`.
        """
        message = frame.message
        if not isinstance(message, position_targets.MESSAGES):
            return False
        if self.pilot.mode is Mode.GUIDED and not self.ignores:
            height_m = self._told_height_m(message)
            if height_m is not None:
                self.climb_to(height_m)
        return True

    def _told_height_m(self, setpoint: position_targets.Setpoint) -> float | None:
        """Return the height above the origin that a setpoint tells, or None."""
        if isinstance(setpoint, SetPositionTargetGlobalInt):
            if setpoint.coordinate_frame not in commands.ABOVE_SEA_LEVEL + commands.ABOVE_HOME:
                self.say(WARNING, "Invalid coord frame in SET_POSTION_TARGET_GLOBAL_INT")
            ignored = setpoint.type_mask & m.POSITION_TARGET_TYPEMASK_Z_IGNORE
            return None if ignored else commands.height_of(self, setpoint.alt_m, setpoint.coordinate_frame)
        if setpoint.coordinate_frame != m.MAV_FRAME_LOCAL_OFFSET_NED or not abs(setpoint.z_m) <= commands.HIGHEST_M:
            return None
        height_m = self.body.steering.height_m - setpoint.z_m
        self.say(INFO, f"Change alt to {height_m:.1f}")
        return height_m

    def mode_named(self, name: str) -> FlightMode:
        """Return a mode by its name."""
        return Mode[name]

    def landed(self) -> None:
        """Turn the nose along the way over ground, as it touches down in a crosswind, and disarm a while later."""
        state, (north_mps, east_mps, _) = self.body.state, self.body.ground_velocity()
        state.heading_rad += wrap(math.atan2(east_mps, north_mps) - state.heading_rad)
        self.disarm_at = delayed(self.now, self.parameters["LAND_DISARMDELAY"])

    def _begin_mission(self) -> None:
        if self.flies_mission:
            self._mission_flight.resume()

    def follow_time(self) -> None:
        """Continue a mission, and tell of the arrival at a place."""
        if self._arrives and self.flier.to_go(self.body.motion)[1] < ON_CIRCLE * self.flier.radius_m:
            self._arrives = False
            self.broadcast(MissionItemReached(0))
        if self.flies_mission:
            for seq in self._mission_flight.turn(self.body.motion, self.now):
                self.broadcast(MissionItemReached(seq))
            if self._mission_flight.ended:
                self.enter(Mode.RTL)


def plane_parameters(config: VehicleConfig, cruise_mps: float) -> dict[str, ParameterKind]:
    """Return ArduPlane's parameters for a vehicle, by their names."""
    model = config.model
    bank_deg = math.degrees(math.atan(model.speed_max_mps * model.turn_rate_max_rps / GRAVITY_MPS2))
    radius_m = math.ceil(max(LOITER_RADIUS_M, WIDER_THAN_TIGHTEST * (cruise_mps / model.turn_rate_max_rps)))
    return {
        "AIRSPEED_CRUISE": floating(5, 1000, cruise_mps),
        "AIRSPEED_MAX": ParameterKind(m.MAV_PARAM_TYPE_INT16, 5, 1000, math.ceil(model.speed_max_mps)),
        "AIRSPEED_MIN": ParameterKind(m.MAV_PARAM_TYPE_INT16, 5, 1000, math.floor(model.speed_min_mps)),
        "ARMING_CHECK": ParameterKind(m.MAV_PARAM_TYPE_INT32, 0, 2**24, 1),
        "AUTOLAND_WP_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT16, 10, 32767, 55),
        "AUTOLAND_WP_DIST": ParameterKind(m.MAV_PARAM_TYPE_INT16, 100, 32767, 400),
        "FS_GCS_ENABL": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 0),
        "FS_LONG_ACTN": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 0),
        "FS_LONG_TIMEOUT": floating(1, 1e6, 5),
        "LAND_DISARMDELAY": ParameterKind(m.MAV_PARAM_TYPE_INT8, 0, 127, 20),
        "MAV_GCS_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, 255),
        "MAV_SYSID": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 255, config.identity.system),
        "ROLL_LIMIT_DEG": floating(0, 90, max(ROLL_LIMIT_DEG, math.ceil(bank_deg))),
        "RTL_ALTITUDE": floating(-1, 1e5, 100),
        "TKOFF_ALT": ParameterKind(m.MAV_PARAM_TYPE_INT16, 0, 32767, 50),
        "WP_LOITER_RAD": ParameterKind(m.MAV_PARAM_TYPE_INT16, -32767, 32767, radius_m),
        "WP_RADIUS": ParameterKind(m.MAV_PARAM_TYPE_INT16, 1, 32767, 90),
    }
