"""Where vehicles get to by what they are commanded and by a manoeuvre kept up, and how near they come to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Indices, Mask, within
from flight_model.vehicle_arrays import (
    AutopilotModels,
    Columns,
    FlightStates,
    Height,
    HeightSteps,
    Row,
    Setpoints,
    advance,
    advance_hovering,
    air_errors,
    lift_m,
    velocities,
    velocity_aimed_at,
)

FINE_S, COARSE_S = 0.5, 1.0
"""Steps in which a manoeuvre is looked at, before and after `FINE_UNTIL_S`."""
FINE_UNTIL_S = 4.0


class ClosestApproach(NamedTuple):
    """How near pairs come, (P,)."""

    nearest_m: Array
    in_s: Array
    """When."""
    deficit_m_s: Array
    """Integral over time of what their distance lacks of the one that is to be kept; 0 where it's kept."""


class MinimumDistance(NamedTuple):
    """What pairs are to keep, (P,)."""

    distance_m: Array
    timing_s: Array
    """Timing uncertainty of both together, s: the faster they pass each other, the more distance it adds."""

    def times(self, share: float) -> MinimumDistance:
        """Return a share of the distance and of the timing."""
        return MinimumDistance(share * self.distance_m, share * self.timing_s)


def approach(one: Array, other: Array, minimum: MinimumDistance, times_s: Array) -> ClosestApproach:
    """Return how near pairs come; between the samples they move straight.

    The faster they move past each other, the farther may they be from where they're reckoned to be: the distance that
    they keep grows with `timing_s`. It depends on the way alone: what is safe on a way stays safe while it is flown.

    Args:
        one: (3, S, P) places of the one vehicle of each pair.
        other: (3, S, P), those of the other.
        minimum: what they are to keep.
        times_s: (S,) of the samples.
    """
    apart = other - one
    begin, way = apart[:, :-1], np.diff(apart, axis=1)
    squared = np.maximum((way**2).sum(axis=0), 1e-12)
    share = within(-(begin * way).sum(axis=0) / squared, 0.0, 1.0)
    distance = np.sqrt(((begin + share * way) ** 2).sum(axis=0))
    steps_s = np.diff(times_s)[:, None]
    needed_m = minimum.distance_m + minimum.timing_s * np.sqrt(squared) / steps_s
    when = np.argmin(distance, axis=0)
    pairs = np.arange(minimum.distance_m.size, dtype=np.intp)
    return ClosestApproach(
        distance[when, pairs],
        (times_s[:-1, None] + share * steps_s)[when, pairs],
        (np.maximum(needed_m - distance, 0.0) * steps_s).sum(axis=0),
    )


def may_come_near(ours: Array, theirs: Array, minimum: MinimumDistance, times_s: Array) -> Mask:
    """Return whom (O,) any of one vehicle's ways may bring nearer than it's to keep, seen from above.

    From the boxes around ways between one sample and the next: nobody is left out that comes too near.

    Args:
        ours: (2, S, M) north and east of the one vehicle's ways.
        theirs: (2, S, O), the way of each of the others.
        minimum: what each of them and the one are to keep, (O,).
        times_s: (S,) of the samples.
    """
    steps_s = np.diff(times_s)
    fast_mps = np.linalg.norm(np.diff(ours, axis=1), axis=0).max(axis=1) / steps_s
    fast_mps = fast_mps[:, None] + np.linalg.norm(np.diff(theirs, axis=1), axis=0) / steps_s[:, None]
    low, high = np.minimum(ours[:, 1:], ours[:, :-1]).min(axis=2), np.maximum(ours[:, 1:], ours[:, :-1]).max(axis=2)
    above = np.minimum(theirs[:, 1:], theirs[:, :-1]) - high[:, :, None]
    below = low[:, :, None] - np.maximum(theirs[:, 1:], theirs[:, :-1])
    apart_m = np.linalg.norm(np.maximum(np.maximum(above, below), 0.0), axis=0)
    return (apart_m < minimum.distance_m + minimum.timing_s * fast_mps).any(axis=0)


class Manoeuvre(Columns):
    """What vehicles do one after the other, (N,) columns: a setpoint first, then another for good."""

    __slots__ = ()

    speed_mps = Row(3)
    """NaN: at the speed that they then have."""
    heading_rad = Row(4)
    """NaN: on the heading that they then have."""
    height_m = Row(5)
    """NaN: at the height that they come to when they stop climbing."""
    air_motion = Row(slice(3, 5))
    """Speed and heading, (2, N)."""

    def __init__(self, first: Setpoints, speed_mps: Array, heading_rad: Array, height_m: Array) -> None:
        """Put the manoeuvres together."""
        super().__init__(*first.table, speed_mps, heading_rad, height_m)

    @property
    def first(self) -> Setpoints:
        """The setpoint that comes first."""
        return Setpoints.of(self.table[:3])


