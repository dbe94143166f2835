"""Keys of what `check --repair` may change, and in which order."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from formation_scenario.fields import Allowed, Keys, Positive, key

Means: TypeAlias = Literal["points", "legs", "circles", "speed", "spacing", "shape", "frame", "start", "changes"]
ORDER: Final[tuple[Means, ...]] = (
    "points",
    "legs",
    "circles",
    "speed",
    "spacing",
    "shape",
    "frame",
    "start",
    "changes",
)
Order = Annotated[tuple[Means, ...], Field(min_length=1), Allowed(f"a list of {', '.join(ORDER)}")]


class RepairPlan(Keys):
    """What `check --repair` may change."""

    order: Order = key(
        ORDER,
        "what is changed, one means after another; what isn't listed stays. points: waypoints are moved, added or left "
        "out; legs: kind: legs; circles: climb: circle, and smaller or no path.circles; speed: speed_mps; spacing, "
        "shape and frame of the formation; start: its offset; changes: their times, and path.steps",
        ["speed", "points", "spacing"],
    )
    move_max_m: Positive = key(
        200.0, "farthest that a waypoint is moved before other means are tried; if they don't do, farther, m", 30
    )
