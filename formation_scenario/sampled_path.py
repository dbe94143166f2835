"""A path by samples: where something holds along it, as stretches, and what was found there, as violations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.path import FlightPath, PathPoints
from formation_scenario.source import KeyPath
from formation_scenario.violations import NOWHERE, Kind, Move, Violation

BETWEEN_SAMPLES_M = 5.0
TURN_SAMPLES = 19
"""Samples of a turn in place."""
SAME_POSITION_M = 250.0
"""Longest gap between two violations that count as one position, such as the two ends of a bend."""
WAYPOINTS: KeyPath = ("path", "waypoints_m")


def with_turns(path: FlightPath, at_m: Array) -> tuple[Array, PathPoints]:
    """Return rising distances along a path (K,) with those of its turns in place among them, and its points there.

    In a turn in place the point stays, and its course turns.
    """
    turned = [each for each in path.turns_in_place if at_m[0] <= each.at_m <= at_m[-1]]
    if not turned:
        return at_m, path.at(at_m)
    shares, others = np.linspace(0.0, 1.0, TURN_SAMPLES), path.at(at_m).course_rad
    at_m = np.concatenate([*(np.full(TURN_SAMPLES, each.at_m) for each in turned), at_m])
    points, order = path.at(at_m), np.argsort(at_m, kind="stable")
    courses = [*(each.from_rad + shares * each.by_rad for each in turned), others]
    points = points._replace(course_rad=np.concatenate(courses))
    return at_m[order], PathPoints(*(each[order] for each in points))


class SampledPath(NamedTuple):
    """Samples of a path: arc lengths (K,), points, and the index of the nearest waypoint to each."""

    at_m: Array
    points: PathPoints
    waypoints: Array

    @classmethod
    def along(cls, path: FlightPath, from_m: float = 0.0) -> SampledPath:
        """Sample a path from `from_m` to its end."""
        uniform = np.linspace(from_m, path.length_m, int((path.length_m - from_m) / BETWEEN_SAMPLES_M) + 2)
        distances_m = np.array(sorted({*uniform.tolist(), *path.nodes_m[path.nodes_m >= from_m].tolist()}))
        middles = (path.waypoints_at_m[1:] + path.waypoints_at_m[:-1]) / 2.0
        at_m, points = with_turns(path, distances_m)
        return cls(at_m, points, np.searchsorted(middles, at_m).astype(np.float64))

    def only(self, which: Mask) -> SampledPath:
        """Return the samples in a mask (K,)."""
        return SampledPath(self.at_m[which], self.points.only(which), self.waypoints[which])

    def stretches(self, over: Mask) -> Iterator[slice]:
        """Yield the stretches of the path where `over` (K,) holds, with gaps of up to `SAME_POSITION_M`."""
        indices = np.flatnonzero(over)
        breaks = np.flatnonzero(np.diff(self.at_m[indices]) > SAME_POSITION_M) + 1
        for run in np.split(indices, breaks) if indices.size else []:
            yield slice(int(run[0]), int(run[-1]) + 1)

    def violation(
        self,
        index: int,
        found: str,
        allowed: str,
        kind: Kind,
        excess: float = 1.0,
        moves: Mapping[int, Move] = NOWHERE,
    ) -> Violation:
        """Return what was found at a sample, with the nearest waypoint as its key."""
        at_m, waypoint = float(self.at_m[index]), int(self.waypoints[index])
        where = f"path at {at_m:.0f} m ({position_text(self.points, index)})"
        return Violation((*WAYPOINTS, waypoint), f"{where}: {found}", allowed, kind, excess, at_m, waypoint, moves)

    def raised(self, stretch: slice, lack_m: Array) -> dict[int, Move]:
        """Return by how much the nearest waypoints to a stretch lack height, by the lacks (K,) of all samples."""
        moves = dict[int, Move]()
        for waypoint, each_m in zip(self.waypoints[stretch].tolist(), lack_m[stretch].tolist(), strict=True):
            known = moves.get(int(waypoint), (0.0, 0.0, 0.0))
            if abs(each_m) > abs(known[2]):
                moves[int(waypoint)] = (0.0, 0.0, each_m)
        return moves


def position_text(points: PathPoints, index: int) -> str:
    """Return a point of the path in words, its height to a decimetre."""
    north_m, east_m, height_m = points.north_m[index], points.east_m[index], round(points.height_m[index], 1)
    return f"north {north_m:.0f}, east {east_m:.0f}, height {height_m:g}"
