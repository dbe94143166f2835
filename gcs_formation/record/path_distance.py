"""How far the leader and the formation's centre are from the path, and whether the leader left it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Indices, Mask, offset_points
from flight_model.path import FlightPath
from formation_scenario import Scenario
from formation_scenario.planned_progress import planned_m
from formation_scenario.slot_frame import axis_rad
from gcs_formation.guidance.parts import BEFORE_M, AlongPath
from gcs_formation.record.limits_by_truth import Track, began_s
from gcs_formation.record.timeseries import AIRBORNE, POSITION, SLOT, TRUTH, VIRTUAL_LEADER, flying

EVERY_S: Final = 1.0
"""Interval at which the leader's progress along the path is followed step by step; between them it is interpolated."""
TURNING_S: Final = 0.2
"""The same on a path with turns in place, where the nearest point changes from one leg to the other."""
GAP_S: Final = 3.0
"""After a longer time without a position the nearest point is searched ahead, as far as could have been flown."""
REACH: Final = 2.0
"""Multiple of the planned speed that such a search allows for."""
NEWTON_STEPS: Final = 4
MIN_SHARE: Final = 0.2
"""Lower bound of 1 - curvature × distance in Newton's method: nearer to a bend's centre no point is the nearest."""
OFF_PATH_S: Final = 10.0
"""How long a leader may be farther from its path than `safety.path_distance_m`."""
FIGURES: Final = ("across_m", "along_m", "height_m")
Columns = Mapping[str, Array]


class Distances(NamedTuple):
    """From the path, (N,) each; NaN where the position isn't known."""

    across_m: Array
    """Horizontal distance from the nearest point, positive to its right."""
    along_m: Array
    """Along the path from where it was planned to be at the time; positive ahead."""
    height_m: Array
    """Above the path's height at the nearest point."""


class OffPath(NamedTuple):
    """A time in which the leader was off its path for longer than `OFF_PATH_S`."""

    vehicle: int
    """The leader's column; -1 for a virtual one."""
    from_s: float
    """Mission time."""
    for_s: float
    farthest_m: float
    """Largest distance, at a mission time of `farthest_at_s`."""
    farthest_at_s: float


def distances(
    scenario: Scenario, mission_s: Array, position_m: Array, speeds_mps: Sequence[tuple[float, float]] = ()
) -> Distances:
    """Return how far positions (3, N) are from the leader's path at rising mission times (N,).

    `speeds_mps`: mission times at which another speed was ordered, and this speed.
    """
    known = np.isfinite(mission_s) & np.isfinite(position_m).all(axis=0)
    found = Distances(*(np.full(mission_s.size, np.nan) for _ in FIGURES))
    if not known.any():
        return found
    path, times_s, (north_m, east_m, height_m) = scenario.leader_path, mission_s[known], position_m[:, known]
    along_m = _along_m(path, scenario.path.fastest_mps, times_s, north_m, east_m)
    point = path.at(along_m)
    cos, sin = np.cos(point.course_rad), np.sin(point.course_rad)
    found.across_m[known] = cos * (east_m - point.east_m) - sin * (north_m - point.north_m)
    found.along_m[known] = along_m - planned_m(scenario, times_s, speeds_mps)
    found.height_m[known] = height_m - point.height_m
    return found


def _along_m(path: FlightPath, speed_mps: float, time_s: Array, north_m: Array, east_m: Array) -> Array:
    """Return the distances along the path (N,) of the points nearest to positions along it, m.

    Followed from its start, for a path may come near itself again.
    """
    every_s = TURNING_S if path.turns_in_place else EVERY_S
    seconds = np.arange(time_s[0], time_s[-1] + every_s, every_s)
    some = np.flatnonzero(np.bincount(np.minimum(np.searchsorted(time_s, seconds), time_s.size - 1)))
    follower, last_s, found, parts = AlongPath(path), 0.0, list[float](), list[tuple[float, float]]()
    for now_s, north, east in zip(time_s[some].tolist(), north_m[some].tolist(), east_m[some].tolist(), strict=True):
        if now_s - last_s > GAP_S:
            found.append(follower.search(north, east, REACH * speed_mps * (now_s - last_s)))
        else:
            found.append(follower.project(north, east))
        last_s = now_s
        parts.append((follower.part.begin_m, follower.part.end_m - BEFORE_M))
    along_m = np.interp(time_s, time_s[some], np.array(found))
    begin_m, end_m = np.array(parts)[np.minimum(np.searchsorted(time_s[some], time_s), len(parts) - 1)].T
    for _ in range(NEWTON_STEPS):
        along_m = np.clip(along_m, begin_m, end_m)
        point = path.at(along_m)
        cos, sin = np.cos(point.course_rad), np.sin(point.course_rad)
        north, east = north_m - point.north_m, east_m - point.east_m
        bend = 1.0 - point.curvature_1pm * (east * cos - north * sin)
        along_m = along_m + (north * cos + east * sin) / np.maximum(bend, MIN_SHARE)
    return np.clip(along_m, begin_m, end_m)


def figures(found: Distances, window: Mask) -> dict[str, dict[str, float | None]]:
    """Return root mean square and maximum of each distance over a (N,) window, by their names in summary.json."""
    return {name: _figures(values[window]) for name, values in zip(FIGURES, found, strict=True)}


def _figures(values: Array) -> dict[str, float | None]:
    known = values[np.isfinite(values)]
    if not known.size:
        return {"rms": None, "max": None}
    return {"rms": float(np.sqrt(np.mean(known**2))), "max": float(np.abs(known).max())}


