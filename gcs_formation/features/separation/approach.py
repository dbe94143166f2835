"""Predicted trajectories through a setpoint and the manoeuvre after it, and how near they come to each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

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
    updraught_offset_m,
    velocities,
    velocity_aimed_at,
)

FINE_S, COARSE_S = 0.5, 1.0
"""Time steps of predicted trajectories, before and after `FINE_UNTIL_S`."""
FINE_UNTIL_S = 4.0
"""How far ahead the fine step is used. Tuned: s; 2 to 6; by judgement."""
JERK_MPS3: Final = 5.0
"""Rate at which multirotors change their acceleration: ArduCopter's PSC_JERK_XY; PX4 changes it faster.

While the acceleration changes from one to another, the velocity is carried on by half of the time that this takes.

Tuned: m/s³; 3 to 8; shown by ArduCopter's default.
"""


class ClosestApproach(NamedTuple):
    """Closest approaches of pairs, (P,)."""

    nearest_m: Array
    in_s: Array
    """Time until then."""
    deficit_m_s: Array
    """Integral over time of how much their distance falls short of the minimum; 0 where it is kept."""


class MinimumDistance(NamedTuple):
    """Distance that pairs are to keep, (P,)."""

    distance_m: Array
    timing_s: Array
    """Timing uncertainty of both together, s: it adds distance in proportion to their relative speed."""

    def times(self, share: float) -> MinimumDistance:
        """Return both multiplied by `share`."""
        return MinimumDistance(share * self.distance_m, share * self.timing_s)


def approach(one: Array, other: Array, minimum: MinimumDistance, times_s: Array) -> ClosestApproach:
    """Return the closest approaches of pairs, whose trajectories are straight between samples.

    The distance to keep grows by `timing_s` times the relative speed, as timing errors displace the predictions. It
    depends on the trajectories alone, so those that are safe stay safe while they are flown.

    Args:
        one: (3, S, P) positions of the one vehicle of each pair.
        other: (3, S, P), those of the other.
        minimum: distance to keep.
        times_s: (S,) of the samples.
    """
    relative = other - one
    begin, step = relative[:, :-1], np.diff(relative, axis=1)
    squared = np.maximum((step**2).sum(axis=0), 1e-12)
    share = within(-(begin * step).sum(axis=0) / squared, 0.0, 1.0)
    distance = np.sqrt(((begin + share * step) ** 2).sum(axis=0))
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
    """Return which others (O,) may come nearer than the minimum to any of one vehicle's trajectories, seen from above.

    The test is conservative: it uses the bounding boxes of the trajectories between successive samples.

    Args:
        ours: (2, S, M) north and east of the one vehicle's trajectories.
        theirs: (2, S, O), the trajectory of each of the others.
        minimum: distance that the one and each of them are to keep, (O,).
        times_s: (S,) of the samples.
    """
    steps_s = np.diff(times_s)
    fast_mps = np.linalg.norm(np.diff(ours, axis=1), axis=0).max(axis=1) / steps_s
    fast_mps = fast_mps[:, None] + np.linalg.norm(np.diff(theirs, axis=1), axis=0) / steps_s[:, None]
    low, high = np.minimum(ours[:, 1:], ours[:, :-1]).min(axis=2), np.maximum(ours[:, 1:], ours[:, :-1]).max(axis=2)
    above = np.minimum(theirs[:, 1:], theirs[:, :-1]) - high[:, :, None]
    below = low[:, :, None] - np.maximum(theirs[:, 1:], theirs[:, :-1])
    distance_m = np.linalg.norm(np.maximum(np.maximum(above, below), 0.0), axis=0)
    return (distance_m < minimum.distance_m + minimum.timing_s * fast_mps).any(axis=0)


class Manoeuvre(Columns):
    """Manoeuvres of vehicles, (N,) columns: a first setpoint, and a lasting one after it."""

    __slots__ = ()

    speed_mps = Row(3)
    """Lasting speed; NaN: the one flown by then."""
    heading_rad = Row(4)
    """Lasting heading; NaN: the one flown by then."""
    height_m = Row(5)
    """Lasting height; NaN: the one reached when the climb of then has been stopped."""
    air_motion = Row(slice(3, 5))
    """Lasting speed and heading, (2, N)."""

    def __init__(self, first: Setpoints, speed_mps: Array, heading_rad: Array, height_m: Array) -> None:
        """Take the first and the lasting setpoints."""
        super().__init__(*first.table, speed_mps, heading_rad, height_m)

    @property
    def first(self) -> Setpoints:
        """The first setpoints."""
        return Setpoints.of(self.table[:3])


@dataclass(frozen=True)
class Traffic:
    """Vehicles at the instants at which their present setpoints act, (N,) columns."""

    state: FlightStates
    lead_s: Array
    """Time from those instants to the common instant at which predictions start."""
    turn_rps: Array
    """Turn rates of uncommanded vehicles; 0 for commanded ones."""
    model: AutopilotModels
    accel_mps2: Array
    """Present horizontal accelerations of multirotors, (2, N) north and east; 0 where not known."""
    hovers: bool
    """Whether they are multirotors, commanded by velocity over ground; else by speed and heading."""

    def select(self, which: Indices) -> Traffic:
        """Return the columns at `which`, repeated as often as they occur there."""
        state, model = self.state.select(which), self.model.select(which)
        return Traffic(state, self.lead_s[which], self.turn_rps[which], model, self.accel_mps2[:, which], self.hovers)

    def turning(self) -> Traffic:
        """Return these vehicles, each turning clockwise at its largest turn rate."""
        return Traffic(self.state, self.lead_s, self.model.turn_rate_max_rps, self.model, self.accel_mps2, self.hovers)

    def followed_by(self, other: Traffic) -> Traffic:
        """Return these vehicles followed by others."""
        return Traffic(
            FlightStates.of(np.concatenate((self.state.table, other.state.table), axis=1)),
            np.concatenate((self.lead_s, other.lead_s)),
            np.concatenate((self.turn_rps, other.turn_rps)),
            AutopilotModels.of(np.concatenate((self.model.table, other.model.table), axis=1)),
            np.concatenate((self.accel_mps2, other.accel_mps2), axis=1),
            self.hovers,
        )


def sample_times(first_s: float, horizon_s: float) -> Array:
    """Return the sample times (S,) of predicted trajectories: 0, `first_s`, and so on to the horizon."""
    fine = np.arange(first_s, min(FINE_UNTIL_S, horizon_s), FINE_S)
    coarse = np.arange(fine[-1] + COARSE_S, horizon_s + COARSE_S, COARSE_S)
    return np.concatenate(((0.0,), fine, coarse))


def fly(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array, trails_m: Array) -> Array:
    """Return the positions (3, S, N), north, east and up, at `times_s` by model (7), for multirotors by velocity.

    The first setpoint acts until `times_s[1]`. A height that the envelope doesn't allow as a setpoint yet is approached
    as it will be commanded: by setpoints at the edge of the envelope. Vehicles level off `trails_m` (N,) below that.
    """
    begin, turned, accel_mps2 = _begun(traffic, manoeuvre, times_s)
    heights = _heights(traffic.model, turned, manoeuvre.height_m, np.diff(times_s[1:]), trails_m)
    level = _level(traffic, manoeuvre, times_s, begin, turned, accel_mps2)
    return np.concatenate((level, np.vstack((begin.height_m, heights))[None]))


def fly_level(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array) -> Array:
    """Return north and east of the same positions (2, S, N), at a quarter of the cost."""
    return _level(traffic, manoeuvre, times_s, *_begun(traffic, manoeuvre, times_s))


def reach_m(model: AutopilotModels) -> Array:
    """Return the largest distance of a height setpoint from the present height, as in the envelope (N,)."""
    return model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)


def _begun(traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array) -> tuple[FlightStates, FlightStates, Array]:
    """Return the states at the first two samples, between which the first setpoint acts, and the last accelerations."""
    count = traffic.lead_s.size
    twice = np.concatenate((np.arange(count), np.arange(count)))
    both, elapsed_s = traffic.select(twice), np.concatenate((traffic.lead_s, traffic.lead_s + times_s[1]))
    commanded, accel_mps2 = manoeuvre.first.table[:, twice], both.accel_mps2
    if traffic.hovers:
        state, accel_mps2 = _hovered(both, commanded, elapsed_s)
    else:
        state = advance(both.state, commanded, elapsed_s, both.model).turned(both.turn_rps, elapsed_s)
    return state.select(twice[:count]), state.select(twice[count:] + count), accel_mps2[:, count:]


@dataclass(frozen=True)
class CarriedOn:
    """What multirotors' accelerations add to velocities predicted without a limit of jerk, until these have changed.

    Prediction begins with the velocity that the change adds in all; `left_mps` of it hasn't been added yet.
    """

    change_mps2: Array
    """(2, N) of the acceleration, from the one wanted to the present one."""
    lasts_s: Array
    """(N,) how long it takes."""

    @classmethod
    def of(cls, accel_mps2: Array, from_mps: Array, aim_mps: Array, model: AutopilotModels) -> CarriedOn:
        """Return that of vehicles which begin to change from one velocity to another, (2, N) each."""
        change = accel_mps2 - _wanted_mps2(from_mps, aim_mps, model)
        return cls(change, np.hypot(change[0], change[1]) / JERK_MPS3)

    @property
    def all_mps(self) -> Array:
        """Velocity added in all, (2, N)."""
        return self.change_mps2 * (self.lasts_s / 2)

    def share_left(self, time_s: Array) -> Array:
        """Return the share of the change that is still to come after some time."""
        return np.maximum(self.lasts_s - time_s, 0.0) / np.maximum(self.lasts_s, 1e-9)

    def left_mps(self, time_s: Array) -> Array:
        """Return the velocity that hasn't been added after times (S, N) or (S, 1), as (2, S, N)."""
        return self.all_mps[:, None] * self.share_left(time_s) ** 2

    def behind_m(self, time_s: Array) -> Array:
        """Return the distance (2, N) that `left_mps` makes in a time (N,)."""
        return self.all_mps * (self.lasts_s / 3 * (1 - self.share_left(time_s) ** 3))


