"""How far a path is from the legs between its waypoints, and outside their heights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, Complex
from flight_model.legs.path import LegsPath
from flight_model.path import FlightPath

SAMPLE_M = 5.0
MIN_M = 1e-6
"""Length of a leg between both tangents of whole circles, which is none."""
AROUND = 2
"""Legs before and after the nearest waypoint's whose distance is measured."""


class Deviation(NamedTuple):
    """The greatest distance of a path from its legs over the ground, and outside its waypoints' heights, and where."""

    off_legs_m: float
    off_legs_at_m: float
    outside_heights_m: float
    outside_heights_at_m: float


def deviation(path: FlightPath, waypoints_m: Sequence[Sequence[float]] | Array) -> Deviation:
    """Return how far a path through waypoints (n, 3), north, east and height, is from the legs between them.

    Horizontally from the nearest of the legs around, which end on the circles that are asked for; along these the path
    is what was asked. Vertically outside the heights of the two waypoints between which it is. Both by samples
    `SAMPLE_M` apart.
    """
    waypoints = np.asarray(waypoints_m, dtype=np.float64)
    at_m = np.linspace(0.0, path.length_m, 2 + math.ceil(path.length_m / SAMPLE_M))
    points, last = path.at(at_m), len(waypoints) - 2
    leg = np.clip(np.searchsorted(path.waypoints_at_m, at_m, side="right") - 1, 0, last)
    off_m = _off_legs_m(path, waypoints, at_m, points.north_m + 1j * points.east_m)
    heights = waypoints[leg, 2], waypoints[leg + 1, 2]
    outside_m = np.maximum(points.height_m - np.maximum(*heights), np.minimum(*heights) - points.height_m)
    farthest, highest = int(off_m.argmax()), int(outside_m.argmax())
    return Deviation(
        float(off_m[farthest]), float(at_m[farthest]), max(float(outside_m[highest]), 0.0), float(at_m[highest])
    )


def _off_legs_m(path: FlightPath, waypoints: Array, at_m: Array, points: Complex) -> Array:
    """Return the distances (K,) of points along a path from the nearest of the legs around; on circles 0.

    Points are north + i east, m.
    """
    flat, nodes_at_m = waypoints[:, 0] + 1j * waypoints[:, 1], path.waypoints_at_m
    if isinstance(path, LegsPath):
        flat, nodes_at_m = path.nodes, path.nodes_at_m
    last, off_m = len(flat) - 2, np.full(at_m.size, np.inf)
    leg = np.clip(np.searchsorted(nodes_at_m, at_m, side="right") - 1, 0, last)
    for other in range(-AROUND, AROUND + 1):
        each = np.clip(leg + other, 0, last)
        begin, along = flat[each], flat[each + 1] - flat[each]
        squared = np.maximum(np.abs(along) ** 2, MIN_M**2)
        share = np.clip(((points - begin) * np.conj(along)).real / squared, 0.0, 1.0)
        off_m = np.minimum(off_m, np.abs(points - begin - share * along))
    for begin_m, end_m in path.circling_m if isinstance(path, LegsPath) else ():
        off_m[(at_m > begin_m) & (at_m < end_m)] = 0.0
    return off_m
