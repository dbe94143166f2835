"""Keys of the leader's path."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from formation_scenario.fields import Allowed, AtMost, Keys, NonNegative, Number, Positive, Speed, Text, Vector, key
from formation_scenario.formation import Step

TOLERANCE_M = 10.0
"""Distance within which a recorded track is followed unless the scenario says otherwise: GNSS scatters by metres."""
MOST_WAYPOINTS: Final = 5000
Waypoints = Annotated[
    tuple[Vector, ...],
    Field(min_length=2, max_length=MOST_WAYPOINTS),
    Allowed(f"a list of 2 to {MOST_WAYPOINTS} [north, east, height]"),
]


class PathPlan(Keys):
    """The leader's path."""

    speed_mps: Speed = key(22.0, "the leader's speed, m/s", 20)
    waypoints_m: Waypoints = key(
        ...,
        "north, east and height above the origin, m; `kind` says what leads through them",
        [[0, 0, 100], [1500, 0, 100], [3000, 700, 120]],
        derived="from `file` or `waypoints_deg`",
    )
    waypoints_deg: Waypoints | None = key(
        None,
        "instead of waypoints_m: latitude, longitude, degrees, and height above the origin, m; the first is the origin "
        "unless there is one; `kind` is legs then",
        [[47.40, 8.54, 100], [47.41, 8.54, 100]],
    )
    file: Text | None = key(
        None,
        "instead of waypoints_m: a mission file (.plan, .waypoints, .kml, .gpx, .geojson, .csv), relative to the "
        "scenario's; its home is the origin and its fence `safety.fence` unless there are others; `kind` is legs then",
        "mission.plan",
    )
    height_m: Number | None = key(None, "file: height of points for which it has none, above the origin, m", 120)
    tolerance_m: NonNegative | None = key(
        None,
        "file: points that the line through the others passes as near as this are left out, m",
        25,
        derived=f"{TOLERANCE_M:g} for a recorded track, else 0",
    )
    read_from: Text | None = key(None, "written when a file was read: its name", "mission.plan")
    not_flown: tuple[Text, ...] = key(
        (), "written when a file was read: what of it isn't flown", ["item 3: DO_SET_SERVO"]
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
    steps: AtMost[Step] = key(
        (), "what is added to the leader's setpoints for a while; `gcs-formation identify` flies them"
    )
