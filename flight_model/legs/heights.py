"""Heights along legs: constant slopes, rounded where they change, never outside the heights of both waypoints.

At a waypoint the slope is the smaller of both legs' means, or 0 between a climb and a descent; all rounding is on the
steeper leg. The path begins and ends level, unless its first or last leg is too short for that. In between the slope is
as constant as it can be: it rises and falls as the curvature of a turn does, so that the vertical acceleration is
continuous.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Indices, Mask
from flight_model.legs.turn import STEEPEST

LEVEL = 1e-9
"""Slopes below this are none."""
MIN_M = 1e-3
TIGHTER = (1.0, 2.0, 4.0)
"""Multiples of the preferred change of slope that are tried where there is no room for it."""

LEFT_OUT_M = (0.1, 0.25, 0.5, 0.75)
AROUND = 4
"""Number of heights before and after a section that is too steep of which some may be left out."""
KEPT_WITHIN_M = 1.0
"""Distance from heights that are left out within which the profile stays."""


class Climbs(NamedTuple):
    """The steepest slope that vehicles can fly, and the change of it that is preferred, per m of the path."""

    slope: float
    change_1pm: float

    @property
    def shortest_rounding_m(self) -> float:
        """Length of section that two changes from level to the steepest slope take beyond that of the slope alone."""
        return STEEPEST * self.slope / (self.change_1pm * TIGHTER[-1])


class Steep(NamedTuple):
    """A section between two heights that is too steep: the slope that it would need, and the steepest allowed there."""

    interval: int
    slope: float
    allowed: float


class Heights(NamedTuple):
    """A profile: pieces that begin at distances (p,), at heights (p,), whose slopes change from (p,) to (p,)."""

    begin_m: Array
    height_m: Array
    from_slope: Array
    to_slope: Array
    end_m: float

    def at(self, distance_m: Array) -> tuple[Array, Array, Array]:
        """Return heights, slopes and their rates at distances (…)."""
        index = np.clip(np.searchsorted(self.begin_m, distance_m, side="right") - 1, 0, self.begin_m.size - 1)
        lengths = np.diff(np.append(self.begin_m, self.end_m))[index]
        along_m, begun = distance_m - self.begin_m[index], self.from_slope[index]
        u, by = along_m / lengths, self.to_slope[index] - begun
        height_m = self.height_m[index] + begun * along_m + by * lengths * u**3 * (1.0 - u / 2.0)
        return height_m, begun + by * u**2 * (3.0 - 2.0 * u), by * 6.0 * u * (1.0 - u) / lengths


def interior_slope(length_m: float, rise_m: float, slopes: tuple[float, float], change_1pm: float) -> float | None:
    """Return the slope between two given ones with which a section rises; None if there is no room for the changes.

    With x between a and b, all of one sign, over a length D: x D - c ((x - a)^2 + (x - b)^2) = rise, where a change of
    slope by d takes 2 c |d|; of the two solutions the smaller is the one whose changes fit.
    """
    sign = math.copysign(1.0, rise_m)
    half = STEEPEST / change_1pm / 2.0
    a, b = sign * slopes[0], sign * slopes[1]
    linear, constant = 2.0 * half * (a + b) + length_m, half * (a * a + b * b) + abs(rise_m)
    square = linear * linear - 8.0 * half * constant
    return None if square < 0.0 else sign * 2.0 * constant / (linear + math.sqrt(square))


def eased(length_m: float, rise_m: float, slopes: tuple[float, float], climbs: Climbs) -> tuple[float, float] | None:
    """Return the slope within the limits with which a section rises, and its gentlest possible change, or None."""
    for times in TIGHTER:
        slope = interior_slope(length_m, rise_m, slopes, times * climbs.change_1pm)
        if slope is not None and abs(slope) <= climbs.slope * (1.0 + LEVEL):
            return slope, times * climbs.change_1pm
    return None


def profile(distance_m: Array, height_m: Array, climbs: list[Climbs]) -> tuple[Heights, list[Steep]]:
    """Return the profile through heights (n,) at rising distances (n,), and what of it is too steep.

    A section that is shorter than its slope's changes, as between points of a digitised line, may be too steep for its
    rounding although all together aren't. Of the heights around it those are then left out that the line through the
    others passes within one of `LEFT_OUT_M`: the first one that helps, with all within `KEPT_WITHIN_M`.

    Args:
        distance_m: (n,) along the path; two of them at least `MIN_M` apart.
        height_m: (n,) heights.
        climbs: limits for each of the n - 1 intervals.
    """
    best, steep = _through(distance_m, height_m, climbs)
    if not steep:
        return best, steep
    fixed = _fixed(distance_m.size, steep)
    for tolerance_m in LEFT_OUT_M:
        kept = _kept(distance_m, height_m, fixed, tolerance_m)
        inside = [climbs[begin:end] for begin, end in pairwise(kept.tolist())]
        tightest = [Climbs(min(each.slope for each in part), min(each.change_1pm for each in part)) for part in inside]
        found, left = _through(distance_m[kept], height_m[kept], tightest)
        off_m = np.abs(found.at(distance_m)[0] - height_m).max()
        if len(left) < len(steep) and off_m <= KEPT_WITHIN_M:
            best, steep = found, [each._replace(interval=int(kept[each.interval + 1]) - 1) for each in left]
        if not steep:
            break
    return best, steep


def _fixed(count: int, steep: list[Steep]) -> Mask:
    """Return which heights (n,) aren't around a section that is too steep; the first and the last never are."""
    fixed = np.ones(count, dtype=np.bool_)
    for each in steep:
        fixed[max(each.interval - AROUND + 1, 1) : min(each.interval + AROUND + 1, count - 1)] = False
    return fixed


