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

    name: Name = Field(default="hill", description="what messages call it")
    shape: HillShape = Field(default="gaussian", description="gaussian | cosine")
    north_m: Number = Field(description="middle of the hill, m north of the origin")
    east_m: Number = Field(description="the same, m east")
    height_m: Number = Field(description="of the top above the ground around, m; hills add up")
    radius_m: Positive = Field(description="one standard deviation (gaussian), or to the foot (cosine), m")
    length_m: NonNegative = Field(default=0.0, description="length of a ridge's level crest line, m")
    bearing_deg: Number = Field(default=0.0, description="direction of the crest line, degrees from north")


class Terrain(Keys):
    """The ground, and the clearance that the formation keeps from it."""

    file: Text | None = Field(
        default=None, description="elevations above sea level: a .hgt tile, or a GeoTIFF (with the extra `terrain`)"
    )
    base_m: Number = Field(default=0.0, description="height of the ground around the hills, above the origin, m")
    hills: tuple[Hill, ...] = Field(default=(), description="hills and ridges")
    clearance_m: NonNegative = Field(default=50.0, description="height above ground that every vehicle keeps, m")
