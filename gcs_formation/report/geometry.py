"""Where vehicles, slots and the path are, and downsampling that keeps what a plot shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_model.arrays import Array
from gcs_formation.report.run_data import RunData

Indices = npt.NDArray[np.int64]
PATH_POINTS = 2000
BEFORE_CHANGE_S = 1.0
SNAPSHOTS = 4


def extremes(values: Array, buckets: int) -> Indices:
    """Return rising indices into (T,) values that keep every extreme a plot could show.

    The series is cut into at most `buckets` pieces; of each the smallest, the largest and, where there is one, an
    unknown (NaN) value are kept, so that a line through them spans the same range and breaks in the same places.
    First and last are kept too. A series of no more than 2 * `buckets` values is kept whole.
    """
    size = values.size
    if size <= 2 * buckets:
        return np.arange(size)
    width = -(-size // buckets)
    padded = np.full(width * -(-size // width), values[-1])
    padded[:size] = values
    pieces = padded.reshape(-1, width)
    unknown = np.isnan(pieces)
    begin = np.arange(pieces.shape[0]) * width
    kept = [
        begin + np.where(unknown, np.inf, pieces).argmin(axis=1),
        begin + np.where(unknown, -np.inf, pieces).argmax(axis=1),
        (begin + unknown.argmax(axis=1))[unknown.any(axis=1)],
        np.array([0, size - 1]),
    ]
    return np.unique(np.minimum(np.concatenate(kept), size - 1))


def reach(places: Array) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates (D,) of those of (N, D) places that are known, 0 of none."""
    known = places[np.isfinite(places).all(axis=1)]
    known = known if known.size else np.zeros_like(places[:1])
    return known.min(axis=0), known.max(axis=0)


def evenly(size: int, count: int) -> Indices:
    """Return at most `count` rising indices spread over a series of `size`, first and last included."""
    if size <= count:
        return np.arange(size)
    return np.unique(np.round(np.linspace(0, size - 1, count)).astype(np.int64))


class Snapshot(NamedTuple):
    """The formation at one tick: (N, 2) metres right and forward of the leader, or of the middle without one."""

    tick: int
    reference: Array
    """North and east of the leader, or the middle, m."""
    places_m: Array
    slots_m: Array
    """Of the followers, (F, 2)."""
    headings_rad: Array
    """(N,) clockwise from up."""
    up_rad: float
    """What is up: the leader's heading, or the mean of all."""


def path_m(run: RunData) -> Array:
    """Return the scenario's path, (P, 3) north, east, height."""
    path = run.scenario.leader_path
    points = path.at(np.linspace(0.0, path.length_m, PATH_POINTS))
    return np.column_stack((points.north_m, points.east_m, points.height_m))


def snapshot_ticks(run: RunData) -> list[int]:
    """Return flown ticks worth a closer look: start, end, just before changes of shape, in between."""
    time_s = run.time_s
    begin, end = float(time_s[0]), float(time_s[-1])
    changes = [c.at_s - BEFORE_CHANGE_S for c in run.scenario.formation.changes if begin < c.at_s < end]
    wanted = sorted([begin, *changes[: SNAPSHOTS - 2], end])
    while len(wanted) < SNAPSHOTS:
        gap = int(np.argmax(np.diff(wanted)))
        wanted.insert(gap + 1, (wanted[gap] + wanted[gap + 1]) / 2)
    return sorted({min(int(np.searchsorted(time_s, at)), time_s.size - 1) for at in wanted})


def snapshot(run: RunData, tick: int) -> Snapshot:
    """Return the formation at a flown tick."""
    flight, vehicles = run.flown, list(run.flown.vehicles)
    places = np.array([flight.place_in_flight(vehicle)[tick, :2] for vehicle in vehicles])
    headings = np.array([flight.heading(vehicle)[tick] for vehicle in vehicles])
    leader = flight.leader_at(tick)
    lead = vehicles.index(leader) if leader is not None and flight.airborne(leader)[tick] else None
    reference = places[lead] if lead is not None else _mean(places)
    up_rad = float(headings[lead]) if lead is not None else _mean_angle(headings)
    in_leaders_frame = lead is not None and run.scenario.formation.frame == "leader_heading"
    following = [i for i in range(len(vehicles)) if i != lead]
    frames_rad = [up_rad if in_leaders_frame else headings[i] for i in following]
    errors = [flight.error(vehicles[i])[tick, :2] for i in following]
    ways = [_north_east(psi, error) for psi, error in zip(frames_rad, errors, strict=True)]
    slots = places[following] + np.reshape(ways, (-1, 2))
    return Snapshot(
        tick=tick,
        reference=reference,
        places_m=_right_forward(places - reference, up_rad),
        slots_m=_right_forward(slots - reference, up_rad),
        headings_rad=headings - up_rad,
        up_rad=up_rad,
    )


def _north_east(psi_rad: float, forward_right_m: Array) -> Array:
    """Return metres forward and right of a heading as north and east."""
    cos, sin = np.cos(psi_rad), np.sin(psi_rad)
    forward, right = forward_right_m
    return np.array([cos * forward - sin * right, sin * forward + cos * right])


def _right_forward(north_east_m: Array, up_rad: float) -> Array:
    cos, sin = np.cos(up_rad), np.sin(up_rad)
    north, east = north_east_m.T
    return np.column_stack((east * cos - north * sin, north * cos + east * sin))


def _mean_angle(angles_rad: Array) -> float:
    east, north = _mean(np.column_stack((np.sin(angles_rad), np.cos(angles_rad))))
    return float(np.arctan2(east, north))


def _mean(rows: Array) -> Array:
    known = rows[np.isfinite(rows).all(axis=1)]
    return np.mean(known if known.size else np.zeros_like(rows[:1]), axis=0)
