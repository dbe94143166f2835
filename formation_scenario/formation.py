"""Keys of the formation: its shape, the frame of its slots, and its changes in flight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import MAX_NEAR_M, Keys, NonNegative, Offset, Positive, VehicleRef, derived

Shape = Literal["follower", "diamond", "triangle", "square", "plus", "arrow", "line", "echelon", "circle", "custom"]
Frame = Literal["leader_heading", "follower_heading"]
Slots = Mapping[VehicleRef, Offset]
Spacing = Annotated[Positive, Field(le=MAX_NEAR_M)]


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
