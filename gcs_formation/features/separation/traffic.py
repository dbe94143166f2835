"""The separation rule's input at one tick, a vehicle's candidate trajectories, and pairs that could come too near."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Indices, Mask, all_of, within, wrap
from flight_model.vehicle_arrays import FlightStates, Setpoints, updraught_offset_m, velocity_aimed_at
from gcs_formation.features.separation.approach import COARSE_S, JERK_MPS3, Manoeuvre, MinimumDistance, Traffic, reach_m
from gcs_formation.features.separation.broad_phase import SLOT_SHARE, KeptDistance

MARGIN_M = 1.0
"""Margin, in height, by which a vehicle that manoeuvres passes another beyond the distance to keep. Tuned: m; 0.5 to 3;
shown by `pytest tests/gcs_formation/features/separation`."""
PATIENCE_S = 8.0
"""Time of one manoeuvre after which its margin grows. Tuned: s; 4 to 15; by judgement."""
FARTHER_MPS = 0.25
"""How fast that margin grows. Tuned: m/s; 0.1 to 0.5; by judgement."""
FARTHEST_M = 10.0
"""A vehicle that has manoeuvred for more than `PATIENCE_S` increases that margin by `FARTHER_MPS`, up to `FARTHEST_M`.

It may level off short of its setpoint, since no model is exact, and is released only beyond the distance to keep.

Tuned: m; 5 to 20; by judgement.
"""
REFERENCE = 0
"""Column of the vehicle along whose velocity the others can always fly: the first one, the leader if it is considered.

For a multirotor its commanded velocity is used: the present one may result from an avoidance manoeuvre, and the one of
a leader that brakes can't be kept."""
AS_COMMANDED = 2
"""Number of a vehicle's courses, the first ones, that begin as commanded."""
BEARINGS_RAD = tuple(math.radians(each) for each in (90, -90, 135, -135, 180, 45, -45, 0))
"""Directions in which a multirotor evades, relative to the reference's."""
Courses = list[tuple[tuple[float, float], tuple[float, float]]]
"""Speed and heading commanded first, and those commanded afterwards; NaN: those flown by then."""
FEW = 32
"""Up to this many vehicles, testing every pair is faster than a search for near ones. Tuned: vehicles; 16 to 64; shown
by `python -m benchmarks.features.separation`."""


