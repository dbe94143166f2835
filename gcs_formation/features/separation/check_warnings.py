"""What `check` says about the separation rule."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from formation_scenario.mean_delays import mean_delays_s
from formation_scenario.model import Scenario
from formation_scenario.orders import read_order
from formation_scenario.slot_assignment import slot_schedule
from gcs_formation.features.separation.keys import SeparationKeys

SEEN_S: Final = 0.9
"""Time, besides a round trip, until a follower brakes behind a multirotor that brakes against its orders. Tuned: s; 0.6
to 1.5; shown by `pytest tests/gcs_formation/features/separation`."""


def no_room_to_stop(scenario: Scenario) -> Iterator[str]:
    """Yield where multirotors fly too close behind each other for one to stop behind another that stops unasked.

    The follower flies on at its speed until it is commanded, then brakes as hard as the other. Evading sideways or
    upwards gains it 2 m at most.
    """
    min_m, kept = scenario.safety.separation_m, SeparationKeys.of(scenario).avoidance.enabled
    if not scenario.hovers or not kept:
        return
    commanded_mps = [read_order(each.order).speed_mps or 0.0 for _, each in scenario.timed_orders]
    speed_mps, first = max(scenario.path.fastest_mps, *commanded_mps, 0.0), 1 if scenario.leader is None else 0
    round_trips_s = (
        sum(mean_delays_s(scenario, step)) for vehicle in scenario.vehicles for step in scenario.link_steps(vehicle)
    )
    enough_m = min_m + speed_mps * (max(round_trips_s) + SEEN_S)
    for step in slot_schedule(scenario):
        forward_m, right_m, up_m = np.moveaxis(step.positions_m[first:, None] - step.positions_m[first:], -1, 0)
        if not scenario.formation.slots_turn:  # on some course they are behind each other
            forward_m, right_m = np.hypot(forward_m, right_m), np.zeros_like(right_m)
        behind = (forward_m > 0.0) & (np.hypot(right_m, up_m) < min_m)
        nearest_m = float(forward_m[behind].min(initial=math.inf))
        if nearest_m < enough_m:
            found = f"formation: found slots {nearest_m:.3g} m behind each other ({step.shape}) at {speed_mps:g} m/s"
            yield f"{found}; {enough_m:.3g} m or more leave {min_m:g} m behind one that stops uncommanded"


WARNINGS: Final = (no_room_to_stop,)
