"""All that the separation rule looks at in one tick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcs_formation.arrays import Array, Mask, within
from gcs_formation.estimation.flight_state import FlightState, Indices, Setpoints
from gcs_formation.separation.distance import Kept
from gcs_formation.separation.manoeuvre import Manoeuvre, Traffic, reach_m

BESIDE_M = 1.0
"""How much farther than the kept distance above or below another a vehicle aims that gives way."""


@dataclass(frozen=True)
class Scene:
    """Vehicles, (N,) columns, in the order in which they go first: the last one gives way first."""

    traffic: Traffic
    told: Setpoints
    """By the law; NaN for those that aren't commanded."""
    commanded: Mask
    vehicles: Indices
    """(N,) whose columns they are: one that may be in two places has two, which don't keep apart."""
    kept_m: float
    """Distance that two keep that are commanded."""
    kept_from_others_m: float
    """The one that's kept from those that aren't."""
    timing_s: Array
    """(N,) how much earlier or later than reckoned a vehicle may be where it's reckoned to be."""
    reference: int
    """The vehicle along whose velocity the others can always fly: the leader."""
    floor: Callable[[FlightState], Array]
    """Gives the height (N,) that no vehicle is sent below by the rule."""
    times_s: Array
    """(S,) at which ways are looked at."""

    @cached_property
    def velocity_mps(self) -> Array:
        """Ground velocity north and east, (2, N)."""
        state = self.traffic.state
        north = state.airspeed_mps * np.cos(state.heading_rad) + state.wind_north_mps
        return np.array((north, state.airspeed_mps * np.sin(state.heading_rad) + state.wind_east_mps))

    @cached_property
    def along(self) -> tuple[Array, Array]:
        """Airspeed and heading of the reference as each vehicle can fly them, (N,); NaN for those not commanded."""
        state, model = self.traffic.state, self.traffic.model
        speed = within(state.airspeed_mps[self.reference], model.speed_min_mps, model.speed_max_mps)
        heading = np.full(speed.size, state.heading_rad[self.reference])
        return np.where(self.commanded, speed, np.nan), np.where(self.commanded, heading, np.nan)

    def lasting(self, vehicle: int) -> tuple[float, float]:
        """Return airspeed and heading that a vehicle can go on with when it has flown as told: the reference's.

        The reference itself flies on as it then does (NaN). In a bend it turns while it's told to, and straight on
        isn't the heading of now any more: a way that begins so and turns back couldn't be flown on at the next tick.
        """
        speed, heading = self.along
        turns = vehicle == self.reference
        return (np.nan, np.nan) if turns else (float(speed[vehicle]), float(heading[vehicle]))

    def kept(self, one: Indices, other: Indices) -> Kept:
        """Return what pairs are to keep (P,)."""
        both = self.commanded[one] & self.commanded[other]
        apart = self.vehicles[one] != self.vehicles[other]
        distance_m: Array = np.where(both, self.kept_m, self.kept_from_others_m)
        return Kept(apart * distance_m, apart * (self.timing_s[one] + self.timing_s[other]))

    @cached_property
    def floor_m(self) -> Array:
        """The height that no vehicle is sent below, (N,)."""
        return self.floor(self.traffic.state)

    def as_told(self) -> Manoeuvre:
        """Return what everyone does if nothing gives way: as told, then along the reference at the told height.

        Those that aren't commanded go on as they do.
        """
        told = self.told
        return Manoeuvre(told, *self.along, told.height_m)

    def straight(self, which: Indices) -> Manoeuvre:
        """Return the same for some, but straight on instead of along the reference."""
        told, on = self.told.take(which), np.full(which.size, np.nan)
        return Manoeuvre(told, on, on, told.height_m)

    def within_reach(self, which: Indices, height_m: Array) -> Array:
        """Return heights as near to the vehicles' own as they may be told (N,)."""
        own_m, most_m = self.traffic.state.height_m[which], reach_m(self.traffic.model.take(which))
        return within(height_m, own_m - most_m, own_m + most_m)


def take_height(scene: Scene, vehicle: int, height_m: Array) -> Manoeuvre:
    """Return the ways to get to each of some heights, (4 M,) columns, the mildest first.

    The course as told, then along the reference or straight on; along the reference at once; straight on at once.
    """
    which = np.full(height_m.size, vehicle, dtype=np.intp)
    now, told = scene.traffic.state, scene.told
    on = np.full(height_m.size, np.nan)
    along = [np.full(height_m.size, value[vehicle]) for value in scene.along]
    lasting = [np.full(height_m.size, value) for value in scene.lasting(vehicle)]
    first_m = scene.within_reach(which, height_m)
    course = [np.full(height_m.size, value[vehicle]) for value in (told.speed_mps, told.heading_rad)]
    kept = [np.full(height_m.size, value[vehicle]) for value in (now.airspeed_mps, now.heading_rad)]
    ways = ((course, lasting), (course, [on, on]), (along, lasting), (kept, [on, on]))
    rows = [np.stack((*first, first_m, *then, height_m)) for first, then in ways]
    return Manoeuvre.of(np.stack(rows, axis=2).reshape(6, -1))


def free_heights(scene: Scene, vehicle: int, others: Indices, ends_m: Array, side: float) -> Array:
    """Return the heights at which a vehicle passes others that end at `ends_m`.

    Those on its side come first, then the nearest; upwards where it's the same.
    """
    kept = scene.kept(np.full(others.size, vehicle, dtype=np.intp), others)
    passing_mps = _length(scene.velocity_mps[:, others] - scene.velocity_mps[:, [vehicle]])
    beside_m = kept.distance_m + kept.off_s * passing_mps + BESIDE_M
    heights = np.concatenate((ends_m + beside_m, ends_m - beside_m))
    sides = np.repeat((1.0, -1.0), others.size)
    allowed = heights >= scene.floor_m[vehicle]
    heights, sides = heights[allowed], sides[allowed]
    own_m = float(scene.traffic.state.height_m[vehicle])
    other_side = (sides != side) & (side != 0)
    far_m = np.round(np.abs(heights - own_m), 6)
    return heights[np.lexsort((-sides, far_m, other_side))]


def _length(vectors: Array) -> Array:
    """Return the lengths of (2, N) vectors."""
    return np.hypot(vectors[0], vectors[1])
