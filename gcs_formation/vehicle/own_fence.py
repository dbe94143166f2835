"""A vehicle's own geofence, by its parameters: heights and a distance around its home.

Sources: ArduPilot documentation, "Geofencing" and "Complete Parameter List" (FENCE_); PX4 user guide, "Geofence" and
"Parameter Reference" (GF_). Polygons aren't parameters.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gcs_formation.vehicle.own_failsafe import Parameters

FENCE_NAMES: Final = (
    "FENCE_ENABLE",
    "FENCE_ACTION",
    "FENCE_TYPE",
    "FENCE_ALT_MAX",
    "FENCE_ALT_MIN",
    "FENCE_RADIUS",
)
"""ArduPilot's parameters."""
GEOFENCE_NAMES: Final = ("GF_ACTION", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST")
"""PX4's: what it does, and the greatest height above home and distance from it, m; 0 for none."""
HIGHEST, AROUND, LOWEST = 1, 2, 8
"""FENCE_TYPE: greatest height, circle around home, least height."""
WARNS_ONLY: Final = (0.0, 1.0)
"""GF_ACTION: nothing, or a warning."""
MARGIN_M: Final = 2.0
"""How far inside a vehicle is kept (FENCE_MARGIN's default): beyond its fence it goes home by itself."""


class OwnFence(NamedTuple):
    """Heights above its home, and the distance from it, that a vehicle keeps to, m."""

    lowest_m: float
    highest_m: float
    radius_m: float
    names: tuple[str, str, str]
    """Parameters of these, in this order; "" where there is none."""


def ardupilot_fence(values: Parameters) -> OwnFence | None:
    """Return the geofence of an ArduPilot, None if it is off or only reports."""
    if not values.get("FENCE_ENABLE") or not values.get("FENCE_ACTION", 1.0):
        return None
    kinds = int(values.get("FENCE_TYPE", 0.0))
    lowest_m = values.get("FENCE_ALT_MIN", -math.inf) if kinds & LOWEST else -math.inf
    highest_m = values.get("FENCE_ALT_MAX", math.inf) if kinds & HIGHEST else math.inf
    radius_m = values.get("FENCE_RADIUS", math.inf) if kinds & AROUND else math.inf
    return OwnFence(lowest_m, highest_m, radius_m, ("FENCE_ALT_MIN", "FENCE_ALT_MAX", "FENCE_RADIUS"))


def px4_fence(values: Parameters) -> OwnFence | None:
    """Return the geofence of a PX4, None if it is off or only warns."""
    if values.get("GF_ACTION", 0.0) in WARNS_ONLY:
        return None
    highest_m, radius_m = (values.get(name) or math.inf for name in GEOFENCE_NAMES[1:])
    return OwnFence(-math.inf, highest_m, radius_m, ("", "GF_MAX_VER_DIST", "GF_MAX_HOR_DIST"))
