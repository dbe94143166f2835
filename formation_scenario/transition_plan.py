"""Planning of transitions: the shortest that keeps vehicles separated and within their limits.

All vehicles cover the same share of a straight path at the same moment. If positions have a separation of 2√2 R and
goals are assigned with the least sum of squared distances, no two vehicles come within 2 R of each other (Turpin,
Michael, Kumar, "CAPT: Concurrent assignment and planning of trajectories for multiple robots", IJRR 33(1), 2014). The
theorem covers neither the leader nor slots that already move or are assigned by hand; if vehicles would come too near
to each other there, they are separated in height.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Indices, Mask
from flight_model.path_offsets import PEAK_RATE
from formation_scenario.fields import Frame, distinct_texts
from formation_scenario.slot_motion import LeaderFlight, SlotMotion, SlotNeeds, Transition, slot_needs
from formation_scenario.vehicles import VehicleModel

MEAN_SPEED_MPS = 2.0
"""Mean speed of the slot that moves farthest, unless that takes longer than `USUAL_S`."""
MIN_S, USUAL_S, MAX_S = 8.0, 30.0, 240.0
STRETCH = 1.12
"""Factor by which the duration grows from one attempt to the next."""
SAMPLES = 101
SPACING_SHARE = 0.6
"""Distance kept in transition, as a share of the nearest slots' distance: below the 1/√2 that CAPT guarantees."""
MARGIN_M = 2.0
"""Distance added to the separation limit for formation errors."""
RESERVE = 0.9
"""Share of acceleration, turn rate and climb that a transition may use; the rest is left to the law."""
TINY = 1e-9
"""Squared length, m², below which a segment counts as a point; also the limit below which two count as parallel."""


class NotFlyableError(Exception):
    """A transition that can't be flown: what was found, what is allowed, and how long after its beginning, s."""

    def __init__(self, found: str, allowed: str, elapsed_s: float) -> None:
        super().__init__(f"{found}; allowed: {allowed}")
        self.found, self.allowed, self.elapsed_s = found, allowed, elapsed_s


class Limits(NamedTuple):
    """Limits of N vehicles in a transition, and their time constants, (N,) each."""

    ceilings: tuple[Array, Array, Array, Array, Array]
    """Limits of speed, minus speed, acceleration, turn rate and climb, as `_demands` returns them."""
    tau_v_s: Array
    climb_lead_s: Array
    """tau_ha tau_hb / (tau_ha + tau_hb): the time by which height setpoints lead a change of climb."""

    @classmethod
    def of(cls, models: tuple[VehicleModel, ...], speed_mps: float) -> Limits:
        """Return the limits of vehicles of these models behind a leader of this speed."""
        slowest, fastest = np.array([model.soon_mps(speed_mps) for model in models]).T
        accel = np.array([model.accel_max_mps2 for model in models])
        turn = np.array([np.inf if model.hovers else model.turn_rate_max_rps for model in models])
        climb = np.array([model.climb_max_mps for model in models])
        lead = [model.tau_ha_s * model.tau_hb_s / (model.tau_ha_s + model.tau_hb_s) for model in models]
        ceilings = fastest, -slowest, RESERVE * accel, RESERVE * turn, RESERVE * climb
        return cls(ceilings, np.array([model.tau_v_s for model in models]), np.array(lead))


@dataclass(frozen=True)
class Conditions:
    """The conditions under which a transition is planned."""

    flight: Callable[[Array], LeaderFlight]
    """The leader's flight, as a function of the seconds since the transition began."""
    frame: Frame
    limits: Limits
    separation_m: float
    leader: int
    present: Mask
    """(N,) which vehicles are present, and so must be separated."""
    names: tuple[str, ...]
    spacing_share: float = SPACING_SHARE
    height_offset_m: float = 0.0
    """Least height offset of vehicles that would come too near."""


def paths_meet(start_m: Array, goal_m: Array, conditions: Conditions) -> bool:
    """Return whether straight paths from `start_m` to `goal_m` (N, 3) come too near, whenever each is flown."""
    begin, displacement = start_m[conditions.present], (goal_m - start_m)[conditions.present]
    separation_m = _min_separation_m(start_m, goal_m, conditions)
    return bool((segment_distances_m(begin, displacement) < separation_m).any())


def plan_transition(start: SlotMotion, goal_m: Array, at_s: float, conditions: Conditions) -> Transition:
    """Return the shortest transition from `start` to `goal_m` (N, 3) that keeps to all limits.

    Raises:
        NotFlyableError: there is none of at most `MAX_S`.
    """
    farthest_m = float(np.linalg.norm(goal_m - start.position_m, axis=1)[conditions.present].max(initial=0.0))
    duration_s = min(max(farthest_m / MEAN_SPEED_MPS, MIN_S), USUAL_S)
    separation_m = _min_separation_m(start.position_m, goal_m, conditions)
    while True:
        level = Transition(at_s, duration_s, start, goal_m, np.zeros(len(goal_m)), 0.0)
        try:
            return _checked(level, separation_m, conditions)
        except NotFlyableError:
            duration_s *= STRETCH
            if duration_s > MAX_S:
                raise