@dataclass(frozen=True)
class TrafficPicture:
    """Vehicles, (N,) columns, in order of precedence: the last one manoeuvres first."""

    traffic: Traffic
    setpoints: Setpoints
    """The law's; for uncommanded vehicles their assumed intent, NaN where they continue as they fly."""
    commanded: Mask
    vehicles: Indices
    """(N,) the vehicle of each column: one that may be at two positions has two columns, which needn't keep apart."""
    kept: KeptDistance
    """Distance between two commanded vehicles, as far as their slots allow it, and from uncommanded ones."""
    slots_m: Array
    """(3, N) their slots, from the leader; NaN for a vehicle far from its slot."""
    timing_s: Array
    """(N,) how much earlier or later than predicted a vehicle may be at a position."""
    floor: Callable[[FlightStates], Array]
    """Returns the lowest heights (N,) that the rule commands."""
    times_s: Array
    """(S,) sample times of predicted trajectories."""
    evades: bool = False
    """Whether the reference avoided another at the last tick."""
    manoeuvring_s: Array | None = None
    """(N,) how long each has avoided another without interruption; None: none for long."""
    heights_m: tuple[float, float] = (-math.inf, math.inf)
    """The lowest and the highest height that the fence allows."""

    @cached_property
    def velocity_mps(self) -> Array:
        """Ground velocity north and east, (2, N)."""
        return self.traffic.state.ground_mps

    @property
    def _aims(self) -> bool:
        return self.traffic.hovers and bool(self.commanded[REFERENCE])

    @cached_property
    def reference(self) -> tuple[float, float]:
        """Airspeed and heading of the reference."""
        its = self.setpoints.air_motion if self._aims else self.traffic.state.air_motion
        return float(its[0, REFERENCE]), float(its[1, REFERENCE])

    @cached_property
    def reference_mps(self) -> Array:
        """Ground velocity of the reference north and east, (2, 1)."""
        if not self._aims:
            return self.velocity_mps[:, [REFERENCE]]
        speed_mps, heading_rad = self.reference
        return np.array([[speed_mps * math.cos(heading_rad)], [speed_mps * math.sin(heading_rad)]])

    @cached_property
    def along(self) -> tuple[Array, Array]:
        """Airspeed and heading of the reference as each can fly them, (N,); uncommanded vehicles keep their own."""
        model, on = self.traffic.model, self.setpoints
        speed, heading = (np.full(self.commanded.size, each) for each in self.reference)
        speed = within(speed, model.speed_min_mps, model.speed_max_mps)
        return np.where(self.commanded, speed, on.speed_mps), np.where(self.commanded, heading, on.heading_rad)

    def lasting(self, vehicle: int) -> tuple[float, float]:
        """Return the airspeed and heading that a vehicle can keep after its first setpoint: the reference's.

        The reference itself keeps what it flies by then (NaN), unless its commanded velocity is used. In a bend its
        heading changes while the first setpoint acts. A trajectory that turns back to the present heading couldn't be
        continued at the next tick.
        """
        speed, heading = self.along
        turns = vehicle == REFERENCE and not self._aims
        return (np.nan, np.nan) if turns else (float(speed[vehicle]), float(heading[vehicle]))

    def minimum(self, one: Indices, other: Indices) -> MinimumDistance:
        """Return the distance that pairs are to keep (P,)."""
        both = self.commanded[one] & self.commanded[other]
        distinct = self.vehicles[one] != self.vehicles[other]
        slots_m = np.linalg.norm(self.slots_m[:, one] - self.slots_m[:, other], axis=0)
        kept_m, each_m = SLOT_SHARE * slots_m, self.kept.each_m
        if each_m is not None:
            kept_m = np.where(np.isnan(slots_m), np.nan, each_m[self.vehicles[one], self.vehicles[other]])
        kept_m = np.fmin(kept_m, self.kept.max_m)
        distance_m: Array = np.where(both, kept_m, self.kept.max_m)
        return MinimumDistance(distinct * distance_m, distinct * (self.timing_s[one] + self.timing_s[other]))

    @cached_property
    def trails_m(self) -> Array:
        """How far each vehicle's height is behind the reference's while both go on climbing, (N,).

        Setpoints then keep climbing, and each height is late by its own time constants. The delay and the climb
        that all have in common are left out. A reference that manoeuvres climbs to a fixed height instead.
        """
        model, climb_mps = self.traffic.model, self.traffic.state.climb_mps
        tau_s = model.tau_ha_s + model.tau_hb_s
        climbs = self.commanded & (self.commanded[REFERENCE] and not self.evades)
        return np.where(climbs, (tau_s - tau_s[REFERENCE]) * climb_mps[REFERENCE], 0.0)

    @cached_property
    def floor_m(self) -> Array:
        """Lowest heights that the rule commands, (N,)."""
        return self.floor(self.traffic.state)

    def as_commanded(self) -> Manoeuvre:
        """Return all vehicles' manoeuvres without avoidance: as commanded, then along the reference at that height.

        Uncommanded vehicles continue as they fly.
        """
        setpoints = self.setpoints
        return Manoeuvre(setpoints, *self.along, setpoints.height_m)

    def straight(self, which: Indices) -> Manoeuvre:
        """Return the manoeuvres of the vehicles `which`: as commanded, then straight on at that height."""
        setpoints, on = self.setpoints.select(which), np.full(which.size, np.nan)
        return Manoeuvre(setpoints, on, on, setpoints.height_m)

    def farther_m(self, vehicle: int) -> float:
        """Return the additional margin in height of a vehicle that has manoeuvred for long."""
        lasted_s = 0.0 if self.manoeuvring_s is None else float(self.manoeuvring_s[vehicle])
        return min(max(FARTHER_MPS * (lasted_s - PATIENCE_S), 0.0), FARTHEST_M)

    def within_reach(self, which: Indices, height_m: Array) -> Array:
        """Return heights limited to what vehicles may be commanded now (N,)."""
        own_m, max_m = self.traffic.state.height_m[which], reach_m(self.traffic.model.select(which))
        return within(height_m, own_m - max_m, own_m + max_m)


