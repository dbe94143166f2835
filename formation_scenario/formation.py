"""Keys of the formation: shape, frame of the slots, changes in flight; steps for identification."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import (
    MAX_NEAR_M,
    Keys,
    NonNegative,
    Number,
    Offset,
    Positive,
    VehicleRef,
    derived,
)

Shape = Literal["follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle", "custom"]
Frame = Literal["leader_heading", "follower_heading"]
Slots = Mapping[VehicleRef, Offset]
Spacing = Annotated[Positive, Field(le=MAX_NEAR_M)]
MOST_MPS, MOST_DEG, MOST_M = 5.0, 45.0, 50.0


class FormationChange(Keys):
    """Another shape, spacing or leader, from a time on."""

    at_s: NonNegative = Field(description="when the change begins, s", examples=[60])
    shape: Shape | None = Field(
        default=None, description="the new shape", json_schema_extra=derived("the one before"), examples=["square"]
    )
    spacing_m: Spacing | None = Field(
        default=None,
        description="the new spacing, m",
        json_schema_extra=derived("with a shape formation.spacing_m, else the one before"),
        examples=[50],
    )
    slots_m: Slots | None = Field(
        default=None,
        description="custom: the new slots, m",
        json_schema_extra=derived("formation.slots_m"),
        examples=[{2: [-40, 0, 0], 3: [-80, 0, 0], 4: [-120, 0, 0]}],
    )
    leader: VehicleRef | None = Field(
        default=None,
        description="the vehicle that leads from then on",
        json_schema_extra=derived("the one before"),
        examples=[3],
    )


class Formation(Keys):
    """Where each follower is to be."""

    shape: Shape = Field(default="diamond", description="the shape at the start", examples=["arrow"])
    spacing_m: Spacing = Field(default=30.0, description="unit of the shape, m; no two slots are nearer", examples=[40])
    frame: Frame = Field(default="leader_heading", description="frame of the slots and of the errors")
    slots_m: Slots | None = Field(
        default=None,
        description="custom: by follower's id, forward, right and up of the leader, m",
        examples=[{2: [-30, 30, 0], 3: [-30, -30, 0], 4: [-60, 0, 5]}],
    )
    succession: Literal["nearest", "none"] = Field(
        default="nearest",
        description="who leads when the leader is lost: of the followers near it the one with the best link, or nobody",
    )
    changes: tuple[FormationChange, ...] = Field(
        default=(),
        description="later shapes, spacings and leaders",
        examples=[[{"at_s": 60, "shape": "square", "spacing_m": 50}, {"at_s": 100, "leader": 3}]],
    )


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
