"""What is flown at one waypoint, or at several whose legs are too short: a turn inside, one after it, or a detour."""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flight_model.arrays import TURN, Array, Complex
from flight_model.legs.detour import Detour, Part
from flight_model.legs.turn import Stretch, TurnLimits, tangent_m, turn_length_m, turn_stretches, turned_m

STRAIGHT_RAD = 1e-9
"""A waypoint whose legs differ by less is passed straight on."""
MAX_FLY_BY_RAD = math.radians(175.0)
SAMPLES = 48
"""Number of points of a turn at which its distance from waypoints is measured."""
OFF_SAMPLES = 150
"""Number of points of a joint at which its distance from the legs is measured."""
FAR_M = 1e5
"""Length of the legs before and after a corner, from which that distance is measured."""
INTERCEPTS = 180
MAX_INTERCEPT_RAD = math.radians(90.0)


class Corner(NamedTuple):
    """Two straights that a joint leads from one to the other, and the waypoints at it, north + i east, m."""

    course_rad: float
    """Course of the leg before it."""
    next_course_rad: float
    waypoints: tuple[complex, ...]
    """The last one is on the leg after it, the first one on the leg before it."""

    @property
    def angle_rad(self) -> float:
        """The angle between both legs, clockwise positive."""
        return math.remainder(self.next_course_rad - self.course_rad, TURN)

    @property
    def end(self) -> complex:
        """The last waypoint, forward + i right of the first."""
        return (self.waypoints[-1] - self.waypoints[0]) * cmath.exp(-1j * self.course_rad)


class Joint(NamedTuple):
    """A curve from one leg onto another: where it begins and ends, m before and after its waypoints, and what it is."""

    before_m: float
    after_m: float
    stretches: tuple[Stretch, ...]
    kind: str = "turn"
    """turn, over (which passes the waypoint and then turns) or detour (which leaves it and comes back)."""

    @property
    def length_m(self) -> float:
        """Length of the curve."""
        return sum(each.length_m for each in self.stretches)

    @property
    def longer_m(self) -> float:
        """Length beyond what it takes from both legs."""
        return self.length_m - self.before_m - self.after_m


def fly_by(corner: Corner, limits: TurnLimits, max_m: float) -> Joint | None:
    """Return the tightest turn inside a corner; None if it would pass more than `max_m` from a waypoint."""
    angle = corner.angle_rad
    if abs(angle) < STRAIGHT_RAD and len(corner.waypoints) == 1:
        return Joint(0.0, 0.0, ())
    if not STRAIGHT_RAD <= abs(angle) <= MAX_FLY_BY_RAD:
        return None
    to_m, from_m = tangent_m(angle, limits), tangent_m(angle, limits)
    if len(corner.waypoints) > 1:
        end = corner.end
        past_m = end.real - end.imag / math.tan(angle)  # from the first waypoint to where both legs' lines meet
        to_m, from_m = to_m - past_m, from_m - end.imag / math.sin(angle)
    found = Joint(to_m, from_m, turn_stretches(angle, limits))
    return found if distances_m(corner, found).max() <= max_m else None


def distances_m(corner: Corner, joint: Joint) -> Array:
    """Return the least distances of a corner's waypoints from the joint's curve, m."""
    curve = points(joint.stretches, SAMPLES) * cmath.exp(1j * corner.course_rad)
    begin = corner.waypoints[0] - joint.before_m * cmath.exp(1j * corner.course_rad)
    off = np.array(corner.waypoints)[:, None] - begin - curve
    return np.asarray(np.abs(off).min(axis=1))


def off_legs_m(corner: Corner, joint: Joint) -> float:
    """Return the greatest distance of a joint's curve from a corner's legs, also those between its waypoints, m."""
    if not joint.stretches:
        return 0.0
    axis, following = cmath.exp(1j * corner.course_rad), cmath.exp(1j * corner.next_course_rad)
    curve = corner.waypoints[0] - joint.before_m * axis + axis * points(joint.stretches, OFF_SAMPLES)
    ends = [corner.waypoints[0] - FAR_M * axis, *corner.waypoints, corner.waypoints[-1] + FAR_M * following]
    off_m = np.full(curve.size, np.inf)
    for begin, end in pairwise(ends):
        along = end - begin
        share = np.clip(((curve - begin) * np.conj(along)).real / abs(along) ** 2, 0.0, 1.0)
        off_m = np.minimum(off_m, np.abs(curve - begin - share * along))
    return float(off_m.max())


def points(stretches: tuple[Stretch, ...], count: int) -> Complex:
    """Return points (count + 1,) of stretches, evenly along them, forward + i right of their begin, by trapezia."""
    courses = courses_rad(stretches, 4 * count)
    step_m = sum(each.length_m for each in stretches) / (4 * count)
    axes = np.exp(1j * courses)
    curve = np.concatenate((np.zeros(1), np.cumsum((axes[1:] + axes[:-1]) / 2.0))) * step_m
    return np.asarray(curve[::4], dtype=np.complex128)


def courses_rad(stretches: tuple[Stretch, ...], count: int) -> Array:
    """Return courses (count + 1,) of stretches, evenly along them, relative to that of their begin."""
    lengths = np.array([each.length_m for each in stretches])
    ends = np.concatenate((np.zeros(1), np.cumsum(lengths)))
    turned = np.concatenate((np.zeros(1), np.cumsum([(a + b) / 2.0 * length for length, a, b in stretches])))
    at_m = np.linspace(0.0, ends[-1], count + 1)
    index = np.clip(np.searchsorted(ends, at_m, side="right") - 1, 0, len(stretches) - 1)
    first, last = np.array([each[1:] for each in stretches]).T
    along_m = at_m - ends[index]
    share = along_m / lengths[index]
    change = (last - first)[index] * lengths[index] * share**3 * (1.0 - share / 2.0)
    return np.asarray(turned[index] + first[index] * along_m + change)


def fly_over(corner: Corner, limits: TurnLimits) -> Joint | None:
    """Return the curve over a waypoint that is soonest on the next leg: a turn beyond its course, and back onto it.

    None for legs that go on straight, which need nothing.
    """
    angle = corner.angle_rad
    if abs(angle) < STRAIGHT_RAD:
        return Joint(0.0, 0.0, (), "over")
    side = math.copysign(1.0, angle)
    intercept = side * MAX_INTERCEPT_RAD * np.arange(1, INTERCEPTS + 1) / INTERCEPTS
    begun = turned_m(angle + intercept, limits) * cmath.exp(-1j * angle)
    ended = np.exp(1j * intercept) * turned_m(-intercept, limits)
    straight_m = -(begun + ended).imag / np.sin(intercept)
    along_m = (begun + ended).real + straight_m * np.cos(intercept)
    soonest = int(np.argmin(np.where(straight_m >= 0.0, along_m, np.inf)))
    if straight_m[soonest] < 0.0 or along_m[soonest] < 0.0:
        return None
    by = float(intercept[soonest])
    parts = Part(0.0, angle + by), Part(float(straight_m[soonest]), -by)
    length_m = float(turn_length_m(np.array([angle + by, by]), limits).sum()) + parts[1].straight_m
    return Joint(0.0, float(along_m[soonest]), Detour(length_m, parts).stretches(limits), "over")