def courses(picture: TrafficPicture, vehicle: int) -> Courses:
    """Return the courses open to a vehicle, the mildest first.

    As commanded, then along the reference; as commanded, then straight on; along the reference at once; straight on at
    once. A multirotor may also stop (tried before straight on), or fly in any of eight directions, sideways first.
    """
    now, setpoints, on = picture.traffic.state, picture.setpoints, (np.nan, np.nan)
    course = float(setpoints.speed_mps[vehicle]), float(setpoints.heading_rad[vehicle])
    along = float(picture.along[0][vehicle]), float(picture.along[1][vehicle])
    present = float(now.airspeed_mps[vehicle]), float(now.heading_rad[vehicle])
    found = [(course, picture.lasting(vehicle)), (course, on), (along, picture.lasting(vehicle)), (present, on)]
    if picture.traffic.hovers:
        ahead_rad, max_mps = picture.reference[1], float(picture.traffic.model.speed_max_mps[vehicle])
        stop, *lateral = [(0.0, ahead_rad), *((max_mps, ahead_rad + lateral_rad) for lateral_rad in BEARINGS_RAD)]
        found[-1:] = [(stop, stop), found[-1], *((each, each) for each in lateral)]
    return found


def take_height(picture: TrafficPicture, vehicle: int, height_m: Array) -> Manoeuvre:
    """Return the manoeuvres to each of M heights on each of K courses, (M K,) columns, the mildest first."""
    first_m = picture.within_reach(np.full(height_m.size, vehicle, dtype=np.intp), height_m)
    open_to_it = courses(picture, vehicle)
    rows = np.empty((6, height_m.size, len(open_to_it)))
    rows[:2] = np.array([first for first, _ in open_to_it]).T[:, None]
    rows[3:5] = np.array([then for _, then in open_to_it]).T[:, None]
    rows[2], rows[5] = first_m[:, None], height_m[:, None]
    return Manoeuvre.of(rows.reshape(6, -1))


def free_heights(picture: TrafficPicture, vehicle: int, others: Indices, ends_m: Array, side: float) -> Array:
    """Return the height setpoints, corrected for updraught, with which a vehicle passes others that end at `ends_m`.

    Those on its present side come first, then the nearest; of equally near ones the upper.
    """
    minimum = picture.minimum(np.full(others.size, vehicle, dtype=np.intp), others)
    passing_mps = _length(picture.velocity_mps[:, others] - picture.velocity_mps[:, [vehicle]])
    margin_m = minimum.distance_m + minimum.timing_s * passing_mps + MARGIN_M + picture.farther_m(vehicle)
    heights = np.concatenate((ends_m + margin_m, ends_m - margin_m))
    sides = np.repeat((1.0, -1.0), others.size)
    allowed = heights >= picture.floor_m[vehicle]
    heights, sides = heights[allowed], sides[allowed]
    own_m = float(picture.traffic.state.height_m[vehicle])
    other_side = (sides != side) & (side != 0)
    far_m = np.round(np.abs(heights - own_m), 6)
    lifted_m = updraught_offset_m(picture.traffic.state, picture.traffic.model)[vehicle]
    return heights[np.lexsort((-sides, far_m, other_side))] - lifted_m + picture.trails_m[vehicle]


def _length(vectors: Array) -> Array:
    return np.hypot(vectors[0], vectors[1])


class MotionBound(NamedTuple):
    """Bounds of vehicles' distances and speeds in a frame that moves with the reference, (N,)."""

    position_m: Array
    """(2, N) north and east in that frame, at the common instant at which predictions start."""
    far_m: Array
    fast_mps: Array


def possible_pairs(picture: TrafficPicture) -> tuple[Indices, Indices]:
    """Return the pairs (one < other), at least one of them commanded, that could come too near as commanded.

    The test is conservative: it finds every pair whose trajectories as commanded don't keep the distance.
    """
    bounds, count = bound(picture), picture.commanded.size
    one, other = _all_pairs(count) if count <= FEW else _pairs_within(_farthest_m(picture, bounds), bounds.position_m)
    distance_m = _length(bounds.position_m[:, other] - bounds.position_m[:, one])
    minimum = picture.minimum(one, other)
    needed_m = minimum.distance_m + minimum.timing_s * (bounds.fast_mps[one] + bounds.fast_mps[other])
    possible: Mask = distance_m < needed_m + bounds.far_m[one] + bounds.far_m[other]
    possible &= picture.commanded[one] | picture.commanded[other]
    return one[possible], other[possible]


