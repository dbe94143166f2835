"""Keys of the fence."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from pydantic import Field

from flight_model.fence_geometry import Circle, FenceArea, FenceAreas, Polygon
from formation_scenario.brought_keys import BroughtKeys
from formation_scenario.fields import Allowed, Keys, Later, Number, Positive, Vector, key
from formation_scenario.geofence import OUTER, Geofence

Corner: TypeAlias = Annotated[tuple[Number, Number], Allowed("a list of 2 numbers: north, east")]
Corners = Annotated[
    tuple[Corner, ...], Field(min_length=3, max_length=200), Allowed("a list of 3 to 200 corners [north, east]")
]


class Area(Keys):
    """An area of the fence: a polygon or a circle."""

    kind: Literal["inclusion", "exclusion"] = key(..., "stay inside it, or outside", "exclusion")
    corners_m: Corners | None = key(
        None,
        "of a polygon: its corners, one after another: north and east of the origin, m",
        [[500, -800], [900, -800], [700, -300]],
    )
    centre_m: Corner | None = key(None, "of a circle: its centre, north and east of the origin, m", [1800, 900])
    radius_m: Positive | None = key(None, "of a circle: its radius, m", 150)

    @property
    def shape(self) -> Polygon | Circle:
        """Its shape; of an area that says too little, or both, that of its corners."""
        if self.corners_m is not None:
            return Polygon(np.array(self.corners_m))
        return Circle(np.array(self.centre_m or (0.0, 0.0)), self.radius_m or 0.0)


Areas = Annotated[tuple[Area, ...], Field(max_length=100)]
Rally = Annotated[tuple[Vector, ...], Field(max_length=100), Allowed("a list of up to 100 [north, east, height]")]


class Fence(Keys, Geofence):
    """Where vehicles must stay; every limit is optional."""

    corners_m: Corners | None = key(
        None,
        "corners of a polygon to stay in, one after another: north and east of the origin, m",
        [[-1000, -800], [4000, -800], [4000, 2000], [-1000, 2000]],
    )
    areas: Areas = key((), "further polygons and circles, to stay in or out of")
    inclusions: Literal["all", "any"] = key(
        "all",
        "of several inclusions, corners_m among them: stay inside all, as ArduPilot has it, or inside any, as PX4 does",
        "any",
    )
    height_min_m: Number | None = key(None, "lowest height above the origin, m", 40)
    height_max_m: Number | None = key(None, "highest height above the origin, m", 120)
    rally_m: Rally = key(
        (),
        "rally points: north, east and height above the origin, m: written by `check --export` into a plan, as where "
        "autopilots return to; nothing here flies to them",
        [[-300, 200, 60]],
    )

    @cached_property
    def sides(self) -> FenceAreas | None:
        """Its polygons and circles; None without any."""
        found = list[FenceArea]()
        if self.corners_m is not None:
            found.append(FenceArea(Polygon(np.array(self.corners_m)), inclusion=True, key=OUTER))
        for index, each in enumerate(self.areas):
            found.append(FenceArea(each.shape, each.kind == "inclusion", f"safety.fence.areas.{index}"))
        return FenceAreas(tuple(found), self.inclusions == "any") if found else None

    @property
    def heights_m(self) -> tuple[float, float]:
        """The lowest and the highest height; infinite without a limit."""
        lowest = -np.inf if self.height_min_m is None else self.height_min_m
        return lowest, np.inf if self.height_max_m is None else self.height_max_m

    @property
    def rally_positions_m(self) -> tuple[tuple[float, float, float], ...]:
        """Rally points: north, east and height above the origin, m."""
        return self.rally_m


class AirspaceKeys(BroughtKeys, group="safety", after=("clearance_m",)):
    """Where vehicles are kept."""

    fence: Later[Fence] | None = key(
        None, "where vehicles must stay, and so paths, slots and setpoints; without it, anywhere"
    )


KEYS: Final = (AirspaceKeys,)
