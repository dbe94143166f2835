"""Waypoint files (.waypoints, .txt) of Mission Planner, MAVProxy and QGroundControl: "QGC WPL 110".

Twelve columns, separated by tabs or spaces: number, current, frame, command, parameters 1 to 4, latitude, longitude,
height, autocontinue. Item 0 is home. Source: MAVLink developer guide, "Plain-text file format".
"""

from __future__ import annotations

import math
from typing import Final

from formation_scenario.mission_files.mission import Mission, MissionFileError, MissionItem, number

HEADER: Final = "QGC WPL"
COLUMNS: Final = 12


def read_waypoints(text: str, file: str) -> Mission:
    """Return the mission of a waypoint file's text; `file` names it in messages.

    Raises:
        MissionFileError: another header, or a line that isn't an item.
    """
    lines = text.splitlines()
    if not lines or not lines[0].strip().startswith(HEADER):
        found = repr(lines[0].strip()[:40]) if lines else "an empty file"
        raise MissionFileError(f"{file}: line 1: found {found}; allowed: '{HEADER} 110'")
    items, numbers = list[MissionItem](), list[int]()
    home: tuple[float, float, float] | None = None
    for line, row in enumerate(lines[1:], 2):
        if not row.strip() or row.startswith("#"):
            continue
        where = f"{file}: line {line}"
        cells = row.split()
        if len(cells) != COLUMNS:
            raise MissionFileError(f"{where}: found {len(cells)} columns; allowed: {COLUMNS}")
        index = int(number(cells[0], where, "number"))
        item = _item(cells, f"{file}: item {index}")
        if index == 0:  # home, whatever its command
            home = (item.lat_deg, item.lon_deg, item.height_m) if item.placed else None
            continue
        items.append(item)
        numbers.append(index)
    return Mission(file, tuple(items), tuple(numbers), home)


def _item(cells: list[str], where: str) -> MissionItem:
    frame, command = (
        int(number(cell, where, what)) for cell, what in zip(cells[2:4], ("frame", "command"), strict=True)
    )
    values = [_value(cell, where, index) for index, cell in enumerate(cells[4:11], 5)]
    first, second, third, fourth, lat, lon, height = values
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        lat = lon = math.nan  # commands use these columns for other parameters
    return MissionItem(where, command, frame, (first, second, third, fourth), lat, lon, height)


def _value(cell: str, where: str, column: int) -> float:
    """Return a parameter or coordinate; NaN, as programs write what is left open, is one."""
    return math.nan if cell.lower() == "nan" else number(cell, where, f"column {column}")
