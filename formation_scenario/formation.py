"""Keys of the formation: shape, frame of the slots, changes in flight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Literal

from pydantic import Field

from formation_scenario import shapes
from formation_scenario.fields import (
    MAX_NEAR_M,
    OF_AN_EXTENSION,
    AtMost,
    Frame,
    Keys,
    Later,
    NonNegative,
    Number,
    Offset,
    Open,
    OwnKeys,
    Positive,
    VehicleRef,
    key,
)
from formation_scenario.register import marks_of

CUSTOM: Final = "custom"
"""The shape whose slots are keys."""
SHAPE_NAMES: Final = (*(mark.name for mark in marks_of(shapes)), CUSTOM)
"""The shapes of `formation_scenario.shapes`, and that of `slots_m`; others come from extensions."""
ShapeName = Annotated[str, Open(", ".join(SHAPE_NAMES), SHAPE_NAMES)]
Slots = Mapping[VehicleRef, Offset]
Spacing = Annotated[Positive, Field(le=MAX_NEAR_M)]
MAX_MPS, MAX_DEG, MAX_M = 5.0, 45.0, 50.0


class FormationChange(Keys):
    """Another shape, spacing or leader, from a time on."""

    at_s: NonNegative = key(..., "when the change begins, s", 60)
    shape: ShapeName | None = key(None, "the new shape", "square", derived="the one before")
    parameters: OwnKeys = key(
        None, f"beside shape: {OF_AN_EXTENSION}", {}, derived="those before, else the formation's, for that shape"
    )
    spacing_m: Spacing | None = key(
        None, "the new spacing, m", 50, derived="with a shape formation.spacing_m, else the one before"
    )
    slots_m: Slots | None = key(
        None, "custom: the new slots, m", {2: [-40, 0, 0], 3: [-80, 0, 0], 4: [-120, 0, 0]}, derived="formation.slots_m"
    )
    leader: VehicleRef | None = key(None, "the vehicle that leads from then on", 3, derived="the one before")


class Formation(Keys):
    """Where each follower is to be."""

    shape: ShapeName = key(
        "diamond", "the shape at the start: one of these, or one that an extension registers", "arrow"
    )
    parameters: OwnKeys = key(None, f"beside shape: {OF_AN_EXTENSION}", {})
    spacing_m: Spacing = key(30.0, "unit of the shape, m; no two slots are nearer", 40)
    frame: Frame = key(
        "leader_heading",
        "frame of the slots and of the errors: as the leader heads, as each follower heads, or fixed: forward is north "
        "and right is east",
    )
    slots_m: Slots | None = key(
        None,
        "custom: by follower's id, forward, right and up of the leader, m",
        {2: [-30, 30, 0], 3: [-30, -30, 0], 4: [-60, 0, 5]},
    )
    succession: Literal["nearest", "none"] = key(
        "nearest", "who leads when the leader is lost: of the followers near it the one with the best link, or none"
    )
    changes: AtMost[Later[FormationChange]] = key(
        (),
        "later shapes, spacings and leaders",
        [{"at_s": 60, "shape": "square", "spacing_m": 50}, {"at_s": 100, "leader": 3}],
    )

    @property
    def slots_turn(self) -> bool:
        """Whether slots swing when the leader turns."""
        return self.frame != "north"


class Step(Keys):
    """What is added to the leader's setpoints for a while; its followers follow what it flies."""

    at_s: NonNegative = key(..., "when it begins, s", 20)
    for_s: Positive = key(..., "how long it lasts, s", 10)
    ramp_s: NonNegative = key(0.0, "duration of the ramp at its beginning, and again at its end, s", 5)
    speed_mps: Annotated[Number, Field(ge=-MAX_MPS, le=MAX_MPS)] = key(0.0, "added airspeed, m/s", 2)
    heading_deg: Annotated[Number, Field(ge=-MAX_DEG, le=MAX_DEG)] = key(0.0, "added heading, degrees", 15)
    height_m: Annotated[Number, Field(ge=-MAX_M, le=MAX_M)] = key(0.0, "added height, m", 8)


def added(steps: Sequence[Step], mission_time_s: float) -> tuple[float, float, float]:
    """Return the sum of all steps of speed (m/s), heading (rad) and height (m) setpoints; 0 before the path."""
    speed_mps = heading_deg = height_m = 0.0
    for step in steps:
        share = _share(step, mission_time_s - step.at_s)
        speed_mps += share * step.speed_mps
        heading_deg += share * step.heading_deg
        height_m += share * step.height_m
    return speed_mps, math.radians(heading_deg), height_m


def _share(step: Step, since_s: float) -> float:
    """Return the share of a step that is present; 0 for NaN, a time before the path."""
    if not 0.0 <= since_s <= step.for_s:
        return 0.0
    if step.ramp_s == 0.0:
        return 1.0
    return min(1.0, since_s / step.ramp_s, (step.for_s - since_s) / step.ramp_s)
