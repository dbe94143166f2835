"""Points of formats that know no commands: KML, GPX, GeoJSON. One line of a file is flown, or else its points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from formation_scenario.mission_files.mission import (
    MAX_ITEMS,
    Datum,
    Mission,
    MissionFileError,
    MissionItem,
    degrees,
    number,
    waypoint,
)


class Point(NamedTuple):
    """A point as its file has it: text or numbers; `height` None where the file has none."""

    where: str
    lat: object
    lon: object
    height: object = None
    datum: Datum = "sea level"

    def item(self) -> MissionItem:
        """Return it as a waypoint.

        Raises:
            MissionFileError: a number is missing, or out of range.
        """
        height_m = math.nan if self.height is None else number(self.height, self.where, "height")
        lat, lon = degrees(self.lat, self.where, "latitude"), degrees(self.lon, self.where, "longitude")
        return waypoint(self.where, lat, lon, height_m, self.datum)


class Lines(NamedTuple):
    """The lines of a kind in a file, each by its points; a track was recorded."""

    kind: str
    lines: Sequence[Iterable[Point]]
    track: bool = False


def first_line(file: str, kinds: Iterable[Lines], allowed: str) -> Mission:
    """Return the first line of two points or more, of the first kind that has one; the others are named.

    Raises:
        MissionFileError: none, too many points, or one that can't be read.
    """
    for kind, lines, track in kinds:
        items = next((found for line in lines if len(found := _items(file, line)) > 1), None)
        if items is not None:
            others = len(lines) - 1
            remarks = (f"{file}: {others} other {kind}{'s' if others > 1 else ''} not flown",) if others else ()
            return Mission(file, items, tuple(range(1, 1 + len(items))), track=track, remarks=remarks)
    raise MissionFileError(f"{file}: nothing to fly; allowed: {allowed}, 2 or more points")


def _items(file: str, points: Iterable[Point]) -> tuple[MissionItem, ...]:
    items = list[MissionItem]()
    for point in points:
        if len(items) == MAX_ITEMS:
            raise MissionFileError(f"{file}: found more than {MAX_ITEMS} points; allowed: up to {MAX_ITEMS}")
        items.append(point.item())
    return tuple(items)
