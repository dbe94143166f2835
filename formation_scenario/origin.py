"""Where north, east and height begin."""

from __future__ import annotations

from math import radians
from typing import Annotated

from pydantic import Field

from flight_model.earth import GeodeticOrigin
from formation_scenario.fields import (
    Keys,
    Number,
    key,
)


class Origin(Keys):
    """The origin of north, east and height."""

    lat_deg: Annotated[Number, Field(ge=-85.0, le=85.0)] = key(35.0, "latitude, degrees", 47.4)
    lon_deg: Annotated[Number, Field(ge=-180.0, le=180.0)] = key(125.0, "longitude, degrees", 8.54)
    alt_m: Annotated[Number, Field(ge=-500.0, le=9000.0)] = key(0.0, "height above sea level, m", 488)

    @property
    def geodetic(self) -> GeodeticOrigin:
        """The origin in radians, which converts between geodetic positions and metres."""
        return GeodeticOrigin(radians(self.lat_deg), radians(self.lon_deg), self.alt_m)
