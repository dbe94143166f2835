"""Keys of the terrain: hills by formulas or an elevation file, and the clearance to keep."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from formation_scenario.fields import Keys, Name, NonNegative, Number, Positive, Text

HillShape = Literal["gaussian", "cosine"]


class Hill(Keys):
    """A hill, or a ridge: `height_m` times a shape of the distance d from its top, or from its crest line.

    gaussian: exp(-d²/(2 radius²)); cosine: cos²(π d/(2 radius)), and 0 from d = radius on. A hollow has a negative
    height.
    """

    name: Name = Field(default="hill", description="what messages call it", examples=["ridge"])
    shape: HillShape = Field(default="gaussian", description="form of its section")
    north_m: Number = Field(description="middle of the hill, north of the origin, m", examples=[1500])
    east_m: Number = Field(description="middle of the hill, east of the origin, m", examples=[-200])
    height_m: Number = Field(description="height of the top above the ground around, m; hills add up", examples=[80])
    radius_m: Positive = Field(
        description="one standard deviation (gaussian), or to the foot (cosine), m", examples=[400]
    )
    length_m: NonNegative = Field(default=0.0, description="length of a ridge's level crest line, m", examples=[600])
    bearing_deg: Number = Field(
        default=0.0, description="direction of the crest line from north, degrees", examples=[60]
    )


class Terrain(Keys):
    """The ground, and the clearance that the formation keeps from it."""

    file: Text | None = Field(
        default=None,
        description="elevations above sea level: a .hgt tile, or a GeoTIFF (with the extra `terrain`); a path from the "
        "scenario's file",
        examples=["N35E125.hgt"],
    )
    base_m: Number = Field(
        default=0.0, description="height of the ground around the hills, above the origin, m", examples=[20]
    )
    hills: tuple[Hill, ...] = Field(
        default=(),
        description="hills and ridges",
        examples=[[{"north_m": 1500, "east_m": 0, "height_m": 30, "radius_m": 600}]],
    )
    clearance_m: NonNegative = Field(
        default=50.0, description="height above ground that every vehicle keeps, m", examples=[60]
    )
