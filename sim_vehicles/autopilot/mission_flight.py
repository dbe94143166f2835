"""ArduPlane's flight by a mission, in AUTO.

Source: ArduPilot documentation, "Plane: AUTO mode"; answers of ArduPlane 4.7. The vehicle flies straight from its
position to the item's. Conditions are met at once, and what is done with servos and cameras has no effect.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from flight_model.earth import GeodeticOrigin
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.autopilot.mission_items import E7, Item
from sim_vehicles.autopilot.missions import Missions
from sim_vehicles.autopilot.parameters import ParameterServer
from sim_vehicles.autopilot.pilot import PlanePilot, Target

MAX_STEPS = 100
"""Most items completed in one cycle of the main loop; a mission that exceeds it only jumps, and counts as ended."""
ON_CIRCLE = 1.2
"""Turns and time of a circle count from within this many radii of its centre."""
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
        for _ in range(MAX_STEPS):
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
        self._leg = leg = Leg(seq, item, here, self._position(item) if item.x or item.y else here, height_m)
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

    def _position(self, item: Item) -> tuple[float, float]:
        lat_rad, lon_rad = math.radians(item.x / E7), math.radians(item.y / E7)
        return self._origin.to_ned(lat_rad, lon_rad, self._origin.alt_m)[:2]
