"""What vehicles may be told: setpoints are held inside the autopilot's limits, and nothing that isn't finite leaves."""

from __future__ import annotations

import numpy as np

from gcs_formation.arrays import Array, within, wrap
from gcs_formation.estimation.flight_state import AutopilotModel, FlightState, Setpoints

INTERCEPT_MAX_RAD = np.radians(60.0)
"""Most that a heading setpoint may deviate from the slot's own heading: a follower far to the side doesn't circle."""
AWAY_RAD = np.radians(120.0)
"""A follower that heads off its slot's heading by more is told that heading itself: it turns about, to one side.

From `INTERCEPT_MAX_RAD` on it may deviate by less and less. With its back to the leader, corrections would have it turn
now left, now right, and so fly on.
"""


def limit(wanted: Setpoints, own_heading_rad: Array, state: FlightState, model: AutopilotModel) -> Setpoints:
    """Return the setpoints that are sent, (F,) each.

    Speed within the limits; heading within `INTERCEPT_MAX_RAD` of `own_heading_rad`, less for a vehicle that flies
    elsewhere, on the side on which it's wanted: `wanted` is that plus a correction, which may be more than half a turn
    from far away. Height no farther from the
    present one than the model climbs through in its own time constants, so that the climb limit isn't asked to be
    broken.
    """
    aside = wanted.heading_rad - own_heading_rad
    off_rad = np.abs(wrap(state.heading_rad - own_heading_rad))
    most = INTERCEPT_MAX_RAD * within((AWAY_RAD - off_rad) / (AWAY_RAD - INTERCEPT_MAX_RAD), 0.0, 1.0)
    climb_reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
    return Setpoints(
        within(wanted.speed_mps, model.speed_min_mps, model.speed_max_mps),
        own_heading_rad + within(aside, -most, most),
        within(wanted.height_m, state.height_m - climb_reach_m, state.height_m + climb_reach_m),
    )
