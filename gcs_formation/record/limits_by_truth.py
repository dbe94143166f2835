"""Distances to the limits of `safety`, at every instant at which the vehicles' positions are known.

In `run` these are the rows of the emulators' ground truth, whatever the station's ticks did meanwhile; in `fly` they
are the ticks, with positions by telemetry. What the station knew at its last tick holds until the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Indices, Mask
from formation_scenario import Scenario
from formation_scenario.geofence import Geofence
from gcs_formation.record.history import Interval
from gcs_formation.record.separations import STRAIGHT_ON_S, min_separation_m
from gcs_formation.record.timeseries import AIRBORNE, PHASES, POSITION, ROWS_AT_ONCE, TRUTH, VIRTUAL_LEADER, flying

Columns = Mapping[str, Array]
Truth = Callable[[float, float], Mapping[str, Array]]
"""Returns the rows from the last at or before one time to the first after another."""
TRUTH_HZ: Final = 25.0
"""About how many rows of the truth there are in a second: only for the size of blocks."""
NONE: Final = -1


class Track(NamedTuple):
    """The leader's path while the formation is commanded along its path, (N,) each."""

    mission_s: Array
    position_m: Array
    """(3, N) north, east and height; NaN where no vehicle is commanded to lead."""
    leader: Indices
    """Who leads: its column, or `NONE` for a virtual leader."""


class PilotOutside(NamedTuple):
    """How far outside the fence a vehicle was that its pilot or its own failsafe flew, and when."""

    vehicle: VehicleId
    outside_m: float
    time_s: float


@dataclass(frozen=True)
class LimitSeries:
    """Distances (K,) to the limits at instants, and what wasn't seen between them."""

    time_s: Array
    """Instants on the run's clock."""
    tick: Indices
    """The last tick at or before each; -1 before the first."""
    separation_m: Array
    """Least distance of any two vehicles in flight until the next instant; infinite with fewer."""
    clearance_m: Array
    """Least height above the ground; NaN without a vehicle in flight."""
    fence_m: Array
    """How far outside the fence the farthest is that its pilot doesn't fly; 0 if all are inside."""
    farthest: Indices
    """Its column."""
    by_pilots: Sequence[PilotOutside]
    track: Track
    unseen_s: Sequence[Interval]
    """Times of longer than `STRAIGHT_ON_S` without a position, from the first flight to the flight's end."""


class _Motion(NamedTuple):
    """Positions of V vehicles at N instants."""

    time_s: Array
    position_m: Array
    """(3, V, N) north, east, height."""
    airborne: Mask
    """(V, N)."""
    last: bool
    """Whether the last instant counts too; otherwise it begins the next block."""


class _Ticks:
    """What the station knew at its T ticks, of V vehicles."""

    def __init__(self, vehicles: Mapping[VehicleId, Columns]) -> None:
        common = next(iter(vehicles.values()))
        self.time_s, self.mission_s, self.flying = common["t_s"], common["mission_time_s"], flying(common)
        self.leads, self.active = (_stacked(vehicles, name) > 0 for name in ("leads", "active"))
        self.begun: Mask = np.maximum.accumulate(self.active, axis=1)
        """Who has had a setpoint, after take-off."""
        landed = ~(_stacked(vehicles, AIRBORNE)[:, -1:] > 0) if self.time_s.size else np.zeros((len(vehicles), 0))
        self.lands: Mask = (common["phase"] == PHASES.index("loitering")) & landed.astype(bool)
        self.on_path: Mask = np.maximum.accumulate(np.nan_to_num(self.mission_s, nan=-1.0) >= 0.0)
        starts = int(self.on_path.argmax()) if self.on_path.any() else 0
        self.in_formation: Mask = self.on_path & self.begun[:, starts : starts + 1]
        """Who has flown in the formation since the path began."""

    def at(self, time_s: Array) -> tuple[Indices, Callable[[Mask], Mask]]:
        """Return the last tick at or before each instant, and what takes (…, T) flags to these: false before."""
        tick: Indices = np.searchsorted(self.time_s, time_s, side="right") - 1
        held, known = np.maximum(tick, 0), tick >= 0

        def flags(each: Mask) -> Mask:
            return each[..., held] & known if each.shape[-1] else np.zeros((*each.shape[:-1], tick.size), dtype=bool)

        return tick, flags


