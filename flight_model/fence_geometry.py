"""The geometry of a fence: how far inside it places are, and how much room circles away from it leave."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array

REACT_S = 2.0
"""How long a vehicle flies straight on before a turn away from the fence shows."""
TURN_SHARE = 0.7
"""Share of the highest turn rate on which that turn counts."""
CHECKED_M = 25.0
"""Room that paths and slots must leave; a vehicle that has been turned away is free again with as much."""


def inside_m(corners_m: Array, place_m: Array) -> Array:
    """Return how far inside a polygon (K, 2) places (…, 2) are: the distance to its edge, m; negative outside.

    Inside is where a ray crosses the edge an odd number of times.
    """
    begin, end = corners_m, np.roll(corners_m, -1, axis=0)
    edge, reach = end - begin, place_m[..., None, :] - begin
    along = np.clip((reach * edge).sum(axis=-1) / np.maximum((edge * edge).sum(axis=-1), 1e-12), 0.0, 1.0)
    distance = np.linalg.norm(reach - along[..., None] * edge, axis=-1).min(axis=-1)
    north, east = place_m[..., 0, None], place_m[..., 1, None]
    spans = (begin[:, 1] > east) != (end[:, 1] > east)
    rise = np.where(edge[:, 1] == 0.0, np.inf, edge[:, 1])
    crossed = spans & (north < begin[:, 0] + (east - begin[:, 1]) / rise * edge[:, 0])
    sign: Array = np.where(crossed.sum(axis=-1) % 2 == 1, 1.0, -1.0)
    return sign * distance


def room_m(corners_m: Array, place_m: Array, velocity_mps: Array, through_air_mps: Array, turn_rps: Array) -> Array:
    """Return how much room circles to the left and to the right leave to the fence, (…, 2) m; negative: none.

    Args:
        corners_m: (K, 2) of the fence, north and east.
        place_m: (…, 2) of the vehicles.
        velocity_mps: (…, 2) over ground.
        through_air_mps: (…,) airspeed and wind together, which bound the circles.
        turn_rps: (…,) the highest turn rates.
    """
    radius_m = through_air_mps / (TURN_SHARE * turn_rps)
    speed = np.maximum(np.linalg.norm(velocity_mps, axis=-1), 1e-9)
    right = np.stack((-velocity_mps[..., 1], velocity_mps[..., 0]), axis=-1) / speed[..., None]
    ahead = place_m + REACT_S * velocity_mps
    centres = np.stack([ahead + side * radius_m[..., None] * right for side in (-1.0, 1.0)], axis=-2)
    return inside_m(corners_m, centres) - radius_m[..., None]
