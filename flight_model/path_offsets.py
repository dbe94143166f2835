"""Offsets that keep a path clear of the ground, and displacements that lead onto a path from alongside it.

A clearance offset is the smallest that does so: a uniform cubic B-spline (equations 35 and 36). Its slope and curvature
are bounded by the differences of its control points, so limits on these hold everywhere, and a linear program over the
control points finds it. A displacement fades out by the minimum-jerk step (Flash and Hogan, "The coordination of arm
movements", J. Neuroscience 5, 1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from math import atan2, cos, hypot, sin
from typing import Any, NamedTuple

import numpy as np

from flight_model.arrays import Array, Indices, T
from flight_model.curve import PathPoint
from flight_model.offset_curve import STEP_M, OffsetCurve
from flight_model.path import FlightPath

SAMPLES = 4
"""Points per step at which the clearance is required."""
SAMPLE_M = STEP_M / SAMPLES
TRIFLE_M = 0.01
"""Required offsets below this are ignored."""
SHORT_COST = 10.0
"""Cost of a missing metre, in metres of offset over the whole length: high, so that shortfall is the last resort."""
PEAK_RATE = 1.875
"""Largest first derivative, at u = 1/2."""
PEAK_CHANGE = 5.77
"""Largest second derivative, 10 / sqrt(3)."""
PEAK_JERK = 60.0
"""Largest third derivative, at both ends."""
SLOPE_CHANGE, SLOPE_JERK = 3.94, 36.0
"""Largest second and third derivatives of the quintic that begins at 0 with a slope of 1 and ends at 0 and at rest."""


class Bounds(NamedTuple):
    """Bounds of slope and of curvature per metre of horizontal distance, upwards and downwards."""

    slope: float
    curvature_1pm: float


@dataclass(frozen=True)
class ClearanceOffset:
    """Metres above a path as a function of the distance along it: a spline with `STEP_M` between its knots."""

    start_m: float
    control_m: Array
    """(n,), for n - 3 steps from `start_m` on."""
    short_m: float = 0.0
    """Largest shortfall: how much of the required offset the bounds don't allow."""

    @cached_property
    def curve(self) -> OffsetCurve:
        """The offset on plain numbers, which are faster one at a time."""
        return OffsetCurve(self.control_m.tolist())

    def at_one(self, distance_m: float) -> tuple[float, float, float]:
        """Return the same as `at`, for one distance."""
        return self.curve.at((distance_m - self.start_m) / STEP_M)

    def at(self, distance_m: Array) -> tuple[Array, Array, Array]:
        """Return the offset, its slope and its curvature at distances; constant beyond its ends."""
        steps = np.clip((distance_m - self.start_m) / STEP_M, 0.0, self.control_m.size - 3.0)
        index = np.minimum(steps.astype(np.intp), self.control_m.size - 4)
        return blend([self.control_m[index + i] for i in range(4)], steps - index)


def blend(control: Sequence[Array], u: Array) -> tuple[Array, Array, Array]:
    """Return the same as `OffsetCurve.at`, at u, 0 to 1, within a step, from the step's four control points."""
    c0, c1, c2, c3 = control
    second = c0 + u * (c1 - c0) - 2.0 * (c1 + u * (c2 - c1)) + c2 + u * (c3 - c2)
    rest = 1.0 - u
    slope = (rest * rest * (c1 - c0) + (1.0 + 2.0 * u * rest) * (c2 - c1) + u * u * (c3 - c2)) / 2.0
    outer = rest * rest * rest * c0 + u * u * u * c3
    inner = (3.0 * u * u * u - 6.0 * u * u + 4.0) * c1 + (3.0 * rest * rest * rest - 6.0 * rest * rest + 4.0) * c2
    return (outer + inner) / 6.0, slope / STEP_M, second / STEP_M**2


def sample_distances(start_m: float, steps: int) -> Array:
    """Return the distances at which the required offset must be given, for an offset of `steps` steps."""
    return start_m + SAMPLE_M * np.arange(steps * SAMPLES + 1, dtype=np.float64)


