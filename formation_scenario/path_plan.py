"""Keys of the leader's path."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from formation_scenario.fields import Allowed, Keys, Positive, Speed, Vector, key
from formation_scenario.formation import Step

Waypoints = Annotated[tuple[Vector, ...], Field(min_length=2), Allowed("a list of 2 or more [north, east, height]")]


class PathPlan(Keys):
    """The leader's path."""

    speed_mps: Speed = key(22.0, "the leader's speed, m/s", 20)
    waypoints_m: Waypoints = key(
        ...,
        "north, east and height above the origin, m; `kind` says what leads through them",
        [[0, 0, 100], [1500, 0, 100], [3000, 700, 120]],
    )
    kind: Literal["spline", "legs"] = key(
        "spline",
        "spline: one smooth curve through all waypoints; legs: straight lines between them, joined by turns that every "
        "slot can fly",
        "legs",
    )
    turn: Literal["fly_by", "fly_over"] = key(
        "fly_by",
        "legs: fly_by turns inside a waypoint, fly_over passes it and then turns; where a turn doesn't fit, a detour "
        "outside leads from the end of one leg to the begin of the next",
        "fly_over",
    )
    turn_distance_max_m: Positive = key(
        100.0, "legs: farthest that a fly-by turn passes from its waypoint; beyond, a detour leads over it, m", 60
    )
    climb: Literal["refuse", "circle"] = key(
        "refuse", "legs: what becomes of a leg that is too steep: it is refused, or ends in circles", "circle"
    )
    steps: tuple[Step, ...] = key(
        (), "what is added to the leader's setpoints for a while; `gcs-formation identify` flies them"
    )