def _wanted_mps2(from_mps: Array, aim_mps: Array, model: AutopilotModels) -> Array:
    """Return the accelerations (2, N) of the model on its way from one velocity to another."""
    error = aim_mps - from_mps
    size = np.hypot(error[0], error[1])
    return error * np.minimum(1 / model.tau_v_s, model.accel_max_mps2 / np.maximum(size, 1e-9))


def _hovered(traffic: Traffic, commanded: Array, elapsed_s: Array) -> tuple[FlightStates, Array]:
    """Return multirotors' states and accelerations when setpoints (3, N) have been held for `elapsed_s` (N,)."""
    begin, model = traffic.state, traffic.model
    aim_mps = velocity_aimed_at(begin, commanded[:2], model)
    on = CarriedOn.of(traffic.accel_mps2, begin.ground_mps, aim_mps, model)
    aimed = np.array((*_polar(aim_mps), commanded[2]))
    state = advance_hovering(_moving(begin, begin.level_m, begin.ground_mps + on.all_mps), aimed, elapsed_s, model)
    accel_mps2 = _wanted_mps2(state.ground_mps, aim_mps, model) + on.change_mps2 * on.share_left(elapsed_s)
    level_m, ground_mps = state.level_m - on.behind_m(elapsed_s), state.ground_mps - on.left_mps(elapsed_s[None])[:, 0]
    return _moving(state, level_m, ground_mps), accel_mps2


