"""The geometry of a fence: distances inside it, and the room that turns and holding patterns leave to it.

A fence is polygons and circles, to stay in (inclusion) or out of (exclusion). `FenceAreas.inside_m` is the signed
distance by which paths, slots, holding patterns, setpoints and flown tracks are judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import NamedTuple, TypeVar

import numpy as np

from flight_model.arrays import Array, offset_points, within
from flight_model.curve import PathPoint
from flight_model.path import Route

REACT_S = 2.0
"""How long a vehicle flies straight on before it turns away from the fence."""
TURN_SHARE = 0.7
"""Share of the largest turn rate that such a turn is planned with."""
CHECKED_M = 25.0
"""Room that paths, holding patterns and slots must leave; a vehicle that has been turned away is released with as
much."""
MIN_MPS = 1.0
"""Lower bound of airspeeds that are divided by."""
STEP_M = 20.0
"""Interval of the points at which a holding pattern is checked."""
EDGE_POINTS = 121
"""Number of points by which a circle is drawn."""
RouteT = TypeVar("RouteT", bound=Route)


class Flyers(NamedTuple):
    """The vehicles of a formation, leader included, by offset from the leader: (F,) each."""

    forward_m: Array
    right_m: Array
    turn_rps: Array
    """Largest turn rates."""
    slots_turn: bool = True
    """Whether the offsets are by the leader's heading; else they are north and east."""


class Drift(NamedTuple):
    """An airspeed and the wind, north and east, m/s."""

    speed_mps: float
    north_mps: float
    east_mps: float
    through_air_mps: float
    """Airspeed plus wind, for the size of circles over ground."""


def inside_m(corners_m: Array, points_m: Array) -> Array:
    """Return the distance (…) of points (…, 2) to the edge of a polygon (K, 2), m; negative outside.

    Inside, a ray from the point crosses the edge an odd number of times.
    """
    begin, end = corners_m, np.roll(corners_m, -1, axis=0)
    edge, reach = end - begin, points_m[..., None, :] - begin
    along = np.clip((reach * edge).sum(axis=-1) / np.maximum((edge * edge).sum(axis=-1), 1e-12), 0.0, 1.0)
    distance = np.linalg.norm(reach - along[..., None] * edge, axis=-1).min(axis=-1)
    north, east = points_m[..., 0, None], points_m[..., 1, None]
    spans = (begin[:, 1] > east) != (end[:, 1] > east)
    rise = np.where(edge[:, 1] == 0.0, np.inf, edge[:, 1])
    crossed = spans & (north < begin[:, 0] + (east - begin[:, 1]) / rise * edge[:, 0])
    sign: Array = np.where(crossed.sum(axis=-1) % 2 == 1, 1.0, -1.0)
    return sign * distance


@dataclass(frozen=True, eq=False)
class Polygon:
    """A polygon by its corners (K, 2), north and east, m, in either direction."""

    corners_m: Array

    @cached_property
    def centre_m(self) -> Array:
        """The centre (2,) of a circle around it."""
        centre: Array = (self.corners_m.min(axis=0) + self.corners_m.max(axis=0)) / 2.0
        return centre

    @cached_property
    def radius_m(self) -> float:
        """The radius of that circle."""
        return float(np.linalg.norm(self.corners_m - self.centre_m, axis=-1).max())

    def inside_m(self, points_m: Array) -> Array:
        """Return the distance (…) of points (…, 2) to its edge, m; negative outside."""
        return inside_m(self.corners_m, points_m)

    def edge_m(self) -> Array:
        """Return points (N, 2) of its edge, the first one again at the end."""
        return np.concatenate((self.corners_m, self.corners_m[:1]))


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle by its centre (2,), north and east, and its radius, m."""

    centre_m: Array
    radius_m: float

    def inside_m(self, points_m: Array) -> Array:
        """Return the distance (…) of points (…, 2) to its edge, m; negative outside."""
        north_m, east_m = self.centre_m.tolist()
        distance: Array = self.radius_m - np.hypot(points_m[..., 0] - north_m, points_m[..., 1] - east_m)
        return distance

    def edge_m(self) -> Array:
        """Return points (N, 2) of its edge, the first one again at the end."""
        angle_rad = np.linspace(0.0, 2.0 * np.pi, EDGE_POINTS)
        return self.centre_m + self.radius_m * np.stack((np.cos(angle_rad), np.sin(angle_rad)), axis=-1)


class FenceArea(NamedTuple):
    """An area of a fence."""

    shape: Polygon | Circle
    inclusion: bool
    key: str
    """The scenario's key that it is from."""

    def allowed_m(self, points_m: Array) -> Array:
        """Return how far (…) points (…, 2) are on the side of its edge where vehicles may be, m; else negative."""
        within_m = self.shape.inside_m(points_m)
        return within_m if self.inclusion else -within_m

    def __str__(self) -> str:
        """Return what it is, in words."""
        shape = "circle" if isinstance(self.shape, Circle) else "polygon"
        return f"{'inclusion' if self.inclusion else 'exclusion'} {shape}"