def bound(picture: TrafficPicture) -> MotionBound:
    """Return bounds of the horizontal distance and speed, in the reference's frame, of the trajectories as commanded.

    An error e of speed or heading that decays with a time constant tau, at a rate of at most r, displaces by e tau +
    e^2 / (2 r); the trapezium rule adds half a step. A change of a multirotor's acceleration adds at most what
    `CarriedOn` says, and what of that is still to come.
    """
    traffic, state, setpoints = picture.traffic, picture.traffic.state, picture.setpoints
    along = np.array(picture.along)
    drift_mps = _length(state.wind_mps - state.wind_mps[:, [REFERENCE]]) + np.abs(along[0] - picture.reference[0])
    first_s, horizon_s = traffic.lead_s + picture.times_s[1], traffic.lead_s + picture.times_s[-1]
    if traffic.hovers:
        present_mps2 = _length(traffic.accel_mps2)
        aimed = [velocity_aimed_at(state, each, traffic.model) for each in (along, setpoints.air_motion)]
        errors = np.array([[_length(each - picture.velocity_mps)] for each in aimed])
        tau_s, rate_max, weight = traffic.model.tau_v_s, traffic.model.accel_max_mps2, np.ones((1, 1))
    else:
        errors = np.abs(np.array((along, setpoints.air_motion)) - state.air_motion)
        errors[:, 1] = np.abs(wrap(errors[:, 1]))
        tau_s, rate_max = traffic.model.air_taus_s, traffic.model.air_rates_max
        weight = np.array((np.ones_like(along[0]), along[0]))
    error, to_setpoint = errors
    first = np.minimum(to_setpoint / tau_s, rate_max)
    if traffic.hovers:
        first = np.maximum(first, present_mps2) + (first + present_mps2) ** 2 / (2 * JERK_MPS3 * tau_s)
    error += first * first_s
    if traffic.hovers:
        error += (first + np.minimum(error / tau_s, rate_max)) ** 2 / JERK_MPS3
    off = error * (first_s + tau_s + COARSE_S / 2) + error**2 / (2 * rate_max)
    far_m = (weight * off).sum(axis=0) + drift_mps * horizon_s
    fast_mps = (weight * error).sum(axis=0) + drift_mps
    frame_mps = picture.reference_mps
    position_m = state.level_m + frame_mps * traffic.lead_s
    if not all_of(picture.commanded):
        _free(picture, frame_mps, far_m, fast_mps, horizon_s)
    return MotionBound(position_m, far_m, fast_mps)


def _free(picture: TrafficPicture, frame_mps: Array, far_m: Array, fast_mps: Array, horizon_s: Array) -> None:
    """Fill in the bounds of uncommanded vehicles: they fly straight on or turn; multirotors may fly anywhere."""
    traffic, state, free = picture.traffic, picture.traffic.state, ~picture.commanded
    if traffic.hovers:
        mps = np.maximum(_length(picture.velocity_mps), traffic.model.speed_max_mps) + _length(frame_mps)
    else:
        circling_mps = state.airspeed_mps + _length(state.wind_mps) + _length(frame_mps)
        straight_mps = _length(picture.velocity_mps - frame_mps)
        mps = np.where(traffic.turn_rps == 0, straight_mps, circling_mps)
    fast_mps[free], far_m[free] = mps[free], (mps * horizon_s)[free]


def _farthest_m(picture: TrafficPicture, bounds: MotionBound) -> float:
    """Return a distance beyond which no two come too near."""
    max_m = 2 * (bounds.far_m.max() + 2 * picture.timing_s.max() * bounds.fast_mps.max())
    return float(max_m) + picture.kept.max_m


def _pairs_within(max_m: float, position_m: Array) -> tuple[Indices, Indices]:
    """Return the pairs (one < other), in order, of positions (2, N) no farther apart."""
    import scipy  # noqa: PLC0415 - a k-d tree pays only for many vehicles

    near = scipy.spatial.cKDTree(position_m.T).query_pairs(max_m, output_type="ndarray")
    one, other = near.min(axis=1), near.max(axis=1)
    order = np.lexsort((other, one))
    return one[order], other[order]


@cache
def _all_pairs(count: int) -> tuple[Indices, Indices]:
    one, other = np.triu_indices(count, 1)
    return one, other
