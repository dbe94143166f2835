"""What `check` says about batteries: whether full ones last for the planned flight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from formation_scenario import Scenario
from gcs_formation.features.batteries.before_take_off import lacking
from gcs_formation.features.batteries.keys import BatteryKeys


def full_batteries(scenario: Scenario) -> Iterator[str]:
    """Yield that a full battery doesn't last for the planned flight, where the scenario states how long it lasts."""
    full_s = BatteryKeys.of(scenario).battery.endurance_s
    if full_s is None:
        return
    begin_m = scenario.path.waypoints_m[0]
    text = lacking(scenario, 1.0, full_s, (begin_m[0], begin_m[1]))
    if text:
        yield f"safety.battery.endurance_s: {text}"


WARNINGS: Final = (full_batteries,)