def leader_position_m(vehicles: Mapping[VehicleId, Columns], names: Sequence[str]) -> Array:
    """Return the leader's position at each tick, (3, T): true if there is truth, NaN where it's absent or doesn't fly.

    `names`: the columns of a vehicle's position.
    """
    common = next(iter(vehicles.values()))
    if VIRTUAL_LEADER[0] in common:
        return np.stack([common[name] for name in VIRTUAL_LEADER[:3]])
    position_m = np.full((3, common["t_s"].size), np.nan)
    for own in vehicles.values():
        leads = (own["leads"] > 0) & (own[AIRBORNE] > 0)
        position_m[:, leads] = np.stack([own[name][leads] for name in names])
    return position_m


def centre(scenario: Scenario, vehicles: Mapping[VehicleId, Columns]) -> Array:
    """Return the formation's centre at each tick, (3, T): the mean of its members' positions less their own slots.

    Members are commanded vehicles in flight; the leader's slot is at the leader.
    """
    common = next(iter(vehicles.values()))
    true = TRUTH[0] in common
    names, heading_name = (TRUTH[:3], "true_heading_rad") if true else (POSITION, "heading_rad")
    leader_rad = _leader_heading(vehicles, heading_name)
    each = list[Array]()
    for own in vehicles.values():
        leads = own["leads"] > 0
        forward_m, right_m, up_m = (np.where(leads, 0.0, own[name]) for name in SLOT)
        heading_rad = axis_rad(scenario.formation.frame, leader_rad, own[heading_name])
        north_m, east_m, height_m = (own[name] for name in names)
        heading_rad = np.where(leads, 0.0, heading_rad)
        position_m = np.stack((*offset_points(north_m, east_m, heading_rad, -forward_m, -right_m), height_m - up_m))
        member = (own["active"] > 0) & (own[AIRBORNE] > 0)
        each.append(np.where(member, position_m, np.nan))
    positions_m = np.stack(each)
    known = np.isfinite(positions_m).all(axis=1, keepdims=True)
    count = known.sum(axis=0)
    return np.where(count > 0, np.where(known, positions_m, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)


def _leader_heading(vehicles: Mapping[VehicleId, Columns], name: str) -> Array:
    common = next(iter(vehicles.values()))
    if VIRTUAL_LEADER[0] in common:
        return common[VIRTUAL_LEADER[3]]
    found = np.full(common["t_s"].size, np.nan)
    for own in vehicles.values():
        found = np.where(own["leads"] > 0, own[name], found)
    return found


def path_distances(
    scenario: Scenario, vehicles: Mapping[VehicleId, Columns], speeds_mps: Sequence[tuple[float, float]]
) -> dict[str, Distances]:
    """Return how far `leader` and `centre` are from the path at each tick of the scored flight, (T,).

    `speeds_mps`: times on the run's clock at which another speed was ordered, and this speed.
    """
    common = next(iter(vehicles.values()))
    mission_s = np.where(flying(common), common["mission_time_s"], np.nan)
    begun_s = began_s(common)
    # One ordered before the path begins is that of its start.
    speeds = [(max(at_s - begun_s, 0.0), speed_mps) for at_s, speed_mps in speeds_mps]
    names = (TRUTH if TRUTH[0] in common else POSITION)[:3]
    positions_m = {"leader": leader_position_m(vehicles, names), "centre": centre(scenario, vehicles)}
    return {who: distances(scenario, mission_s, position_m, speeds) for who, position_m in positions_m.items()}


def off_path(scenario: Scenario, track: Track) -> Iterator[OffPath]:
    """Yield when the leader was farther than `safety.path_distance_m` from its path for longer than `OFF_PATH_S`.

    The distance is that from the nearest point, across and in height. A vehicle that begins to lead, or is commanded
    again, may be as much farther away as it is then, until it is within the bound. While `path.steps` are added to its
    setpoints, it is off the path as planned.
    """
    found = distances(scenario, track.mission_s, track.position_m)
    away_m = np.hypot(found.across_m, found.height_m)
    for step in scenario.path.steps:
        away_m[(track.mission_s >= step.at_s) & (track.mission_s <= step.at_s + step.for_s)] = np.nan
    for rows in _stints(track, np.flatnonzero(np.isfinite(away_m))):
        yield from _off(scenario.safety.path_distance_m, track, away_m[rows], rows)


def _stints(track: Track, rows: Indices) -> Iterator[Indices]:
    """Yield the rows of each time in which one vehicle leads; a new one begins once it isn't known where, or who."""
    since_s = np.diff(track.mission_s[rows])
    unknown = ((np.diff(rows) > 1) & (since_s > EVERY_S)) | (since_s > GAP_S)
    yield from (part for part in np.split(rows, np.flatnonzero(unknown | (np.diff(track.leader[rows]) != 0)) + 1))


def _off(allowed_m: float, track: Track, away_m: Array, rows: Indices) -> Iterator[OffPath]:
    """Yield when one stint's distances (M,) were too large; `rows` (M,) are its indices in the track."""
    if not rows.size:
        return
    time_s = track.mission_s[rows]
    reached = np.maximum.accumulate(away_m <= allowed_m)
    out = np.concatenate(([False], away_m > np.where(reached, allowed_m, allowed_m + away_m[0]), [False]))
    begins, ends = np.flatnonzero(~out[:-1] & out[1:]), np.flatnonzero(out[:-1] & ~out[1:])
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        for_s = float(time_s[end - 1] - time_s[begin])
        if for_s >= OFF_PATH_S:
            farthest = begin + int(away_m[begin:end].argmax())
            leader = int(track.leader[rows[begin]])
            yield OffPath(leader, float(time_s[begin]), for_s, float(away_m[farthest]), float(time_s[farthest]))


def unknown() -> dict[str, Any]:
    """Return the figures of a flight without a tick."""
    nothing = {name: {"rms": None, "max": None} for name in FIGURES}
    return {"leader": nothing, "centre": nothing}
