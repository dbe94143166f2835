"""Whether a vehicle's battery lasts for the planned flight, before the first command."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from formation_scenario import Scenario
from formation_scenario.planned_progress import planned_m
from gcs_formation.features.batteries.endurance import planned_full_s
from gcs_formation.features.batteries.keys import BatteryKeys
from gcs_formation.features.batteries.way_home import LANDING_S
from gcs_formation.mission.gate import AsFound
from gcs_formation.vehicle.checks import Finding

TAKE_OFF_S: Final = 120.0
"""Time from take-off until the formation is on its path, s."""
TURN_TO_LAND_S: Final = {True: 105.0, False: 260.0}
"""How long each vehicle takes that lands before the last one (`finish.then: land`), by whether it hovers. Tuned: s; 60
to 400; shown by the flights of docs/real-autopilots.md from boot to the ground: multirotors 78 to 103 s, ArduPlanes 140
to 207 s, PX4 planes, which have a landing pattern of their own, 258 s."""


def findings(found: AsFound) -> list[Finding]:
    """Return what is wrong with a vehicle's battery, if it tells one. Of a vehicle that flies it is only said."""
    keys, battery, motion = BatteryKeys.of(found.scenario).battery, found.seen.battery, found.seen.motion
    if math.isnan(battery.left) or motion is None:
        return []
    stated_s = math.nan if keys.endurance_s is None else keys.endurance_s
    home_m = found.seen.home_m or (motion.north_m, motion.east_m)
    text = lacking(found.scenario, battery.left, planned_full_s(battery, stated_s), home_m)
    return [Finding(text, refuses=keys.before_take_off == "refuse" and not found.flies)] if text else []


def lacking(scenario: Scenario, left: float, full_s: float, home_m: tuple[float, float]) -> str:
    """Return in words what a battery lacks for the planned flight; empty if it suffices, or if that isn't known.

    Args:
        scenario: what is planned.
        left: share of its capacity that is left, 0 to 1.
        full_s: how long a full one lasts, s; NaN if that isn't known.
        home_m: the vehicle's home, north and east of the origin, m.
    """
    reserve = BatteryKeys.of(scenario).battery.reserve
    needed_s = planned_s(scenario, home_m)
    needed = reserve if math.isnan(full_s) else reserve + needed_s / full_s
    if left >= needed:
        return ""
    found = f"battery: found {left:.0%} left; allowed: "
    if math.isnan(full_s):
        return f"{found}{needed:.0%} or more, the reserve (safety.battery.reserve)"
    use = f"{needed_s / 60.0:.0f} min of flight and way home, of {full_s / 60.0:.0f} min on a full one"
    mends = "Charge it, or plan a shorter flight"
    return f"{found}{needed:.0%} or more, for {use}, and the reserve of {reserve:.0%} (safety.battery). {mends}"


def planned_s(scenario: Scenario, home_m: tuple[float, float]) -> float:
    """Return how long the planned flight takes from take-off to landing at home, s, in still air.

    Where all land one after another, the last waits for the others, and which that is isn't known before.
    """
    end = scenario.leader_path.at(float(planned_m(scenario, np.array(scenario.duration_s))))
    away_m = math.hypot(float(end.north_m) - home_m[0], float(end.east_m) - home_m[1])
    others = len(scenario.vehicles) - 1 if scenario.finish.then == "land" else 0
    waits_s = TURN_TO_LAND_S[scenario.hovers] * others
    return TAKE_OFF_S + scenario.duration_s + away_m / max(scenario.path.begin_mps, 1.0) + waits_s + LANDING_S
