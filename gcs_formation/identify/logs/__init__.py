"""Logs of flights: each format has a reader that returns tracks, what was commanded and what the vehicle did."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from gcs_formation.identify.logs.columns import read_columns
from gcs_formation.identify.logs.dataflash import read_dataflash
from gcs_formation.identify.logs.telemetry import read_telemetry
from gcs_formation.identify.logs.track import Log
from gcs_formation.identify.logs.ulog import read_ulog

READERS: Final[dict[str, Callable[[Path], Log]]] = {
    ".tlog": read_telemetry,
    ".bin": read_dataflash,
    ".ulg": read_ulog,
    ".csv": read_columns,
}
"""The reader of each format, by the ending of its files. Each raises OSError, or ValueError where the text is wrong."""
