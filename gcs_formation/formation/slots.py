"""Where every follower's slot is at each moment: shapes one after another, with a smooth way between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formation_scenario import Scenario, slot_schedule
from gcs_formation.arrays import Array
from gcs_formation.control.mixer import SlotMotion

CHANGE_SPEED_MPS = 2.0
"""Mean speed of the slot that has farthest to go; the fastest moment of the way is 15/8 of it."""


@dataclass(frozen=True)
class SlotSchedule:
    """Slots over mission time; before the start they stand `offset_m` aside."""

    offset_m: Array
    tables: tuple[Array, ...]
    times_s: tuple[float, ...]

    def at(self, mission_time_s: float) -> SlotMotion:
        """Return the slots, and their velocities, at a mission time; negative before the start."""
        if mission_time_s < 0:
            return SlotMotion(self.tables[0] + self.offset_m, np.zeros_like(self.tables[0]))
        position, velocity = self.tables[0], np.zeros_like(self.tables[0])
        for begins_s, before, after in zip(self.times_s, self.tables[:-1], self.tables[1:], strict=True):
            share, rate = _progress(mission_time_s - begins_s, change_duration_s(before, after))
            position = position + share * (after - before)
            velocity = velocity + rate * (after - before)
        return SlotMotion(position, velocity)


def change_duration_s(before: Array, after: Array) -> float:
    """Return how long a change of shape takes."""
    return max(1.0, float(np.linalg.norm(after - before, axis=1).max(initial=0.0)) / CHANGE_SPEED_MPS)


def schedule(scenario: Scenario) -> SlotSchedule:
    """Return the scenario's slots."""
    steps = slot_schedule(scenario)
    return SlotSchedule(
        np.array(scenario.start.offset_m),
        tuple(step.slots_m for step in steps),
        tuple(step.at_s for step in steps[1:]),
    )


def _progress(elapsed_s: float, duration_s: float) -> tuple[float, float]:
    """Return the share of the way made, 0 to 1, and its rate: no jump in speed or acceleration at the ends."""
    u = min(max(elapsed_s / duration_s, 0.0), 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2 / duration_s
