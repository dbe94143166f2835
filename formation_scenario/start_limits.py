"""Limits of starts in the air: separation, clearance of the ground, and the fence."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flight_model.arrays import Array
from formation_scenario.fence_limits import outside_fence
from formation_scenario.geofence import Geofence
from formation_scenario.model import Scenario
from formation_scenario.path_limits import TOLERANCE
from formation_scenario.source import KeyPath, dotted
from formation_scenario.start_states import start_positions_m
from formation_scenario.violations import HEIGHT_TOLERANCE_M, Violation

OFFSET: KeyPath = ("start", "offset_m")


def check_start(scenario: Scenario) -> Iterator[Violation]:
    """Yield the worst of the starts in the air that are too near to another, too low, or outside the fence.

    After a take-off vehicles assemble at the same positions.
    """
    in_air = scenario.on_same_path({"start": scenario.start.model_copy(update={"in_air": True})})
    positions_m, safety = start_positions_m(in_air), scenario.safety
    who = [f"vehicle {vehicle.vehicle_id}" for vehicle in scenario.vehicles]
    separation_m, found = _nearest(scenario, positions_m)
    if separation_m < safety.separation_m * (1.0 - TOLERANCE):
        yield Violation(OFFSET, found, f"{safety.separation_m:g} m or more (safety.separation_m)", "start")
    over_m = positions_m[:, 2] - np.nan_to_num(
        scenario.ground.height(positions_m[:, 0], positions_m[:, 1]), nan=-np.inf
    )
    lowest = int(over_m.argmin())
    if over_m[lowest] < safety.clearance_m - HEIGHT_TOLERANCE_M:
        found = f"{who[lowest]} begins {over_m[lowest]:.1f} m above the ground"
        yield Violation(OFFSET, found, f"{safety.clearance_m:g} m or more (safety.clearance_m)", "start")
    yield from _start_in_fence(scenario.fence, positions_m, who)


def starts_without_room(scenario: Scenario, room_m: float) -> str | None:
    """Return the nearest starts in the air if their separation exceeds the limit by less than `room_m`; else None."""
    if not any(scenario.start.offset_m) or not scenario.start.in_air:
        return None
    separation_m, found = _nearest(scenario, start_positions_m(scenario))
    return f"{dotted(OFFSET)}: {found}" if separation_m < scenario.safety.separation_m + room_m else None


def _nearest(scenario: Scenario, positions_m: Array) -> tuple[float, str]:
    """Return the smallest distance between the starts of any two vehicles (V, 3), and which two these are, in words."""
    separation_m = np.linalg.norm(positions_m[:, None] - positions_m[None, :], axis=-1)
    separation_m[np.tril_indices(len(positions_m))] = np.inf
    one, other = np.unravel_index(int(separation_m.argmin()), separation_m.shape)
    first, second = (scenario.vehicles[each].vehicle_id for each in (one, other))
    nearest_m = float(separation_m[one, other])
    return nearest_m, f"vehicle {first} and vehicle {second} begin {nearest_m:.3g} m apart"


def _start_in_fence(fence: Geofence | None, positions_m: Array, who: list[str]) -> Iterator[Violation]:
    if fence is None:
        return
    lowest, highest, (min_m, max_m) = int(positions_m[:, 2].argmin()), int(positions_m[:, 2].argmax()), fence.heights_m
    if positions_m[lowest, 2] < min_m - HEIGHT_TOLERANCE_M:
        allowed = f"{min_m:g} m or more (safety.fence.height_min_m)"
        yield Violation(OFFSET, f"{who[lowest]} begins at {positions_m[lowest, 2]:.1f} m", allowed, "start")
    if positions_m[highest, 2] > max_m + HEIGHT_TOLERANCE_M:
        allowed = f"{max_m:g} m or less (safety.fence.height_max_m)"
        yield Violation(OFFSET, f"{who[highest]} begins at {positions_m[highest, 2]:.1f} m", allowed, "start")
    if fence.sides is not None:
        within_m = fence.sides.inside_m(positions_m[:, :2])
        worst = int(within_m.argmin())
        if within_m[worst] < 0.0:
            found, allowed = outside_fence(fence.sides, positions_m[worst, :2], float(-within_m[worst]))
            yield Violation(OFFSET, f"{who[worst]} begins {found}", allowed, "start")
