"""What `check` says about the fence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from formation_scenario.model import Scenario
from gcs_formation.features.airspace.keys import AirspaceKeys


def rally_outside(scenario: Scenario) -> Iterator[str]:
    """Yield a warning of each rally point outside the fence, where autopilots don't return to."""
    fence = AirspaceKeys.of(scenario).fence
    if fence is None:
        return
    for index, position_m in enumerate(fence.rally_m):
        if (outside_m := fence.outside_m(*position_m)) > 0.0:
            yield f"safety.fence.rally_m.{index}: rally point {outside_m:.0f} m outside the fence"


WARNINGS: Final = (rally_outside,)