def _polar(velocity_mps: Array) -> tuple[Array, Array]:
    return np.hypot(velocity_mps[0], velocity_mps[1]), np.arctan2(velocity_mps[1], velocity_mps[0])


def _moving(state: FlightStates, level_m: Array, velocity_mps: Array) -> FlightStates:
    """Return multirotors' states with other positions and velocities over ground, (2, N)."""
    height, still = (state.height_m, state.climb_mps), np.zeros_like(level_m)
    return FlightStates.of(np.array((*level_m, *height, *_polar(velocity_mps), *still, state.updraught_mps)))


def _level(
    traffic: Traffic, manoeuvre: Manoeuvre, times_s: Array, begin: FlightStates, turned: FlightStates, accel_mps2: Array
) -> Array:
    first, since_s = begin.level_m[:, None], times_s[1:] - times_s[1]
    return np.concatenate((first, _trajectory(traffic, turned, manoeuvre, since_s, accel_mps2)), axis=1)


def _trajectory(
    traffic: Traffic, state: FlightStates, manoeuvre: Manoeuvre, times_s: Array, accel_mps2: Array
) -> Array:
    """Return (2, S, N) north and east, `times_s` after `state`, by the trapezium rule of the velocity."""
    model, since_s = traffic.model, times_s[:, None]
    if traffic.hovers:
        aim_mps = velocity_aimed_at(state, manoeuvre.air_motion, model)
        on = CarriedOn.of(accel_mps2, state.ground_mps, aim_mps, model)
        velocity = velocities(state.ground_mps + on.all_mps, aim_mps, since_s, model) - on.left_mps(since_s)
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
    steps, max_m = HeightSteps.of(model, steps_s[:, None]), reach_m(model)
    height = Height(state.height_m, state.climb_mps)
    lifted_m = updraught_offset_m(state, model)
    target_m = steps.commanded_m(height, target_m, lifted_m) - trails_m
    heights = [height.height_m]
    for k in range(steps_s.size):
        aim_m = np.minimum(np.maximum(target_m, height.height_m - max_m), height.height_m + max_m)
        height = steps.after(k, height, aim_m + lifted_m)
        heights.append(height.height_m)
    return np.array(heights)