def min_offset(start_m: float, needed_m: Array, slope: Array, bounds: Bounds, begun_m: Array) -> ClearanceOffset:
    """Return the offset of the least area. It is never negative, unless it begins below 0 and rises from there.

    Args:
        start_m: distance at which it starts.
        needed_m: required offset at `sample_distances`; negative or NaN where none is required.
        slope: the path's own slope there. With the offset it stays within the bounds; where it exceeds them by itself,
            the offset makes it no steeper.
        bounds: of the slope of path and offset together, and of the offset's curvature.
        begun_m: the first control points of an offset that is continued; it returns inside the bounds as soon
            as possible.
    """
    count = (needed_m.size - 1) // SAMPLES + 3
    needed = np.flatnonzero(needed_m > TRIFLE_M)
    if not needed.size and not begun_m.any():
        return ClearanceOffset(start_m, np.zeros(count))
    rows, limits = _programme(needed, needed_m, slope[SAMPLES // 2 :: SAMPLES], bounds, begun_m)
    below = count if begun_m.min(initial=0.0) < 0.0 else 0
    if below:  # a depth below 0 costs as much as an offset above
        rows, limits = _with_depth(rows, count), np.concatenate((limits, np.zeros(count)))
    free = count - begun_m.size
    lower = np.concatenate((begun_m, np.full(free, -np.inf if below else 0.0), np.zeros(needed.size + below)))
    upper = np.concatenate((begun_m, np.full(free + needed.size + below, np.inf)))
    cost = np.concatenate((np.ones(count), np.full(needed.size, SHORT_COST * count), np.full(below, 2.0)))
    found = _minimum(cost, rows, limits, lower, upper)
    if found is None:
        # No continuation is within the bounds: hold the last value, and report all that is missing.
        held = np.concatenate((begun_m, np.full(free, begun_m[-1])))
        return ClearanceOffset(start_m, held, float(np.nanmax(needed_m)))
    control_m, short_m, _ = np.split(found, [count, count + needed.size])
    return ClearanceOffset(start_m, control_m, float(short_m.max(initial=0.0)))


def _minimum(cost: Array, rows: Any, limits: Array, lower: Array, upper: Array) -> Array | None:  # noqa: ANN401 - see `_sparse`
    """Return the x of the least cost @ x with rows @ x <= limits, within its bounds; None if there is none.

    `milp` without integers: the same solver as `linprog`, which takes a fifth longer to prepare and to explain it.
    """
    import scipy  # noqa: PLC0415 - needed over terrain only; the import takes longer than reading a scenario

    optimize: Any = scipy.optimize
    limited = optimize.LinearConstraint(rows, -np.inf, limits)
    found: Array | None = optimize.milp(cost, bounds=optimize.Bounds(lower, upper), constraints=limited).x
    return found


def _programme(needed: Indices, needed_m: Array, slope: Array, bounds: Bounds, begun_m: Array) -> tuple[Any, Array]:
    """Return rows and limits of `rows @ (control points, shortfalls) <= limits`; `slope` is that mid-step."""
    count, each = slope.size + 3, np.arange(needed.size)
    first = np.minimum(needed // SAMPLES, count - 4)
    weights = _sample_weights()[needed - first * SAMPLES]
    values, rows, columns = _differences(count)
    own = np.pad(slope, 1, mode="edge")
    up, down = np.maximum(bounds.slope - own, 0.0) * STEP_M, np.maximum(bounds.slope + own, 0.0) * STEP_M
    curved = np.full(count - 2, bounds.curvature_1pm * STEP_M**2)
    limits = np.concatenate((-needed_m[needed], *_begun(begun_m, up, down, curved)))
    values = np.concatenate((-weights.ravel(), values, -np.ones(needed.size)))
    rows = np.concatenate((np.repeat(each, 4), needed.size + rows, each))
    columns = np.concatenate(((first[:, None] + np.arange(4)).ravel(), columns, count + each))
    return _sparse().csc_array((values, (rows, columns)), (limits.size, count + needed.size)), limits


@cache
def _sample_weights() -> Array:
    """Return what each of a step's four control points counts at its samples, both ends included: (SAMPLES + 1, 4)."""
    shares = np.arange(SAMPLES + 1, dtype=np.float64) / SAMPLES
    ones: list[list[float]] = np.eye(4).tolist()
    return np.array([blend([np.full_like(shares, each) for each in unit], shares)[0] for unit in ones]).T


@lru_cache(maxsize=4)
def _differences(count: int) -> tuple[Array, Indices, Indices]:
    """Return the entries of rises, falls and both signs of bends between control points: values, rows, columns."""
    values, rows, columns = list[Array](), list[Indices](), list[Indices]()
    begin = 0
    for weights in ((-1.0, 1.0), (1.0, -1.0), (1.0, -2.0, 1.0), (-1.0, 2.0, -1.0)):
        each = np.arange(count + 1 - len(weights))
        for ahead, weight in enumerate(weights):
            values.append(np.full(each.size, weight))
            rows.append(begin + each)
            columns.append(each + ahead)
        begin += each.size
    return np.concatenate(values), np.concatenate(rows), np.concatenate(columns)


def _begun(begun_m: Array, up: Array, down: Array, curved: Array) -> tuple[Array, Array, Array, Array]:
    """Return limits that admit the offset as begun; slopes beyond them decrease as fast as the curvature allows."""
    widened: list[Array] = []
    for sign, limit in ((1.0, up), (-1.0, down)):
        rises, wide = sign * np.diff(begun_m), limit.copy()
        if rises.size:
            eased = rises[-1] - curved[0] * np.arange(1, limit.size - rises.size + 1)
            wide = np.maximum(wide, np.concatenate((rises, eased)))
        widened.append(wide)
    for sign in (1.0, -1.0):
        bends, wide = sign * np.diff(begun_m, n=2), curved.copy()
        wide[: bends.size] = np.maximum(wide[: bends.size], bends)
        widened.append(wide)
    return widened[0], widened[1], widened[2], widened[3]


def _sparse() -> Any:  # noqa: ANN401 - scipy's sparse arrays are typed in part only
    import scipy  # noqa: PLC0415 - as in `min_offset`

    return scipy.sparse


def _with_depth(rows: Any, count: int) -> Any:  # noqa: ANN401 - see `_sparse`
    """Return the rows with a variable added for each control point's depth below 0, and the rows that define it."""
    sparse = _sparse()
    one, none = sparse.eye_array(count), sparse.csr_array
    points = sparse.hstack((-one, none((count, rows.shape[1] - count)), -one))
    return sparse.vstack((sparse.hstack((rows, none((rows.shape[0], count)))), points))


def minimum_jerk(u: T) -> tuple[T, T, T]:
    """Return the step at u, 0 to 1, and its first two derivatives by u."""
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - u) * (1 - 2 * u)


class Rise(NamedTuple):
    """Height of a vehicle above a path, with its first two derivatives by the path's own length."""

    height_m: float = 0.0
    slope: float = 0.0
    curvature_1pm: float = 0.0


class DisplacedPath:
    """A path with a displacement that fades out from `from_m` on, over `over_m`, as a minimum-jerk step.

    An initial slope of the displacement, to the right or upwards, is continued by a quintic that ends at rest. An
    offset can be added to clear the ground. Distances are along the path itself. A curve of curvature k that is
    displaced by o along its normal n has the tangent (1 - k o) t + o' n; the rate of its curvature is approximated by
    the derivatives of o.
    """

    def __init__(
        self,
        path: FlightPath,
        from_m: float,
        over_m: float,
        right_m: float,
        above: Rise,
        offset: ClearanceOffset | None = None,
        *,
        right_slope: float = 0.0,
    ) -> None:
        """Displace `path` to the right by `right_m`, growing by `right_slope` at first, and in height by `above`."""
        self.path = path
        self.length_m = path.length_m
        self._from_m, self._over_m = from_m, over_m
        self._right_m, self._right_slope, self._above, self._offset = (
            right_m,
            right_slope,
            above,
            offset,
        )

    def at(self, distance_m: float) -> PathPoint:
        """Return the point at a distance along the path."""
        point = self._displaced(distance_m)
        return point if self._offset is None else point.raised(*self._offset.at_one(distance_m))

    def _displaced(self, distance_m: float) -> PathPoint:
        point = self.path.at(distance_m)
        if distance_m >= self._from_m + self._over_m:
            return point
        o, o1, o2, o3 = self._right(distance_m)
        up = self._up(distance_m)
        k, k1 = point.curvature_1pm, point.curvature_rate_1pm2
        along, along_rate = 1.0 - k * o, -k1 * o - k * o1
        stretch = hypot(along, o1)
        bent = k + (along * o2 - o1 * along_rate) / stretch**2
        return PathPoint(
            point.north_m - o * sin(point.course_rad),
            point.east_m + o * cos(point.course_rad),
            point.height_m + up.height_m,
            point.course_rad + atan2(o1, along),
            bent / stretch,
            k1 + o3,
            (point.slope + up.slope) / stretch,
            point.slope_rate_1pm + up.curvature_1pm,
        )

    def _right(self, distance_m: float) -> tuple[float, float, float, float]:
        """Return the remaining displacement to the right, and its first three derivatives by distance."""
        length, p, q = self._over_m, self._right_m, self._right_slope
        u = max(distance_m - self._from_m, 0.0) / length
        gone, rate, change = minimum_jerk(u)
        jerk, slope_jerk = (60 * (1 - 6 * u + 6 * u**2), 192 * u - 180 * u**2 - 36) if u > 0.0 else (0.0, 0.0)
        return (
            p * (1.0 - gone) + q * length * (u - 6 * u**3 + 8 * u**4 - 3 * u**5),
            -p * rate / length + q * (1.0 - 18 * u**2 + 32 * u**3 - 15 * u**4),
            -p * change / length**2 + q * (96 * u**2 - 36 * u - 60 * u**3) / length,
            -p * jerk / length**3 + q * slope_jerk / length**2,
        )

    def _up(self, distance_m: float) -> Rise:
        """Return the remaining height: the quintic that continues `above` and ends level at 0."""
        length = self._over_m
        u = max(distance_m - self._from_m, 0.0) / length
        p, q, r = self._above.height_m, self._above.slope * length, self._above.curvature_1pm * length**2 / 2.0
        third, fourth, fifth = -10 * p - 6 * q - 3 * r, 15 * p + 8 * q + 3 * r, -6 * p - 3 * q - r
        return Rise(
            p + u * (q + u * (r + u * (third + u * (fourth + u * fifth)))),
            (q + u * (2 * r + u * (3 * third + u * (4 * fourth + u * 5 * fifth)))) / length,
            (2 * r + u * (6 * third + u * (12 * fourth + u * 20 * fifth))) / length**2,
        )
