"""Keys of the leader's path."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import Field

from formation_scenario.fields import (
    MAX_NEAR_M,
    OF_AN_EXTENSION,
    WHOLE,
    Allowed,
    AtMost,
    Keys,
    Later,
    NonNegative,
    Number,
    Open,
    OwnKeys,
    Positive,
    Speed,
    Text,
    Vector,
    key,
)
from formation_scenario.formation import Step

TOLERANCE_M = 10.0
"""Distance within which a recorded track is followed unless the scenario says otherwise: GNSS has errors of metres."""
MAX_WAYPOINTS: Final = 5000
Speeds: TypeAlias = Annotated[
    Speed | Annotated[tuple[Speed, ...], Field(min_length=1)],
    Allowed("a number from 0.001 to 1000, or a list of them, one a leg"),
]
Waypoints = Annotated[
    tuple[Vector, ...],
    Field(min_length=2, max_length=MAX_WAYPOINTS),
    Allowed(f"a list of 2 to {MAX_WAYPOINTS} [north, east, height]"),
]


class CirclesPlan(Keys):
    """Circles at a waypoint."""

    waypoint: Annotated[int, Field(strict=True, ge=1), WHOLE] = key(..., "index of the waypoint, the first one is 0", 3)
    turns: Annotated[int, Field(strict=True, ge=0, le=1000), WHOLE] = key(
        1, "number of whole circles, at the waypoint's height; 0: as many as the climb or descent to it takes", 2
    )
    radius_m: Annotated[Number, Field(ge=-MAX_NEAR_M, le=MAX_NEAR_M)] = key(
        0.0,
        "positive: clockwise, negative: anticlockwise, widened to what every slot can fly; 0: the tightest, to the "
        "side of the next leg, m",
        -90,
    )


class PlannedStop(Keys):
    """A stop of vehicles that hover at a waypoint."""

    waypoint: Annotated[int, Field(strict=True, ge=1), WHOLE] = key(..., "index of the waypoint, the first one is 0", 3)
    hold_s: NonNegative = key(0.0, "how long the formation hovers there before it turns to the next leg, s", 10)


GUIDANCES: Final = ("track",)
"""Our own guidance of the leader along its path."""


class OwnGuidance(Keys):
    """What guides the leader along its route."""

    type: Annotated[str, Open(", ".join(GUIDANCES), GUIDANCES)] = key(
        GUIDANCES[0], "track: our own; or one that an extension registers", "pure_pursuit"
    )
    parameters: OwnKeys = key(None, OF_AN_EXTENSION, {})


class PathPlan(Keys):
    """The leader's path."""

    speed_mps: Speeds = key(
        22.0,
        "the leader's airspeed, m/s; with `kind: legs` also a list, one a leg: it changes where a leg begins, after "
        "the turn onto it",
        20,
        [20, 25],
    )
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
    turn: Literal["fly_by", "fly_over", "stop"] = key(
        "fly_by",
        "legs: fly_by turns inside a waypoint, fly_over passes it and then turns; where a turn doesn't fit, one that "
        "overshoots a leg and comes back, or a detour from the end of one leg to the begin of the next; of vehicles "
        "that hover fly_by slows down for corners and stops where they are too sharp, stop does so at every waypoint",
        "fly_over",
    )
    turn_distance_max_m: Positive = key(
        100.0,
        "legs: farthest that a turn passes from its waypoint; sharper corners are turned by overshooting a leg, m",
        60,
    )
    detour: Literal["shortest", "nearest"] = key(
        "shortest",
        "legs: which of the detours that have room is flown, as between lanes that are nearer than two radii: the "
        "shortest, or the one that stays nearest to the legs",
        "nearest",
    )
    climb: Literal["refuse", "circle"] = key(
        "refuse",
        "legs: what becomes of a leg that is too steep: it is refused, or ends in circles; vehicles that hover fly it "
        "more slowly instead",
        "circle",
    )
    circles: AtMost[Later[CirclesPlan]] = key(
        (), "legs: circles around waypoints; they touch one that is nearer to another than to them"
    )
    stops: AtMost[Later[PlannedStop]] = key(
        (), "legs: waypoints at which vehicles that hover stop, hover for a time and turn to the next leg"
    )
    guidance: Later[OwnGuidance] | None = key(None, "by what the leader is guided along its route")
    steps: AtMost[Step] = key(
        (), "what is added to the leader's setpoints for a while; `gcs-formation identify` flies them"
    )

    @property
    def legs_mps(self) -> tuple[float, ...]:
        """The airspeed of each leg, m/s; the last one's of a list that is too short, which is refused."""
        given, legs = (
            self.speed_mps if isinstance(self.speed_mps, tuple) else (self.speed_mps,),
            len(self.waypoints_m) - 1,
        )
        return (*given, *(given[-1] for _ in range(legs)))[:legs]

    @property
    def begin_mps(self) -> float:
        """The airspeed at which the path is begun, m/s."""
        return self.speed_mps[0] if isinstance(self.speed_mps, tuple) else self.speed_mps

    @property
    def fastest_mps(self) -> float:
        """The highest airspeed of all legs, m/s."""
        return max(self.speed_mps) if isinstance(self.speed_mps, tuple) else self.speed_mps
