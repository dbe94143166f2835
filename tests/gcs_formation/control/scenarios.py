"""Scenarios that differ from one that is loaded once."""

from __future__ import annotations

from functools import cache
from typing import Any

from formation_scenario import Scenario, load_scenario


@cache
def usual() -> Scenario:
    """Return a leader and two followers in the air on a straight path."""
    return load_scenario(
        {
            "vehicles": {"count": 3},
            "start": {"in_air": True},
            "formation": {"shape": "arrow", "spacing_m": 30},
            "law": {"type": "pid"},
            "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]},
        }
    )


def with_law(base: Scenario, **keys: Any) -> Scenario:
    """Return a scenario with some keys of its law changed; groups of keys are given as objects."""
    return base.model_copy(update={"law": base.law.model_copy(update=keys)})


def with_vehicles(*each: dict[str, Any]) -> Scenario:
    """Return the usual scenario with other vehicles: all are followers but for what is given."""
    vehicle = usual().vehicles[0]
    vehicles = tuple(vehicle.model_copy(update={"role": "follower", **keys}) for keys in each)
    return usual().model_copy(update={"vehicles": vehicles})