@dataclass(frozen=True, eq=False)
class FenceAreas:
    """The areas of a fence, one or more.

    Vehicles stay out of every exclusion and inside every inclusion, as ArduPilot has it, or with `any_inclusion`
    inside at least one, as PX4 does.
    """

    areas: tuple[FenceArea, ...]
    any_inclusion: bool = False

    def inside_m(self, points_m: Array) -> Array:
        """Return the distance (…) of points (…, 2) inside the fence, m; negative outside.

        The sign is exact, and the distance never larger than that to the fence's edge. Inside it is exact, too, unless
        one of several inclusions is enough and these overlap.
        """
        flat = points_m.reshape(-1, 2)
        inclusions = [area.shape.inside_m(flat) for area in self.areas if area.inclusion]
        found: Array = reduce(np.maximum if self.any_inclusion else np.minimum, inclusions, np.array(self._begin_m))
        found = np.broadcast_to(found, flat.shape[:1]).copy()
        for area in self.areas if flat.size else ():
            if not area.inclusion:
                _keep_out(area.shape, flat, found)
        return found.reshape(points_m.shape[:-1])

    @property
    def _begin_m(self) -> float:
        """The distance inside no inclusion yet: nowhere where one is enough, everywhere where all bind."""
        return -math.inf if self.any_inclusion and any(area.inclusion for area in self.areas) else math.inf

    def nearest(self, point_m: Array) -> FenceArea:
        """Return the area whose edge decides the distance of a point (2,)."""
        each = [(float(area.allowed_m(point_m)), index) for index, area in enumerate(self.areas)]
        inclusions = [one for one in each if self.areas[one[1]].inclusion]
        if self.any_inclusion and inclusions:
            each = [max(inclusions), *(one for one in each if one not in inclusions)]
        return self.areas[min(each)[1]]


def _keep_out(shape: Polygon | Circle, points: Array, inside: Array) -> None:
    """Lower the distances inside (N,) of points (N, 2) to those from a shape to stay out of, where these are smaller.

    Nothing is nearer to it than to the circle around it, so that most shapes and points need no more than that.
    """
    (north_m, east_m), (low, high) = shape.centre_m.tolist(), (points.min(axis=0), points.max(axis=0))
    gap = np.maximum(np.maximum(low - shape.centre_m, shape.centre_m - high), 0.0)
    if math.hypot(*gap.tolist()) - shape.radius_m > inside.max():
        return
    near = ~(np.hypot(points[:, 0] - north_m, points[:, 1] - east_m) - shape.radius_m >= inside)  # unknown ones too
    if near.any():
        inside[near] = np.minimum(inside[near], -shape.inside_m(points[near]))


def room_m(
    areas: FenceAreas, positions_m: Array, velocity_mps: Array, through_air_mps: Array, turn_rps: Array
) -> Array:
    """Return the distance to the fence of circles to the left and to the right, (…, 2) m; negative: across it.

    Args:
        areas: of the fence.
        positions_m: (…, 2) of the vehicles.
        velocity_mps: (…, 2) over ground.
        through_air_mps: (…,) airspeed plus wind, for the size of the circles.
        turn_rps: (…,) largest turn rates.
    """
    radius_m = through_air_mps / (TURN_SHARE * turn_rps)
    speed = np.maximum(np.linalg.norm(velocity_mps, axis=-1), 1e-9)
    right = np.stack((-velocity_mps[..., 1], velocity_mps[..., 0]), axis=-1) / speed[..., None]
    ahead = positions_m + REACT_S * velocity_mps
    centres = np.stack([ahead + side * radius_m[..., None] * right for side in (-1.0, 1.0)], axis=-2)
    return areas.inside_m(centres) - radius_m[..., None]


