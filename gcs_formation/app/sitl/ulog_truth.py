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
WIND: Final = "SIH_WIND_N", "SIH_WIND_E"
"""Where its wind comes from, north and east, m/s: parameters of versions whose air has wind."""
FEWEST: Final = 2
"""Samples between which a motion is known."""


def read_truth(log: Path) -> dict[str, Array]:
    """Return the columns of the true motion, (N,) each, its airspeed by the log's wind; {} without ground truth.

    Raises:
        OSError: the file can't be read.
        ValueError: it isn't such a log.
    """
    topics, parameters, _ = read_ulog_file(log, (GLOBAL, LOCAL))
    position, moving = topics.get(GLOBAL, {}), topics.get(LOCAL, {})
    if not {"lat", "lon", "alt"} <= position.keys() or not {"vx", "vy", "vz", "heading"} <= moving.keys():
        return {}
    at_s = moving["at_s"]
    if min(at_s.size, position["at_s"].size) < FEWEST:
        return {}

    through_air = [moving[name] + parameters.get(wind, 0.0) for name, wind in zip(("vx", "vy"), WIND, strict=True)]

    def interpolated(name: str) -> Array:
        return np.interp(at_s, position["at_s"], position[name])

    return {
        "boot_s": at_s,
        "lat_rad": np.radians(interpolated("lat")),
        "lon_rad": np.radians(interpolated("lon")),
        "alt_m": interpolated("alt"),
        "north_mps": moving["vx"],
        "east_mps": moving["vy"],
        "climb_mps": -moving["vz"],
        "heading_rad": moving["heading"],
        "airspeed_mps": np.hypot(np.hypot(*through_air), moving["vz"]),
    }
