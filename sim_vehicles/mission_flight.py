"""AUTO: one item of the mission after another.

Source: ArduPilot documentation, "Plane: AUTO mode". Ways lead straight from where the vehicle is to the item's place;
circles have WP_LOITER_RAD, whatever radius the item asks for.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, seconds_between
from airlink.geodesy import GeodeticOrigin
from sim_vehicles.mission_items import E7, Item
from sim_vehicles.missions import Missions
from sim_vehicles.motion import Motion
from sim_vehicles.parameters import ParameterServer
from sim_vehicles.pilot import Pilot

MOST_STEPS = 100
"""Items done within one turn of the main loop; a mission that goes on like that only jumps, and has ended."""
ON_CIRCLE = 1.2
"""Within so many radii the turns and the seconds of a circle count."""
CIRCLES = frozenset({m.MAV_CMD_NAV_LOITER_UNLIM, m.MAV_CMD_NAV_LOITER_TURNS, m.MAV_CMD_NAV_LOITER_TIME})
PLACES = CIRCLES | {m.MAV_CMD_NAV_WAYPOINT, m.MAV_CMD_NAV_TAKEOFF}
"""Commands that are flown; the others take no time."""


class Leg(NamedTuple):
    """The item under way: from where to where, north, east and height in m from the origin."""

    seq: int
    start_m: tuple[float, float]
    to_m: tuple[float, float]
    height_m: float


class MissionFlight:
    """Flies a vehicle through its mission, for as long as it's in AUTO and armed."""

    def __init__(self, missions: Missions, pilot: Pilot, parameters: ParameterServer, origin: GeodeticOrigin) -> None:
        """Steer by `pilot`."""
        self._missions, self._pilot, self._parameters, self._origin = missions, pilot, parameters, origin
        self._jumps: Counter[int] = Counter()
        self._leg: Leg | None = None
        self._circling_since: Instant | None = None
        self._circling_from_rad = 0.0

    def resume(self) -> None:
        """Begin the item under way anew, or the mission: AUTO was entered, or the vehicle was armed in it."""
        self._leg = None
        self._missions.state = m.MISSION_STATE_ACTIVE
        if self._missions.current == 0:
            self._jumps.clear()
            self._missions.choose(0)

    def pause(self) -> None:
        """Leave the item under way for later: another mode was entered."""
        if not self.over:
            self._missions.state = m.MISSION_STATE_PAUSED

    @property
    def over(self) -> bool:
        """Whether the mission has been flown to its end."""
        return self._missions.state == m.MISSION_STATE_COMPLETE

    def turn(self, motion: Motion, now: Instant) -> list[int]:
        """Fly on for a turn of the main loop; return the items done. At the end, the missions' state is complete."""
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
        """Return whether a circle has been flown for as long, or as often, as the item asks for."""
        if self._circling_since is None:
            if distance_m > ON_CIRCLE * self._pilot.radius_m:
                return False
            self._circling_since, self._circling_from_rad = now, motion.heading_rad
        if item.command == m.MAV_CMD_NAV_LOITER_TIME:
            return seconds_between(self._circling_since, now) >= item.params[0]
        turns = (motion.heading_rad - self._circling_from_rad) / math.tau
        return item.command == m.MAV_CMD_NAV_LOITER_TURNS and turns >= item.params[0]

    def _advance(self, item: Item) -> None:
        """Go to the item after the one that is done, or to the one that it jumps to; 0 at the end."""
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
