"""Keys of the formation: its shape, the frame of its slots, and its changes in flight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import MAX_NEAR_M, Keys, NonNegative, Offset, Positive, VehicleRef

Shape = Literal["follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle", "custom"]
Frame = Literal["leader_heading", "follower_heading"]
Slots = Mapping[VehicleRef, Offset]
Spacing = Annotated[Positive, Field(le=MAX_NEAR_M)]


class FormationChange(Keys):
    """Another shape, spacing or leader, from a time on."""

    at_s: NonNegative = Field(description="when the change begins, s")
    shape: Shape | None = Field(default=None, description="the new shape; default: the one before")
    spacing_m: Spacing | None = Field(
        default=None,
        description="the new spacing, m; default: with a shape formation.spacing_m, else the one before",
    )
    slots_m: Slots | None = Field(default=None, description="custom: the new slots; default: formation.slots_m")
    leader: VehicleRef | None = Field(default=None, description="the vehicle that leads from then on")


class Formation(Keys):
    """Where each follower is to be."""

    shape: Shape = Field(default="diamond", description="the shape at the start")
    spacing_m: Spacing = Field(default=30.0, description="unit of the shape, m; no two slots are nearer")
    frame: Frame = Field(default="leader_heading", description="frame of the slots and of the errors")
    slots_m: Slots | None = Field(default=None, description="custom: by follower, m forward, right and up of leader")
    succession: Literal["nearest", "none"] = Field(
        default="nearest", description="who leads when the leader is lost: the follower nearest to it, or nobody"
    )
    changes: tuple[FormationChange, ...] = Field(default=(), description="later shapes, spacings and leaders")
