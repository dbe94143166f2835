"""The formats of mission files by their suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from formation_scenario.bounded_read import read_bounded
from formation_scenario.mission_files.csv_table import read_csv
from formation_scenario.mission_files.geojson import read_geojson
from formation_scenario.mission_files.mission import MAX_BYTES, MAX_ITEMS, Mission, MissionFileError
from formation_scenario.mission_files.qgc_plan import read_plan
from formation_scenario.mission_files.wpl import HEADER, read_waypoints
from formation_scenario.mission_files.xml_points import read_gpx, read_kml

FORMATS: Final[Mapping[str, Callable[[str, str], Mission]]] = MappingProxyType(
    {
        ".plan": read_plan,
        ".waypoints": read_waypoints,
        ".txt": read_waypoints,
        ".kml": read_kml,
        ".gpx": read_gpx,
        ".geojson": read_geojson,
        ".json": read_geojson,
        ".csv": read_csv,
    }
)


def read_mission(path: Path) -> Mission:
    """Read a mission file of any known format.

    Raises:
        MissionFileError: it can't be read, is of another kind, or lacks something; the message says where.
    """
    try:
        data = read_bounded(path, MAX_BYTES)
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise MissionFileError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise MissionFileError(
            f"{path}: found byte 0x{data[error.start]:02x} at offset {error.start}; allowed: text in UTF-8"
        ) from error
    reader = FORMATS.get(path.suffix.lower())
    if reader is None and text.startswith(HEADER):
        reader = read_waypoints
    if reader is None:
        raise MissionFileError(f"{path}: found a file '{path.suffix}'; allowed: {', '.join(FORMATS)}")
    mission = reader(text, path.name)
    if len(mission.items) > MAX_ITEMS:
        raise MissionFileError(f"{path}: found {len(mission.items)} items; allowed: up to {MAX_ITEMS}")
    return mission
