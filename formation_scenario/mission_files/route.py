"""Where a mission goes: its items carried out on paper, jumps unrolled, speeds in force, circles.

Autopilots carry out a mission item by item. Here the same is done without an aircraft: what moves it becomes a point
of the route, what changes its speed becomes the speed of the leg that begins there, and everything else is named as
not carried out.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Final

from formation_scenario.mission_files import commands
from formation_scenario.mission_files.commands import name_of
from formation_scenario.mission_files.mission import FRAME_MISSION, Datum, Mission, MissionFileError, MissionItem

MAX_POINTS: Final = 20_000
"""Limit of a route with its jumps unrolled."""
SAME_POSITION_M: Final = 1.0
"""Points nearer than this to the one before are at its position: no leg leads from one to the other."""
SAME_HEIGHT_M: Final = 0.1
METRES_PER_DEGREE: Final = 111_320.0
DEFAULT_RADIUS_M: Final = 80.0
"""Radius of a circle that leaves it to the autopilot: NAV_LOITER_RAD's order of magnitude."""


@dataclass(frozen=True, slots=True)
class Circles:
    """Circles at a point: a number of turns, or a time; positive radius: clockwise, as MAVLink has it."""

    radius_m: float
    turns: float = math.nan
    seconds: float = math.nan


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """A point that the path goes through.

    `height_m` is above `datum`, NaN where the file has none. `speed_mps` is that of the leg that begins here, None
    where the file leaves it as it is.
    """

    where: str
    lat_deg: float
    lon_deg: float
    height_m: float
    datum: Datum
    speed_mps: float | None = None
    circles: Circles | None = None
    hold_s: float = 0.0
    """How long multirotors stay at it, beside a time of `circles`."""

    @property
    def hover_s(self) -> float | None:
        """How long a multirotor hovers here; None if it flies on."""
        if self.circles is not None and math.isfinite(self.circles.seconds):
            return self.hold_s + self.circles.seconds
        return self.hold_s or None


@dataclass(frozen=True, slots=True)
class Route:
    """The points that a mission goes through, and what of it isn't flown, in words."""

    points: tuple[RoutePoint, ...]
    remarks: tuple[str, ...]


def route_of(mission: Mission) -> Route:
    """Carry out a mission on paper.

    Raises:
        MissionFileError: an item in a frame that has no position on the Earth, a jump to an item that isn't there, or
            fewer than two points.
    """
    return _Executor(mission).run()


