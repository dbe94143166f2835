"""Keys of the landing in an emulated vehicle's stored mission."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from formation_scenario.fields import Keys, Number, Positive, key

Course = Annotated[Number, Field(ge=0.0, lt=360.0)]
Position = tuple[Number, Number]


class StoredLanding(Keys):
    """A fixed wing's landing: DO_LAND_START, a waypoint where its approach begins, and NAV_LAND."""

    course_deg: Course | None = key(
        None, "course of its approach, degrees", 90, derived="its heading on the ground at the start"
    )
    touchdown_m: Position | None = key(
        None, "where it lands, north and east of the origin, m", [0, 50], derived="where it stands at the start"
    )
    approach_m: Annotated[Positive, Field(ge=100.0, le=5000.0)] = key(400.0, "length of its approach, m", 600)
    height_m: Annotated[Positive, Field(ge=10.0, le=500.0)] = key(
        50.0, "height above home at which its approach begins, m", 60
    )