def _min_separation_m(start_m: Array, goal_m: Array, conditions: Conditions) -> float:
    """Return the distance to keep during the transition, at most that at its beginning and at its end."""
    if conditions.present.sum() < 2:
        return 0.0
    begin, end = (float(_pair_distances_m(positions[conditions.present]).min()) for positions in (start_m, goal_m))
    wanted_m = max(conditions.separation_m + MARGIN_M, conditions.spacing_share * end)
    return min(wanted_m, begin * 0.99, end * 0.99)


def _checked(level: Transition, separation_m: float, conditions: Conditions) -> Transition:
    """Return the transition, with height offsets if vehicles would come too near to each other.

    Raises:
        NotFlyableError: it can't be flown in this duration.
    """
    moments_s = np.linspace(0.0, level.duration_s, SAMPLES)
    flight = conditions.flight(moments_s)
    distances_m = _distances_m(level, flight, moments_s, conditions)
    near = np.flatnonzero(distances_m.min(axis=0) < separation_m)
    if not near.size:
        return replace(level, separation_m=_by_columns(distances_m.min(axis=0), conditions))
    height_offset_m = _height_offsets_m(level, _levels(near, conditions), max(separation_m, conditions.height_offset_m))
    raised = _with_offsets(level, height_offset_m, flight, conditions)
    distances_m = _distances_m(raised, flight, moments_s, conditions)
    _refuse_near(distances_m, separation_m, moments_s, conditions)
    return replace(raised, separation_m=_by_columns(distances_m.min(axis=0), conditions))


def _refuse_beyond(
    transition: Transition, needs: SlotNeeds, flight: LeaderFlight, moments_s: Array, conditions: Conditions
) -> None:
    """Raise `NotFlyableError` if the slots require more than the limits.

    The limits apply to setpoints, which lead the autopilot's time constants, not just to the flight itself. If a slot
    at rest already requires more than a transition may use, that much is allowed.
    """
    still = [
        slot_needs(flight, SlotMotion.at_rest(positions), conditions.frame)
        for positions in (transition.start.position_m, transition.goal_m)
    ]
    flies = conditions.present.copy()
    flies[conditions.leader] = False
    for found, allowed, unit, limit in zip(
        _demands(needs, conditions.limits),
        zip(*(_demands(each, conditions.limits) for each in still), strict=True),
        ("m/s", "m/s", "m/s² of acceleration", "rad/s of turn", "m/s of climb"),
        conditions.limits.ceilings,
        strict=True,
    ):
        excess = np.where(flies, found - np.maximum(limit, np.maximum(*allowed)) - 1e-6, -1.0)
        if excess.max() > 0.0:
            moment, who = np.unravel_index(int(excess.argmax()), excess.shape)
            needed, maximum = distinct_texts(abs(found[moment, who]), abs(limit[who]))
            figure = f"{conditions.names[who]}'s slot would need {needed} {unit} on the way"
            bound = "at least" if limit[who] < 0 else "up to"
            raise NotFlyableError(figure, f"{bound} {maximum} {unit}", float(moments_s[moment]))


def _demands(needs: SlotNeeds, limits: Limits) -> tuple[Array, ...]:
    """Return the demand on each limit, (K, N) each: speed, minus speed, acceleration, turn rate and climb."""
    speed = needs.speed_mps + limits.tau_v_s * needs.accel_mps2
    climb = np.abs(needs.climb_mps + limits.climb_lead_s * needs.climb_change_mps2)
    return speed, -speed, np.abs(needs.accel_mps2), np.abs(needs.turn_rate_rps), climb


def _distances_m(transition: Transition, flight: LeaderFlight, moments_s: Array, conditions: Conditions) -> Array:
    """Return the distances (K, pairs) of all vehicles that are present; raise if they exceed the limits."""
    slots = transition.sample(moments_s)
    needs, positions = slot_needs(flight, slots, conditions.frame), slots.position_m
    _refuse_beyond(transition, needs, flight, moments_s, conditions)
    if conditions.frame == "follower_heading":
        cos, sin = np.cos(needs.relative_heading_rad), np.sin(needs.relative_heading_rad)
        forward, right = positions[..., 0], positions[..., 1]
        positions = np.stack((forward * cos - right * sin, forward * sin + right * cos, positions[..., 2]), axis=-1)
    return _pair_distances_m(positions[:, conditions.present])


