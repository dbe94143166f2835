"""What a mission file says, whatever its format: items as MAVLink's mission protocol has them, home, fence, rally."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from formation_scenario.fields import FileError

MAX_ITEMS: Final = 20_000
"""Limit of a file's items: recorded tracks of hours have thousands."""
MAX_BYTES: Final = 32 * 2**20

LatLon: TypeAlias = tuple[float, float]
"""Latitude and longitude, degrees."""
RallyPoint: TypeAlias = tuple[float, float, float]
"""Latitude and longitude, degrees, and height above home, m."""
Datum = Literal["sea level", "home", "ground"]
"""From where a height is measured."""

DATUMS: Final[dict[int, Datum]] = {0: "sea level", 5: "sea level", 3: "home", 6: "home", 10: "ground", 11: "ground"}
"""MAV_FRAME_GLOBAL, _GLOBAL_RELATIVE_ALT and _GLOBAL_TERRAIN_ALT with their deprecated INT forms."""
FRAME_MISSION: Final = 2
"""MAV_FRAME_MISSION: of commands without a position."""


class MissionFileError(FileError):
    """A mission file that can't be read: the message says what was found, where, and what is expected."""


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item: a MAVLink command with its parameters 1 to 4, and its position if it has one.

    A parameter or coordinate that the file leaves open is NaN. `where` names the item as its file does ("item 3").
    """

    where: str
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    height_m: float

    @property
    def datum(self) -> Datum | None:
        """From where its height is measured; None if its frame has no position on the Earth."""
        return DATUMS.get(self.frame)

    @property
    def placed(self) -> bool:
        """Whether it has a position: 0, 0 means "where the vehicle is" to autopilots."""
        known = math.isfinite(self.lat_deg) and math.isfinite(self.lon_deg)
        return known and not (self.lat_deg == 0.0 and self.lon_deg == 0.0)


@dataclass(frozen=True, slots=True)
class FenceCircle:
    """A circle of a geofence."""

    centre: LatLon
    radius_m: float
    inclusion: bool


@dataclass(frozen=True, slots=True)
class FencePolygon:
    """A polygon of a geofence."""

    corners: tuple[LatLon, ...]
    inclusion: bool


@dataclass(frozen=True, slots=True)
class FileFence:
    """The geofence and the rally points of a file.

    With `any_inclusion` it is enough to be inside one of the areas to stay in (PX4); otherwise all bind (ArduPilot).
    """

    areas: tuple[FenceCircle | FencePolygon, ...] = ()
    rally: tuple[RallyPoint, ...] = ()
    any_inclusion: bool = False


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission file.

    `items` are in the order of the file, and `jump_targets[i]` is the number by which DO_JUMP names item i. `home` is
    latitude, longitude, degrees, and height above sea level, m (NaN where the file doesn't say). A `track` was
    recorded, so that its points aren't waypoints that somebody chose.
    """

    file: str
    items: tuple[MissionItem, ...]
    jump_targets: tuple[int, ...]
    home: tuple[float, float, float] | None = None
    fence: FileFence = FileFence()
    track: bool = False
    remarks: tuple[str, ...] = ()


def waypoint(where: str, lat_deg: float, lon_deg: float, height_m: float, datum: Datum = "sea level") -> MissionItem:
    """Return a point of a format that knows no commands, as NAV_WAYPOINT."""
    frame = next(number for number, each in DATUMS.items() if each == datum)
    return MissionItem(where, 16, frame, (math.nan,) * 4, lat_deg, lon_deg, height_m)


def degrees(text: object, where: str, what: Literal["latitude", "longitude"]) -> float:
    """Return a latitude or longitude, degrees.

    Raises:
        MissionFileError: no number, or one outside the range.
    """
    value, maximum = number(text, where, what), 90.0 if what == "latitude" else 180.0
    if not abs(value) <= maximum:
        raise MissionFileError(f"{where}: found {what} {value:g}; allowed: -{maximum:g} to {maximum:g} degrees")
    return value


def number(text: object, where: str, what: str) -> float:
    """Return a finite number.

    Raises:
        MissionFileError: something else.
    """
    value = math.nan
    if isinstance(text, int | float | str) and not isinstance(text, bool):
        try:
            value = float(text)
        except (ValueError, OverflowError):
            value = math.nan
    if not math.isfinite(value):
        raise MissionFileError(f"{where}: found {_shown(text)} as its {what}; allowed: a number")
    return value


def _shown(text: object) -> str:
    shown = "nothing" if text is None or text == "" else repr(text)
    return shown if len(shown) <= 40 else f"{shown[:37]}..."
