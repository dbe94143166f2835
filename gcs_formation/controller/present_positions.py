"""Where vehicles are now, from their filters' newest states."""

from __future__ import annotations

import math

import numpy as np

from airlink.clock import NANOSECONDS, Instant
from flight_model.arrays import Array
from flight_model.slot import UNKNOWN
from formation_scenario.fields import Frame
from formation_scenario.slot_frame import axis_rad
from gcs_formation.estimation.vehicle_filter import VehicleFilter
from gcs_formation.recorder import unknown_state


def positions_from_leader(filters: list[VehicleFilter], leader: int, frame: Frame, now: Instant) -> Array:
    """Return all positions, (C, 3) forward, right and up of the leader."""
    positions = np.array([_position_at(each, now) for each in filters])
    north, east, up = (positions - positions[leader]).T
    heading_rad = (filters[leader].state or unknown_state()).heading_rad
    axis = axis_rad(frame, heading_rad, heading_rad)
    cos, sin = math.cos(axis), math.sin(axis)
    return np.stack((north * cos + east * sin, east * cos - north * sin, up), axis=1)


def _position_at(known: VehicleFilter, now: Instant) -> tuple[float, float, float]:
    """Return where a vehicle is now if it flies straight on, north, east and up; NaN if it was never received from."""
    if known.state is None:
        return UNKNOWN
    state, seconds = known.state, (now - known.stamp) / NANOSECONDS
    north_mps, east_mps = state.ground_mps()
    return (
        state.north_m + seconds * north_mps,
        state.east_m + seconds * east_mps,
        state.height_m + seconds * state.climb_mps,
    )