@dataclass(frozen=True)
class Traffic:
    """Vehicles when what they are commanded now acts, (N,) columns."""

    state: FlightStates
    lead_s: Array
    """How long before the instant that counting begins at, the same for all, their setpoints act."""
    turn_rps: Array
    """How they turn if nobody commands them; 0 for those that are commanded."""
    model: AutopilotModels
    hovers: bool
    """Whether they are multirotors, which fly velocities over ground; else they fly by speed and heading."""

    def take(self, which: Indices) -> Traffic:
        """Return the columns of the vehicles at `which`, repeated as often as named."""
        state, model = self.state.take(which), self.model.take(which)
        return Traffic(state, self.lead_s[which], self.turn_rps[which], model, self.hovers)

    def turning(self) -> Traffic:
        """Return these vehicles if each turns clockwise as tightly as it can."""
        return Traffic(self.state, self.lead_s, self.model.turn_rate_max_rps, self.model, self.hovers)

    def beside(self, other: Traffic) -> Traffic:
        """Return these vehicles and others, in this order."""
        return Traffic(
            FlightStates.of(np.concatenate((self.state.table, other.state.table), axis=1)),
            np.concatenate((self.lead_s, other.lead_s)),
            np.concatenate((self.turn_rps, other.turn_rps)),
            AutopilotModels.of(np.concatenate((self.model.table, other.model.table), axis=1)),
            self.hovers,
        )


def sample_times(first_s: float, horizon_s: float) -> Array:
    """Return the instants (S,) at which a manoeuvre is looked at: 0, `first_s`, and so on to the horizon."""
    fine = np.arange(first_s, min(FINE_UNTIL_S, horizon_s), FINE_S)
    coarse = np.arange(fine[-1] + COARSE_S, horizon_s + COARSE_S, COARSE_S)
    return np.concatenate(((0.0,), fine, coarse))


def fly(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array, trails_m: Array) -> Array:
    """Return the places (3, S, N), north, east and up, at `times_s` by model (7), of multirotors by their velocity.

    The first setpoint acts until `times_s[1]`. A height beyond what the envelope lets a vehicle be commanded at once is
    approached as it will be commanded: by setpoints that run ahead of it. Vehicles get to `trails_m` (N,) below that.
    """
    begin, turned = _begun(traffic, manoeuvre, times_s)
    heights = _heights(traffic.model, turned, manoeuvre.height_m, np.diff(times_s[1:]), trails_m)
    level = _level(traffic, manoeuvre, times_s, begin, turned)
    return np.concatenate((level, np.vstack((begin.height_m, heights))[None]))


def fly_level(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array) -> Array:
    """Return the north and east of the same places (2, S, N), at a quarter of the cost."""
    return _level(traffic, manoeuvre, times_s, *_begun(traffic, manoeuvre, times_s))


def reach_m(model: AutopilotModels) -> Array:
    """Return how far from a vehicle's height its setpoint may be, as in the envelope (N,)."""
    return model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)


def _begun(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array) -> tuple[FlightStates, FlightStates]:
    """Return the states at the first two instants: until then the first setpoint acts."""
    count = traffic.lead_s.size
    twice = np.concatenate((np.arange(count), np.arange(count)))
    both, elapsed_s = traffic.take(twice), np.concatenate((traffic.lead_s, traffic.lead_s + times_s[1]))
    later = advance_hovering if traffic.hovers else advance
    state = later(both.state, manoeuvre.first.table[:, twice], elapsed_s, both.model)
    state = state.turned(both.turn_rps, elapsed_s)
    return state.take(twice[:count]), state.take(twice[count:] + count)


def _level(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array, begin: FlightStates, turned: FlightStates) -> Array:
    first = begin.level_m[:, None]
    return np.concatenate((first, _way(traffic, turned, manoeuvre, times_s[1:] - times_s[1])), axis=1)


def _way(traffic: Traffic, state: FlightStates, manoeuvre: Manoeuvre, times_s: Array) -> Array:
    """Return (2, S, N) north and east, `times_s` after `state`, by the trapezium rule of the velocity."""
    model, since_s = traffic.model, times_s[:, None]
    if traffic.hovers:
        aim_mps = velocity_aimed_at(state, manoeuvre.air_motion, model)
        velocity = velocities(state.ground_mps, aim_mps, since_s, model)
    else:
        error = air_errors(state.air_motion, manoeuvre.air_motion)
        along = state.air_motion + error - model.remaining(error, since_s[:, None])
        speed, heading = along[:, 0], along[:, 1] + traffic.turn_rps * since_s
        velocity = speed * np.array((np.cos(heading), np.sin(heading))) + state.wind_mps[:, None]
    steps = (velocity[:, 1:] + velocity[:, :-1]) / 2 * np.diff(times_s)[:, None]
    begin = state.level_m[:, None]
    return np.concatenate((begin, begin + np.cumsum(steps, axis=1)), axis=1)


def _heights(model: AutopilotModels, state: FlightStates, target_m: Array, steps_s: Array, trails_m: Array) -> Array:
    """Return (S, N) heights from `state` on."""
    steps, most_m = HeightSteps.of(model, steps_s[:, None]), reach_m(model)
    height = Height(state.height_m, state.climb_mps)
    lifted_m = lift_m(state, model)
    target_m = steps.commanded_m(height, target_m, lifted_m) - trails_m
    heights = [height.height_m]
    for k in range(steps_s.size):
        aim_m = np.minimum(np.maximum(target_m, height.height_m - most_m), height.height_m + most_m)
        height = steps.after(k, height, aim_m + lifted_m)
        heights.append(height.height_m)
    return np.array(heights)
