"""Reads a table of setpoints and responses (.csv), by the names of its columns."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gcs_formation.identify.logs.track import HOVERING_SEEN, OVER_GROUND_SEEN, SEEN, Log, Track

TIME: Final = "time_s"
SYSTEM: Final = "system"


class _Column(NamedTuple):
    quantity: str
    scale: float = 1.0


DEG: Final = math.pi / 180.0
COLUMNS: Final = {
    "speed_setpoint_mps": _Column("speed"),
    "airspeed_mps": _Column("airspeed"),
    "ground_speed_mps": _Column("speed seen"),
    "heading_setpoint_deg": _Column("heading", DEG),
    "heading_setpoint_rad": _Column("heading"),
    "heading_deg": _Column("yaw", DEG),
    "heading_rad": _Column("yaw"),
    "course_deg": _Column("course", DEG),
    "course_rad": _Column("course"),
    "height_setpoint_m": _Column("height"),
    "height_m": _Column("alt"),
    "climb_mps": _Column("climb"),
}
WANTED: Final = (
    f"a first line with names of columns, {TIME} and some of {', '.join(COLUMNS)} ({SYSTEM} for several vehicles)"
)


def read_columns(log: Path) -> Log:
    """Return the tracks of a table: one of each vehicle. Empty cells are values that aren't known.

    With `ground_speed_mps` and without `airspeed_mps` it is a multirotor's; with `course_…` and without `heading_…`,
    the response to heading setpoints is the course.

    Raises:
        OSError: it can't be read.
        ValueError: it isn't such a table.
    """
    with log.open(encoding="utf-8-sig", newline="") as file:
        table = csv.DictReader(file)
        names = [name.strip() for name in table.fieldnames or ()]
        if TIME not in names:
            raise ValueError(f"columns {', '.join(names[:8]) or 'of no name'}, and no {TIME}; a table has {WANTED}")
        rows = [_row(row, line) for line, row in enumerate(table, start=2)]
    tracks = [_track(system, names, rows) for system in sorted({int(row.get(SYSTEM, 1.0)) for row in rows})]
    return Log(tracks, f"no vehicle under setpoints (columns {', '.join(names)})", f"30 s or more of {WANTED}")


def _row(row: dict[str, str | None], line: int) -> dict[str, float]:
    found = dict[str, float]()
    for name, text in row.items():
        key = name.strip() if isinstance(name, str) else ""
        if text and (key in COLUMNS or key in (TIME, SYSTEM)):
            try:
                found[key] = float(text)
            except ValueError as error:
                raise ValueError(f"{text!r} in column {key} of line {line}, which isn't a number") from error
    return found


def _track(system: int, names: list[str], rows: list[dict[str, float]]) -> Track:
    hovers = "ground_speed_mps" in names and "airspeed_mps" not in names
    over_ground = not any(name.startswith(("heading_deg", "heading_rad")) for name in names)
    seen = HOVERING_SEEN if hovers else OVER_GROUND_SEEN if over_ground else SEEN
    track = Track(system, "columns", seen=seen, aircraft="arducopter" if hovers else None)
    its = [row for row in rows if int(row.get(SYSTEM, 1.0)) == system and TIME in row]
    at_s = np.array([row[TIME] for row in its])
    for name, column in COLUMNS.items():
        if name in names:
            track.put(column.quantity, at_s, column.scale * np.array([row.get(name, math.nan) for row in its]))
    return track
