"""Missions as people fly them, made anew: legs, angles and heights of public ones at other places, with own fences.

`FLOWN` are flown at once. `delivery.waypoints` is refused for one leg that is too steep.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

FOLDER: Final = Path(__file__).parent
FLOWN: Final = (
    "racetrack.waypoints",  # two long legs and two short ones, a jump without end
    "big_loop.waypoints",  # the same with corners of other angles, from the air
    "loiter_circuit.waypoints",  # two circles around a point of the circuit, a jump
    "quadplane_tour.waypoints",  # vertical take-off, a circuit flown twice, a landing approach
    "long_legs.waypoints",  # a soaring task with legs of 4 to 8 km
    "terrain_survey.waypoints",  # lanes with turnarounds, heights above ground, camera triggers
    "grid.waypoints",  # lanes across each other
    "surveys.plan",  # two surveys of QGroundControl, with a fence
    "lake.plan",  # a sharp corner between long legs, with a fence
)
REFUSED: Final = {"delivery.waypoints": "path.waypoints_m.34: found a leg of 21 m that descends 5.0 m"}


def keys_of(name: str, **more: Any) -> dict[str, Any]:
    """Return the keys of a scenario that flies a mission with three followers."""
    return {"vehicles": {"count": 4}, "path": {"file": str(FOLDER / name)}} | more