def limit_series(
    scenario: Scenario,
    vehicles: Mapping[VehicleId, Columns],
    truth: Truth | None,
    pilots_s: Mapping[str, Sequence[Interval]],
    ended_s: float,
) -> LimitSeries:
    """Return how near a flight came to its limits.

    Args:
        scenario: with the limits.
        vehicles: the time series by vehicle, (T,) each; with true columns if there is truth.
        truth: reads the vehicles' ground truth; None if telemetry must do.
        pilots_s: when each vehicle was flown by its pilot or its failsafe, by its name.
        ended_s: the flight's end on the run's clock, s.
    """
    ticks, names = _Ticks(vehicles), list(vehicles)
    fence = None if scenario.fence is None else _FenceJudge(scenario.fence, len(names))
    rows, tracks, who = list[tuple[Array, ...]](), list[Array](), list[Indices]()
    worst = dict[VehicleId, PilotOutside]()
    for motion in _from_ticks(vehicles) if truth is None else _from_truth(truth, ticks, len(names), ended_s):
        count = motion.time_s.size - (not motion.last)
        tick, flags = ticks.at(motion.time_s)
        flown = np.where(motion.airborne, motion.position_m, np.nan)
        lands = flags(ticks.lands)
        outside = np.zeros(motion.airborne.shape)
        if fence is not None:
            outside = fence.outside_m(flown, flags(ticks.in_formation), lands)
        theirs = _within(motion.time_s, names, pilots_s)
        _log_pilots(worst, names, motion.time_s[:count], np.where(theirs, outside, 0.0)[:, :count])
        ours = np.where(theirs, 0.0, outside)
        over_ground = np.where(flags(ticks.begun) & ~lands, _clearance_m(scenario, flown), np.nan)
        nearest_m = min_separation_m(motion.time_s, flown), np.fmin.reduce(over_ground)
        rows.append(tuple(each[:count] for each in (motion.time_s, *nearest_m, ours.max(axis=0))))
        led = flags(ticks.leads & ticks.active & ticks.flying) & motion.airborne
        leader: Indices = led.argmax(axis=0)
        who.append(np.stack((tick, ours.argmax(axis=0), leader))[:, :count])
        tracks.append(np.where(led.any(axis=0), flown[:, leader, np.arange(leader.size)], np.nan)[:, :count])
    time_s, separation_m, clearance_m, fence_m = (
        [np.concatenate(parts) for parts in zip(*rows, strict=True)] if rows else [np.zeros(0)] * 4
    )
    tick, farthest, leader = np.concatenate(who, axis=1) if who else np.zeros((3, 0), dtype=np.intp)
    position_m = np.concatenate(tracks, axis=1) if tracks else np.zeros((3, 0))
    return LimitSeries(
        *(time_s, tick, separation_m, clearance_m, fence_m, farthest),
        by_pilots=sorted(worst.values()),
        track=_track(vehicles, ticks, time_s, position_m, leader),
        unseen_s=_unseen_s(time_s, np.isfinite(clearance_m), ended_s),
    )


def _stacked(vehicles: Mapping[VehicleId, Columns], name: str) -> Array:
    """Return a column of all vehicles, (V, T)."""
    return np.stack([own[name] for own in vehicles.values()])


def _from_ticks(vehicles: Mapping[VehicleId, Columns]) -> Iterator[_Motion]:
    common = next(iter(vehicles.values()))
    names = (TRUTH if TRUTH[0] in common else POSITION)[:3]
    positions_m = np.stack([_stacked(vehicles, name) for name in names])
    airborne = _stacked(vehicles, AIRBORNE) > 0
    yield _Motion(common["t_s"], positions_m, airborne & np.isfinite(positions_m).all(axis=0), last=True)


def _from_truth(truth: Truth, ticks: _Ticks, vehicles: int, ended_s: float) -> Iterator[_Motion]:
    """Yield the truth in blocks, each with the first instant of the next: distances are until the next instant."""
    block_s = ROWS_AT_ONCE / vehicles / TRUTH_HZ
    begin_s = math.floor(float(ticks.time_s[0])) - 1.0 if ticks.time_s.size else 0.0
    while begin_s <= ended_s:
        end_s = begin_s + block_s
        rows = truth(begin_s, min(end_s, ended_s))
        time_s = rows["time_s"]
        first, beyond = int(time_s.searchsorted(begin_s)), int(time_s.searchsorted(min(end_s, ended_s + 1e-9)))
        within = slice(first, min(beyond + 1, time_s.size))
        if beyond > first:
            positions_m = np.stack([rows[name][within].T for name in POSITION])
            ends = within.stop == beyond
            yield _Motion(time_s[within], positions_m, rows[AIRBORNE][within].T >= 1.0, last=ends)
        begin_s = end_s


