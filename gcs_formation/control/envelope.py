"""The envelope of setpoints: they stay inside the autopilot's limits, and only finite ones are sent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flight_model.arrays import Array, within, wrap
from gcs_formation.estimation.flight_state import AutopilotModels, FlightStates, Setpoints

INTERCEPT_MAX_RAD = np.radians(60.0)
"""Most that a heading setpoint may deviate from the slot's own heading: a follower far to the side doesn't circle."""
AWAY_RAD = np.radians(120.0)
"""A follower whose heading differs from its slot's by more gets the slot's heading, so that it turns to one side.

Between `INTERCEPT_MAX_RAD` and this angle, the correction allowed shrinks to zero. With its back to the leader, a
follower would be told to turn left and right in alternation, and so fly straight on.
"""


class Envelope(NamedTuple):
    """The limits of setpoints, (F,) each.

    Speed stays within the autopilot's limits, and heading within `INTERCEPT_MAX_RAD` of the slot's own heading (less
    for a vehicle that flies elsewhere). Height stays so near the present height that the model needs no more than its
    climb limit to get there within its time constants.
    """

    speed_min_mps: Array
    speed_max_mps: Array
    own_heading_rad: Array
    aside_max_rad: Array
    height_min_m: Array
    height_max_m: Array

    @classmethod
    def of(cls, own_heading_rad: Array, state: FlightStates, model: AutopilotModels) -> Envelope:
        """Return the limits of vehicles in `state`, whose slots head along `own_heading_rad`."""
        off_rad = np.abs(wrap(state.heading_rad - own_heading_rad))
        most_rad = INTERCEPT_MAX_RAD * within((AWAY_RAD - off_rad) / (AWAY_RAD - INTERCEPT_MAX_RAD), 0.0, 1.0)
        reach_m, height_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s), state.height_m
        speeds_mps = model.speed_min_mps, model.speed_max_mps
        return cls(*speeds_mps, own_heading_rad, most_rad, height_m - reach_m, height_m + reach_m)

    def limit(self, wanted: Setpoints) -> Setpoints:
        """Return the setpoints that are sent.

        A heading stays on the side on which it is wanted: it is the slot's own heading plus a correction, which may
        exceed half a turn far from the slot.
        """
        aside_rad = wanted.heading_rad - self.own_heading_rad
        return Setpoints(
            within(wanted.speed_mps, self.speed_min_mps, self.speed_max_mps),
            self.own_heading_rad + within(aside_rad, -self.aside_max_rad, self.aside_max_rad),
            within(wanted.height_m, self.height_min_m, self.height_max_m),
        )


def limit(wanted: Setpoints, own_heading_rad: Array, state: FlightStates, model: AutopilotModels) -> Setpoints:
    """Return the setpoints that are sent, (F,) each: `wanted` within the envelope of vehicles in `state`."""
    return Envelope.of(own_heading_rad, state, model).limit(wanted)
