"""The limits that every setpoint is held to: speed, heading and climb."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import mypyc_attr

from flight_model.autopilot import AutopilotModel, FlightState, within, wrap
from flight_model.slot import Triple

INTERCEPT_MAX_RAD: Final = math.radians(60.0)
"""Most that a heading setpoint may deviate from the slot's own heading: a follower far to the side doesn't circle."""
AWAY_RAD: Final = math.radians(120.0)
"""A follower whose heading differs from its slot's by more gets the slot's heading, so that it turns to one side.

Between `INTERCEPT_MAX_RAD` and this angle, the correction allowed shrinks to zero. With its back to the leader, a
follower would be commanded to turn left and right in alternation, and so fly straight on.
"""


@mypyc_attr(acyclic=True, free_list_len=1)
class Envelope:
    """The limits of a vehicle's setpoints.

    Speed stays within the autopilot's limits, and heading within `INTERCEPT_MAX_RAD` of the slot's own heading (less
    for a vehicle that flies elsewhere). Height stays so near the present height that the model needs no more than its
    climb limit to get there within its time constants.
    """

    __slots__ = ("aside_max_rad", "height_m", "model", "own_heading_rad", "reach_m")

    def __init__(self, own_heading_rad: float, state: FlightState, model: AutopilotModel) -> None:
        """Take the limits of a vehicle in `state`, whose slot heads along `own_heading_rad`."""
        off_rad = abs(wrap(state.heading_rad - own_heading_rad))
        self.aside_max_rad = INTERCEPT_MAX_RAD * within((AWAY_RAD - off_rad) / (AWAY_RAD - INTERCEPT_MAX_RAD), 0.0, 1.0)
        self.own_heading_rad = own_heading_rad
        self.height_m = state.height_m
        self.reach_m = model.climb_max_mps * (model.tau_ha_s + model.tau_hb_s)
        self.model = model

    def limit(self, speed_mps: float, heading_rad: float, height_m: float) -> Triple:
        """Return the setpoints that are sent.

        A heading stays on the side on which it is wanted: it is the slot's own heading plus a correction, which may
        exceed half a turn far from the slot.
        """
        aside_rad = within(heading_rad - self.own_heading_rad, -self.aside_max_rad, self.aside_max_rad)
        return (
            within(speed_mps, self.model.speed_min_mps, self.model.speed_max_mps),
            self.own_heading_rad + aside_rad,
            within(height_m, self.height_m - self.reach_m, self.height_m + self.reach_m),
        )
