"""Ground truth in a log of PX4's simulator.

Source: PX4's msg, versioned/VehicleGlobalPosition and VehicleLocalPosition, logged as …_groundtruth; their time is that
since boot, by which telemetry is stamped too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from flight_model.arrays import Array
from gcs_formation.record.ulog_file import read_ulog_file

GLOBAL, LOCAL = "vehicle_global_position_groundtruth", "vehicle_local_position_groundtruth"
FEWEST: Final = 2
"""Samples between which a motion is known."""


def read_truth(log: Path) -> dict[str, Array]:
    """Return the columns of the true motion but its airspeed, (N,) each; {} if the log has no ground truth.

    Raises:
        OSError: the file can't be read.
        ValueError: it isn't such a log.
    """
    topics = read_ulog_file(log, (GLOBAL, LOCAL)).topics
    placed, moving = topics.get(GLOBAL, {}), topics.get(LOCAL, {})
    if not {"lat", "lon", "alt"} <= placed.keys() or not {"vx", "vy", "vz", "heading"} <= moving.keys():
        return {}
    at_s = moving["at_s"]
    if min(at_s.size, placed["at_s"].size) < FEWEST:
        return {}

    def beside(name: str) -> Array:
        return np.interp(at_s, placed["at_s"], placed[name])

    return {
        "boot_s": at_s,
        "lat_rad": np.radians(beside("lat")),
        "lon_rad": np.radians(beside("lon")),
        "alt_m": beside("alt"),
        "north_mps": moving["vx"],
        "east_mps": moving["vy"],
        "climb_mps": -moving["vz"],
        "heading_rad": moving["heading"],
    }