def _pair_distances_m(positions_m: Array) -> Array:
    """Return the distance of each pair (..., pairs) of positions (..., N, 3)."""
    one, other = np.triu_indices(positions_m.shape[-2], 1)
    return np.linalg.norm(positions_m[..., one, :] - positions_m[..., other, :], axis=-1)


def segment_distances_m(begin_m: Array, displacement_m: Array) -> Array:
    """Return the least distance (pairs,) of each two of N segments, from `begin_m` along `displacement_m` (N, 3)."""
    one, other = np.triu_indices(len(begin_m), 1)
    d, e, between = displacement_m[one], displacement_m[other], begin_m[one] - begin_m[other]
    dd, ee, de = (np.einsum("pi,pi->p", *pair) for pair in ((d, d), (e, e), (d, e)))
    da, ea = (np.einsum("pi,pi->p", each, between) for each in (d, e))
    # The point of the first that is nearest to the second's line, then the second's nearest to that, and the first's.
    along = np.clip(_ratio(de * ea - ee * da, dd * ee - de * de), 0.0, 1.0)
    along_other = np.clip(_ratio(de * along + ea, ee), 0.0, 1.0)
    along = np.clip(_ratio(de * along_other - da, dd), 0.0, 1.0)
    return np.linalg.norm(between + along[:, None] * d - along_other[:, None] * e, axis=1)


def _ratio(over: Array, under: Array) -> Array:
    return np.divide(over, under, out=np.zeros_like(over), where=under > TINY)


def _pairs(conditions: Conditions) -> Indices:
    """Return the two indices of each pair, (pairs, 2)."""
    there = np.flatnonzero(conditions.present)
    return np.stack([there[index] for index in np.triu_indices(there.size, 1)], axis=1)


def _by_columns(pairs_m: Array, conditions: Conditions) -> Array:
    """Return values of pairs (pairs,) as a table (N, N); infinite for vehicles that aren't present."""
    table_m = np.full((conditions.present.size,) * 2, np.inf)
    one, other = _pairs(conditions).T
    table_m[one, other] = table_m[other, one] = pairs_m
    return table_m


def _levels(near: Indices, conditions: Conditions) -> Array:
    """Return a level (N,) for each vehicle, different for any two that come near; the leader has the lowest."""
    levels = {conditions.leader: 0}
    pairs: list[list[int]] = _pairs(conditions)[near].tolist()
    for who in sorted({index for pair in pairs for index in pair} - {conditions.leader}):
        taken = {levels.get(one if other == who else other) for one, other in pairs if who in (one, other)}
        levels[who] = next(level for level in range(len(taken) + 1) if level not in taken)
    return np.array([float(levels.get(index, 0)) for index in range(conditions.present.size)])


def _height_offsets_m(transition: Transition, levels: Array, separation_m: float) -> Array:
    """Return each vehicle's height offset, (N,): its levels above the highest start or goal of all on lower levels.

    A vehicle that starts or ends lower is raised by that much more; one that is already high by less.
    """
    ends_m = np.stack((transition.start.position_m[:, 2], transition.goal_m[:, 2]))
    below = levels < levels[:, None]
    highest_m = np.where(below, ends_m.max(axis=0), -np.inf).max(axis=1)
    return np.where(levels > 0, np.maximum(levels * separation_m + highest_m - ends_m.min(axis=0), 0.0), 0.0)


def _with_offsets(
    level: Transition, height_offset_m: Array, flight: LeaderFlight, conditions: Conditions
) -> Transition:
    """Return the transition with height offsets, as fast as the climb limits allow besides the leader's climb."""
    room_mps = conditions.limits.ceilings[4] - float(np.abs(flight.climb_mps).max())
    rises = height_offset_m > 0
    if (room_mps[rises] <= 0).any():
        raise NotFlyableError("no climb is left for some to pass over others", "a path less steep there", 0.0)
    # Setpoints also lead the change of climb, so their peak is higher than PEAK_RATE.
    rise_s = 1.3 * PEAK_RATE * float((height_offset_m[rises] / room_mps[rises]).max())
    if rise_s > level.duration_s / 2:
        allowed = "slots less far apart in height, or a path less steep there"
        raise NotFlyableError("no time is left for some to pass over others", allowed, 0.0)
    return replace(level, height_offset_m=height_offset_m, rise_s=rise_s)


def _refuse_near(distances: Array, separation_m: float, moments_s: Array, conditions: Conditions) -> None:
    moment, pair = np.unravel_index(int(distances.argmin()), distances.shape)
    nearest_m = float(distances[moment, pair])
    if nearest_m < separation_m * 0.999:
        pairs: list[list[int]] = _pairs(conditions).tolist()
        one, other = (conditions.names[index] for index in pairs[int(pair)])
        found = f"{one} and {other} would come within {nearest_m:.3g} m on the way"
        raise NotFlyableError(found, f"{separation_m:.3g} m or more", float(moments_s[moment]))
