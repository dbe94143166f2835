"""A virtual leader: it flies the path by the autopilot model, and every vehicle follows it."""

from __future__ import annotations

import numpy as np

from airlink.clock import Instant, seconds_between
from gcs_formation.arrays import Array
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Setpoints
from gcs_formation.estimation.predictor import advance


def amid(followers: FlightState, slots_m: Array, speed_mps: float) -> FlightState:
    """Return the leader (1 column) relative to which the followers are, on average, in their slots (F, 3)."""
    heading = np.arctan2(np.sin(followers.heading_rad).mean(), np.cos(followers.heading_rad).mean())
    cos, sin = np.cos(heading), np.sin(heading)
    forward_m, right_m, up_m = slots_m.T
    places = (
        followers.north_m - (forward_m * cos - right_m * sin),
        followers.east_m - (forward_m * sin + right_m * cos),
        followers.height_m - up_m,
    )
    wind = (followers.wind_north_mps.mean(), followers.wind_east_mps.mean())
    means = (*(place.mean() for place in places), 0.0, speed_mps, heading, *wind)
    return FlightState(*(np.array([float(value)]) for value in means))


def fly_on(leader: FlightState, told: Setpoints, since: Instant, now: Instant, model: AutopilotModel) -> FlightState:
    """Return the leader's state at `now`, from the one at `since`, under setpoints `told` (1 column)."""
    return advance(leader, told.table[None], np.array([[seconds_between(since, now)]]), model)
