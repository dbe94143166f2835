"""Limits of the path's steps of height: clearance of the ground, and the fence's heights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from formation_scenario.formation import added
from formation_scenario.model import Scenario
from formation_scenario.path_limits import TOLERANCE
from formation_scenario.planned_progress import planned_end_s, planned_m
from formation_scenario.sampled_path import position_text
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.source import KeyPath
from formation_scenario.violations import HEIGHT_TOLERANCE_M, Violation

STEP_SAMPLES = 200
"""Number of times within a step at which heights of path and ground are checked."""


def check_steps(scenario: Scenario) -> Iterator[Violation]:
    """Yield steps of height that lead too near to the ground or outside the fence's heights, each at its worst time."""
    times_s = _within_steps(scenario)
    if not times_s.size:
        return
    step_m = np.array([added(scenario.path.steps, at_s)[2] for at_s in times_s.tolist()])
    points = scenario.leader_path.at(planned_m(scenario, times_s))
    lowest_m, highest_m = _lowest_and_highest_m(scenario)
    height_m = points.height_m + step_m
    over_m = height_m - np.nan_to_num(scenario.ground.height(points.north_m, points.east_m))
    fence_m = (-np.inf, np.inf) if scenario.fence is None else scenario.fence.heights_m
    for sign, limit_m, up_m, flown_m, what, key in (
        (1.0, scenario.safety.clearance_m, lowest_m, over_m, "m above the ground", "safety.clearance_m"),
        (1.0, fence_m[0], lowest_m, height_m, "m high", "safety.fence.height_min_m"),
        (-1.0, fence_m[1], highest_m, height_m, "m high", "safety.fence.height_max_m"),
    ):
        room_m = np.where(sign * step_m < 0.0, sign * (flown_m + up_m - limit_m), np.inf)
        worst = int(room_m.argmin())
        if room_m[worst] < -HEIGHT_TOLERANCE_M:
            slot = "the leader" if up_m == 0.0 else f"the {'lowest' if sign > 0.0 else 'highest'} slot"
            found = (
                f"at {times_s[worst]:.4g} s ({position_text(points, worst)}) "
                f"{slot} is {flown_m[worst] + up_m:.1f} {what}"
            )
            allowed = f"{limit_m:g} m or {'more' if sign > 0.0 else 'less'} ({key})"
            yield Violation(_step_at(scenario, times_s[worst], sign), found, allowed, "step")


def _lowest_and_highest_m(scenario: Scenario) -> tuple[float, float]:
    """Return how far others fly below and above the leader; over terrain those below are raised clear of it."""
    up_m = [float(up_m) for step in slot_schedule(scenario) for up_m in step.positions_m[:, 2]]
    return min(0.0, *up_m) if scenario.terrain is None else 0.0, max(0.0, *up_m)


def _within_steps(scenario: Scenario) -> Array:
    """Return times of steps of height before the flight's planned end, s: their corners, and samples between."""
    found, end_s = [np.zeros(0)], planned_end_s(scenario)
    for step in scenario.path.steps:
        if step.height_m:
            turns_s = np.array([step.ramp_s, step.for_s / 2.0, step.for_s - step.ramp_s])
            within_s = np.concatenate((turns_s, np.linspace(0.0, step.for_s, STEP_SAMPLES)))
            # Times strictly inside: where one step ends as another begins, they don't add up.
            found.append(step.at_s + np.clip(within_s, TOLERANCE, step.for_s - TOLERANCE))
    times_s = np.sort(np.concatenate(found))
    return times_s[times_s <= end_s]


def _step_at(scenario: Scenario, at_s: float, sign: float) -> KeyPath:
    """Return the key of the step with the largest height downwards (`sign` 1) or upwards (-1) at a time."""
    steps = scenario.path.steps
    index = min(range(len(steps)), key=lambda each: sign * added(steps[each : each + 1], at_s)[2])
    return "path", "steps", index, "height_m"