def _within(time_s: Array, names: Sequence[VehicleId], intervals: Mapping[str, Sequence[Interval]]) -> Mask:
    """Return (V, N) at which instants each vehicle is within one of its intervals."""
    found = np.zeros((len(names), time_s.size), dtype=bool)
    for row, name in enumerate(names):
        for from_s, to_s in intervals.get(str(name), ()):
            found[row] |= (time_s >= from_s) & (time_s <= to_s)
    return found


def _log_pilots(
    worst: dict[VehicleId, PilotOutside], names: Sequence[VehicleId], time_s: Array, outside_m: Array
) -> None:
    """Note the instant at which each pilot's vehicle was farthest outside; `outside_m` is (V, N)."""
    for name, own_m in zip(names, outside_m, strict=True):
        farthest = int(own_m.argmax()) if own_m.size else 0
        if own_m.size and own_m[farthest] > (worst[name].outside_m if name in worst else 0.0):
            worst[name] = PilotOutside(name, float(own_m[farthest]), float(time_s[farthest]))


def _clearance_m(scenario: Scenario, position_m: Array) -> Array:
    """Return the heights above the ground (V, N) at positions (3, V, N); without terrain it is level."""
    if scenario.terrain is None:
        return position_m[2]
    ground_m = [
        scenario.ground.height(north_m, east_m) for north_m, east_m in zip(position_m[0], position_m[1], strict=True)
    ]
    return position_m[2] - np.stack(ground_m)


def _track(
    vehicles: Mapping[VehicleId, Columns], ticks: _Ticks, time_s: Array, position_m: Array, leader: Indices
) -> Track:
    """Return a vehicle's track; a virtual leader's is from the ticks: only the station knows where it is."""
    common = next(iter(vehicles.values()))
    if VIRTUAL_LEADER[0] not in common:
        return Track(time_s - began_s(common), position_m, leader)
    positions_m = np.stack([common[name] for name in VIRTUAL_LEADER[:3]])
    position_m = np.where(ticks.flying & ticks.active.any(axis=0), positions_m, np.nan)
    return Track(ticks.mission_s, position_m, np.full(ticks.time_s.size, NONE, dtype=np.intp))


def began_s(common: Mapping[str, Any]) -> float:
    """Return when the path began on the run's clock, s; NaN if it didn't."""
    since_s = common["t_s"] - common["mission_time_s"]
    known = since_s[np.isfinite(since_s)]
    return float(known[0]) if known.size else math.nan


def _unseen_s(time_s: Array, aloft: Mask, ended_s: float) -> list[Interval]:
    """Return the gaps between instants, from the first at which any vehicle flew to the flight's end."""
    begun = time_s[int(aloft.argmax()) :] if aloft.any() else time_s[:0]
    ends_s = [*begun.tolist(), ended_s] if begun.size else []
    return [(one, other) for one, other in pairwise(ends_s) if other - one > STRAIGHT_ON_S]


class _FenceJudge:
    """How far outside the fence vehicles are, block by block.

    Each of its limits binds a vehicle from when it was first inside it: it takes off below the lowest height. Who flies
    in the formation as the path begins is bound from then on at the latest. The lowest height doesn't bind a landing.
    """

    def __init__(self, fence: Geofence, vehicles: int) -> None:
        self._lowest_m, self._highest_m = fence.heights_m
        self._sides = fence.sides
        self._entered = np.zeros((3, vehicles, 1), dtype=bool)

    def outside_m(self, position_m: Array, in_formation: Mask, lands: Mask) -> Array:
        """Return distances (V, N) from the fence's inside, 0 there, of positions (3, V, N), NaN on the ground."""
        height_m = position_m[2]
        sides_m = np.full(height_m.shape, -np.inf)
        if self._sides is not None:
            sides_m = -self._sides.inside_m(np.moveaxis(position_m[:2], 0, -1))
        beyond_m = np.stack((sides_m, height_m - self._highest_m, self._lowest_m - height_m))
        inside = np.concatenate((self._entered, (beyond_m <= 0.0) | in_formation), axis=-1)
        entered: Mask = np.maximum.accumulate(inside, axis=-1)
        self._entered = entered[..., -1:]
        beyond_m = np.where(entered[..., 1:] & np.isfinite(height_m), np.maximum(beyond_m, 0.0), 0.0)
        side_m, above_m, below_m = beyond_m
        return np.hypot(side_m, np.where(lands, above_m, np.maximum(above_m, below_m)))
