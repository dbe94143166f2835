"""Steps, ramps and doublets of the leader's setpoints, from which its autopilot's model can be identified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from formation_scenario.fields import Keys, NonNegative, Number, Positive

MOST_MPS, MOST_DEG, MOST_M = 5.0, 45.0, 50.0


class Step(Keys):
    """What is added to the leader's setpoints for a while; its followers follow what it flies."""

    at_s: NonNegative = Field(description="when it begins, s", examples=[20])
    for_s: Positive = Field(description="how long it lasts, s", examples=[10])
    ramp_s: NonNegative = Field(default=0.0, description="how long it takes to come, and to go again, s", examples=[5])
    speed_mps: Annotated[Number, Field(ge=-MOST_MPS, le=MOST_MPS)] = Field(
        default=0.0, description="added airspeed, m/s", examples=[2]
    )
    heading_deg: Annotated[Number, Field(ge=-MOST_DEG, le=MOST_DEG)] = Field(
        default=0.0, description="added heading, degrees", examples=[15]
    )
    height_m: Annotated[Number, Field(ge=-MOST_M, le=MOST_M)] = Field(
        default=0.0, description="added height, m", examples=[8]
    )


def added(steps: Sequence[Step], mission_time_s: float) -> tuple[float, float, float]:
    """Return what all steps add to setpoints of speed (m/s), heading (rad) and height (m); nothing before the path."""
    speed_mps = heading_deg = height_m = 0.0
    for step in steps:
        share = _share(step, mission_time_s - step.at_s)
        speed_mps += share * step.speed_mps
        heading_deg += share * step.heading_deg
        height_m += share * step.height_m
    return speed_mps, math.radians(heading_deg), height_m


def _share(step: Step, since_s: float) -> float:
    """Return how much of a step is there; 0 for NaN, a time before the path."""
    if not 0.0 <= since_s <= step.for_s:
        return 0.0
    if step.ramp_s == 0.0:
        return 1.0
    return min(1.0, since_s / step.ramp_s, (step.for_s - since_s) / step.ramp_s)