def positions_along(path: tuple[Array, Array, Array], flyers: Flyers, drift: Drift) -> Array:
    """Return all vehicles' positions along the leader's path, (F, S, 2); arguments as of `room_along_m`."""
    north_m, east_m, course_rad = path
    crosswind_mps = drift.east_mps * np.cos(course_rad) - drift.north_mps * np.sin(course_rad)
    heading_rad = course_rad - np.arcsin(within(crosswind_mps / max(drift.speed_mps, MIN_MPS), -1.0, 1.0))
    axis_rad = heading_rad if flyers.slots_turn else np.zeros_like(heading_rad)
    return np.stack(
        offset_points(north_m, east_m, axis_rad, flyers.forward_m[:, None], flyers.right_m[:, None]), axis=-1
    )


def room_along_m(
    areas: FenceAreas, path: tuple[Array, Array, Array], flyers: Flyers, drift: Drift
) -> tuple[Array, Array]:
    """Return all vehicles' positions along the leader's path, (F, S, 2), and the room that is left, (F, S) m.

    The leader's heading includes the crab angle, and slots are relative to its heading.

    Args:
        areas: of the fence.
        path: (S,) of the leader: north, east, m, and course, rad.
        flyers: the vehicles.
        drift: airspeed and wind.
    """
    course_rad = path[2]
    cos, sin = np.cos(course_rad), np.sin(course_rad)
    along_mps, crosswind_mps = (
        drift.north_mps * cos + drift.east_mps * sin,
        drift.east_mps * cos - drift.north_mps * sin,
    )
    ground_mps = np.sqrt(np.maximum(drift.speed_mps**2 - crosswind_mps**2, 0.0)) + along_mps
    positions, turn_rps = positions_along(path, flyers, drift), flyers.turn_rps[:, None]
    velocity = np.stack((ground_mps * cos, ground_mps * sin), axis=-1)
    shape = positions.shape[:-1]
    through_air, turn = np.full(shape, drift.through_air_mps), np.broadcast_to(turn_rps, shape)
    return positions, room_m(areas, positions, velocity, through_air, turn).max(axis=-1)


@dataclass(frozen=True)
class HoldingPatternFence:
    """The fence, the path's start, and the vehicles that fly a holding pattern before it."""

    areas: FenceAreas
    start: PathPoint
    flyers: Flyers

    def roomiest(
        self, candidates: Iterable[RouteT], speed_mps: float, wind_north_mps: float, wind_east_mps: float
    ) -> RouteT:
        """Return the first candidate that leaves `CHECKED_M` for all vehicles, or else the one that lacks least."""
        through_air_mps = speed_mps + math.hypot(wind_north_mps, wind_east_mps)
        drift, minimum = Drift(speed_mps, wind_north_mps, wind_east_mps, through_air_mps), math.inf
        found: RouteT | None = None
        for candidate in candidates:
            lack = float(self.lack(candidate, drift)[1].sum())
            if lack < minimum:
                found, minimum = candidate, lack
            if lack == 0.0:
                break
        assert found is not None, "there is always a way with turns to the same side"
        return found

    def lack(self, route: Route, drift: Drift) -> tuple[Array, Array]:
        """Return positions and missing room on a route to the straight before the path, and on that straight.

        Positions are (F, S, 2), north and east; the room that is missing there to `CHECKED_M` is (F, S).
        """
        end = route.at(route.length_m)
        straight_m = math.hypot(end.north_m - self.start.north_m, end.east_m - self.start.east_m)
        whole_m = route.length_m + straight_m
        points = [route.at(at_m) for at_m in np.linspace(0.0, whole_m, 2 + int(whole_m / STEP_M)).tolist()]
        north_m, east_m, course_rad = np.array([(each.north_m, each.east_m, each.course_rad) for each in points]).T
        positions, room = room_along_m(self.areas, (north_m, east_m, course_rad), self.flyers, drift)
        return positions, np.maximum(CHECKED_M - room, 0.0)
