"""Missions that are repaired, as keys, and the scenario that a repair makes of them."""

from collections.abc import Sequence
from typing import Any

import yaml

from formation_scenario import Scenario, load_scenario
from formation_scenario.repair import Repair


def mission(kind: str, path: Sequence[Sequence[float]], speed_mps: float = 22.0, **keys: Any) -> dict[str, Any]:
    path_keys = {"kind": kind, "speed_mps": speed_mps, "waypoints_m": path}
    return {"vehicles": {"count": 4}, "start": {"in_air": True}, "path": path_keys, **keys}


def loaded(found: Repair) -> Scenario:
    return load_scenario(yaml.safe_load(found.text()))