class _Executor:
    """Goes through a mission as an autopilot does."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._points = list[RoutePoint]()
        self._jumps_left = dict[int, int]()
        self._speed_mps: float | None = None
        self._ignored = defaultdict[int, list[str]](list)
        self._remarks = list(mission.remarks)

    def run(self) -> Route:
        index: int | None = 0
        while index is not None and index < len(self._mission.items):
            index = self._next(index, self._mission.items[index])
            if len(self._points) > MAX_POINTS:
                raise MissionFileError(f"{self._mission.file}: more than {MAX_POINTS} points with its jumps unrolled")
        if len(self._points) < 2:
            raise MissionFileError(
                f"{self._mission.file}: found {len(self._points)} waypoints to fly; allowed: 2 or more"
            )
        for command, items in self._ignored.items():
            numbers = ", ".join(items[:5]) + (f" and {len(items) - 5} more" if len(items) > 5 else "")
            self._remarks.append(f"{numbers}: {name_of(command)} isn't carried out")
        return Route(tuple(self._points), tuple(dict.fromkeys(self._remarks)))

    def _next(self, index: int, item: MissionItem) -> int | None:
        """Carry out one item; return the next one's index, None at the end."""
        command = item.command
        if command in commands.TAKEOFFS:
            self._remarks.append(f"{item.where}: vehicles take off by themselves; the path begins after it")
        elif command in commands.POINTS:
            self._append(item)
        elif command == commands.CHANGE_SPEED:
            self._change_speed(item)
        elif command == commands.DELAY and self._points:
            self._delay(item)
        elif command in (commands.JUMP, commands.JUMP_TO_TAG):
            return self._jump(index, item)
        elif command not in commands.ENDS and command != commands.JUMP_TAG:
            self._ignored[command].append(item.where)
        if command == commands.LAND_START and len(self._points) < 2:
            self._remarks.append(f"{item.where}: the path goes on at {name_of(command)}: nothing is flown before it")
        elif command in commands.ENDS:
            rest = len(self._mission.items) - index - 1
            after = f", with the {rest} items after it" if rest else ""
            if command != commands.LOITER_UNLIMITED or rest:
                self._remarks.append(f"{item.where}: the path ends at {name_of(command)}{after}")
            return None
        return index + 1

    def _append(self, item: MissionItem) -> None:
        datum = item.datum
        if datum is None:
            allowed = "0, 3, 10 (above sea level, home, ground) and their forms 5, 6, 11"
            named = "FRAME_MISSION" if item.frame == FRAME_MISSION else f"frame {item.frame}"
            raise MissionFileError(f"{item.where}: found {name_of(item.command)} in {named}; allowed: {allowed}")
        before = self._points[-1] if self._points else None
        if item.placed:
            point = RoutePoint(item.where, item.lat_deg, item.lon_deg, item.height_m, datum)
        elif before is not None:  # "where the vehicle is"
            point = replace(before, where=item.where, circles=None, hold_s=0.0)
        else:
            raise MissionFileError(f"{item.where}: found no position in the first waypoint")
        point = replace(point, speed_mps=self._speed_mps, circles=_circles(item), hold_s=_hold_s(item))
        if before is not None and _same_position(before, point):
            self._again(before, point)
        else:
            self._points.append(point)

    def _again(self, before: RoutePoint, point: RoutePoint) -> None:
        """Take a point at the position of the one before: its circles, its height and both times are flown there."""
        if before.circles is not None and point.circles is not None:
            self._remarks.append(f"{before.where}: circles at the position of {point.where} aren't flown")
        circles = point.circles or before.circles
        if not _same_height(before, point):
            self._remarks.append(f"{before.where}: at the position of {point.where}, whose height is flown there")
        point = replace(point, lat_deg=before.lat_deg, lon_deg=before.lon_deg)
        self._points[-1] = replace(point, circles=circles, hold_s=before.hold_s + point.hold_s)

    def _delay(self, item: MissionItem) -> None:
        """Take a time to stay at the last point; one until a time of day isn't known before the flight."""
        seconds = item.params[0]
        if math.isnan(seconds) or seconds < 0.0:
            self._remarks.append(f"{item.where}: {name_of(item.command)} until a time of day isn't carried out")
        else:
            self._points[-1] = replace(self._points[-1], hold_s=self._points[-1].hold_s + seconds)

    def _change_speed(self, item: MissionItem) -> None:
        """Take an airspeed or ground speed, which are the same in still air; the speed of legs from here on."""
        speed_mps = item.params[1]
        if math.isnan(speed_mps) or speed_mps <= 0.0:  # -1: unchanged, -2: the vehicle's default
            return
        self._speed_mps = speed_mps
        if self._points:
            self._points[-1] = replace(self._points[-1], speed_mps=speed_mps)

    def _jump(self, index: int, item: MissionItem) -> int:
        target, repeats = item.params[0], item.params[1]
        found = self._target(item, target)
        if repeats < 0:
            self._remarks.append(f"{item.where}: {name_of(item.command)} without end is flown once")
        left = self._jumps_left.setdefault(index, 1 if repeats < 0 else 0 if math.isnan(repeats) else int(repeats))
        if left <= 0:
            return index + 1
        self._jumps_left[index] = left - 1
        return found

    def _target(self, item: MissionItem, target: float) -> int:
        items, numbers = self._mission.items, self._mission.jump_targets
        if item.command == commands.JUMP_TO_TAG:
            tags = (each.command == commands.JUMP_TAG and each.params[0] == target for each in items)
            found = next((index for index, is_it in enumerate(tags) if is_it), None)
        else:
            found = next((index for index, number in enumerate(numbers) if number == target), None)
        if found is None:
            what = "tag" if item.command == commands.JUMP_TO_TAG else "item"
            raise MissionFileError(f"{item.where}: found a jump to {what} {target:g}, which isn't in the mission")
        return found


def _hold_s(item: MissionItem) -> float:
    """Return how long a multirotor stays at a waypoint."""
    waypoint = item.command in (commands.WAYPOINT, commands.SPLINE_WAYPOINT)
    return max(item.params[0], 0.0) if waypoint and math.isfinite(item.params[0]) else 0.0


def _circles(item: MissionItem) -> Circles | None:
    first, second, third, _ = item.params
    if item.command == commands.LOITER_TURNS:
        return Circles(_radius(third), turns=1.0 if math.isnan(first) or first <= 0.0 else first)
    if item.command == commands.LOITER_TIME:
        return Circles(_radius(third), seconds=0.0 if math.isnan(first) else max(first, 0.0))
    if item.command == commands.LOITER_TO_ALTITUDE:
        return Circles(_radius(second), turns=0.0)
    return None


def _radius(radius_m: float) -> float:
    return DEFAULT_RADIUS_M if math.isnan(radius_m) or radius_m == 0.0 else radius_m


def _same_position(one: RoutePoint, other: RoutePoint) -> bool:
    north_m = METRES_PER_DEGREE * (one.lat_deg - other.lat_deg)
    east_m = METRES_PER_DEGREE * (one.lon_deg - other.lon_deg) * math.cos(math.radians(one.lat_deg))
    return math.hypot(north_m, east_m) < SAME_POSITION_M


def _same_height(one: RoutePoint, other: RoutePoint) -> bool:
    unknown = math.isnan(one.height_m) and math.isnan(other.height_m)
    return one.datum == other.datum and (unknown or abs(one.height_m - other.height_m) < SAME_HEIGHT_M)