def _kept(distance_m: Array, height_m: Array, fixed: Mask, tolerance_m: float) -> Indices:
    """Return the indices (k,) of heights without which the line through the others would miss one by more.

    D. H. Douglas, T. K. Peucker, Cartographica 10, 1973.
    """
    keep = fixed.copy()
    spans = list(pairwise(np.flatnonzero(fixed).tolist()))
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        ends = [first, last]
        line_m = np.interp(distance_m[first : last + 1], distance_m[ends], height_m[ends])
        off_m = np.abs(height_m[first : last + 1] - line_m)
        worst = first + int(off_m.argmax())
        if off_m.max() > tolerance_m:
            keep[worst] = True
            spans += [(first, worst), (worst, last)]
    return np.flatnonzero(keep)


def _through(distance_m: Array, height_m: Array, climbs: list[Climbs]) -> tuple[Heights, list[Steep]]:
    """Return the profile through all heights, as `profile`."""
    lengths_m, rises_m = np.diff(distance_m).tolist(), np.diff(height_m).tolist()
    means = np.diff(height_m) / np.diff(distance_m)
    inner = np.where(means[1:] * means[:-1] > 0.0, np.minimum(np.abs(means[1:]), np.abs(means[:-1])), 0.0)
    at_waypoints = [0.0, *(np.sign(means[1:]) * inner).tolist(), 0.0]
    for end, inside in ((0, 1), (len(means), len(means) - 1)):
        leg = min(end, len(means) - 1)
        slopes = (0.0, at_waypoints[inside])
        if eased(lengths_m[leg], rises_m[leg], slopes, climbs[leg]) is None:
            at_waypoints[end] = float(means[leg])
    rows, steep = list[tuple[float, float, float, float]](), list[Steep]()
    for index, limits in enumerate(climbs):
        length_m, rise_m = lengths_m[index], rises_m[index]
        a, b = at_waypoints[index], at_waypoints[index + 1]
        found = eased(length_m, rise_m, (a, b), limits)
        if found is None:
            slope, first_m, last_m = 2.0 * rise_m / length_m - (a + b) / 2.0, length_m / 2.0, length_m / 2.0
            steep.append(Steep(index, slope, limits.slope))
        else:
            slope, change_1pm = found
            first_m, last_m = (STEEPEST * abs(slope - each) / change_1pm for each in (a, b))
        rows += _pieces((float(distance_m[index]), float(height_m[index])), length_m, (a, slope, b), (first_m, last_m))
    begin_m, heights_m, from_slope, to_slope = np.array(rows).T
    return Heights(begin_m, heights_m, from_slope, to_slope, float(distance_m[-1])), steep


def _pieces(
    begin: tuple[float, float], length_m: float, slopes: tuple[float, float, float], changes_m: tuple[float, float]
) -> list[tuple[float, float, float, float]]:
    """Return the pieces of one interval: the slope's first change, the constant slope, the last change."""
    at_m, height_m = begin
    a, slope, b = slopes
    found = list[tuple[float, float, float, float]]()
    for piece_m, one, other in (
        (changes_m[0], a, slope),
        (length_m - sum(changes_m), slope, slope),
        (changes_m[1], slope, b),
    ):
        if piece_m > MIN_M:
            found.append((at_m, height_m, one, other))
        at_m, height_m = at_m + max(piece_m, 0.0), height_m + (one + other) / 2.0 * max(piece_m, 0.0)
    return found
