"""Missions as people fly them, inside fences."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from formation_scenario import load_scenario
from tests.missions import keys_of

AROUND_M: Final = 600.0
"""Room that the fence leaves around the waypoints, where the file has none."""


def fenced_keys_of(name: str, **more: Any) -> dict[str, Any]:
    """Return the keys of a scenario that flies a mission within its file's fence, or one around its waypoints."""
    keys = keys_of(name)
    if not name.endswith(".plan"):
        waypoints = np.array(load_scenario(keys, flown=True).path.waypoints_m)[:, :2]
        (south, west), (north, east) = waypoints.min(axis=0) - AROUND_M, waypoints.max(axis=0) + AROUND_M
        keys["safety"] = {"fence": {"corners_m": [[south, west], [north, west], [north, east], [south, east]]}}
    return keys | more
