"""Tables (.csv) with a header: latitude and longitude, and a height whose column says from where it's measured."""

from __future__ import annotations

import csv
import io
import math
from typing import Final

from formation_scenario.mission_files.mission import (
    MAX_ITEMS,
    Datum,
    Mission,
    MissionFileError,
    degrees,
    number,
    waypoint,
)

LATITUDE: Final = ("lat_deg", "latitude_deg", "latitude", "lat")
LONGITUDE: Final = ("lon_deg", "longitude_deg", "longitude", "lon", "lng", "long")
HEIGHTS: Final[dict[str, Datum]] = {
    "alt_m": "sea level", "altitude_m": "sea level", "alt": "sea level", "altitude": "sea level",
    "elevation": "sea level", "ele": "sea level", "amsl_m": "sea level",
    "height_m": "home", "height": "home", "relative_alt": "home",
    "agl_m": "ground", "agl": "ground",
}  # fmt: skip
"""Columns of heights, and from where each is measured."""


def read_csv(text: str, file: str) -> Mission:
    """Return the points of a table, a row each.

    Raises:
        MissionFileError: no such columns, or a cell that isn't a number.
    """
    try:
        rows = list(csv.reader(io.StringIO(text), _dialect(text)))
    except csv.Error as error:
        raise MissionFileError(f"{file}: not a table: {error}") from error
    header = [cell.strip().lower() for cell in rows[0]] if rows else []
    lat, lon = _column(header, LATITUDE, file, "latitude"), _column(header, LONGITUDE, file, "longitude")
    height = next((header.index(name) for name in HEIGHTS if name in header), None)
    datum: Datum = "sea level" if height is None else HEIGHTS[header[height]]
    body = [(line, row) for line, row in enumerate(rows[1:], 2) if any(cell.strip() for cell in row)]
    if not 2 <= len(body) <= MAX_ITEMS:
        raise MissionFileError(f"{file}: found {len(body)} points; allowed: 2 to {MAX_ITEMS}")
    items = []
    for line, row in body:
        where = f"{file}: line {line}"
        if len(row) != len(header):
            raise MissionFileError(f"{where}: found {len(row)} columns; allowed: {len(header)}, as in its header")
        height_m = math.nan if height is None or not row[height].strip() else number(row[height], where, "height")
        position = degrees(row[lat], where, "latitude"), degrees(row[lon], where, "longitude")
        items.append(waypoint(where, *position, height_m, datum))
    return Mission(file, tuple(items), tuple(range(1, 1 + len(items))))


def _dialect(text: str) -> type[csv.Dialect]:
    """Return Excel's dialect with the separator of the header: comma, semicolon or tab."""
    header = text.partition("\n")[0]

    class Dialect(csv.excel):
        delimiter = max(",;\t", key=header.count)

    return Dialect


def _column(header: list[str], names: tuple[str, ...], file: str, what: str) -> int:
    for name in names:
        if name in header:
            return header.index(name)
    raise MissionFileError(
        f"{file}: line 1: found columns {', '.join(header)[:80]}; allowed: one of {', '.join(names)} for the {what}"
    )
