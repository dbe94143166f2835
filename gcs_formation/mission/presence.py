"""Which vehicles are present in the formation, and for which of them its transition was planned."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flight_model.arrays import Mask
from gcs_formation.guidance.slots import FormationPlan
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle


class Presence:
    """Vehicles that are there now, beside those that the present transition was planned with."""

    def __init__(self, by_column: Mapping[int, Vehicle], plan: FormationPlan, columns: int) -> None:
        """Begin with a transition that was planned with the leader alone."""
        self._by_column, self._plan = by_column, plan
        self.planned_for = [False] * columns
        """Whether the present transition was planned with each vehicle, (C,)."""
        self.planned_for[plan.leader] = True

    def plan_behind(self, leader: int) -> None:
        """Forget for whom was planned, but a leader."""
        self.planned_for = [column == leader for column in range(len(self.planned_for))]

    def somebody_returned(self) -> bool:
        """Return whether a vehicle is present that wasn't when the transition was planned."""
        for column, planned in enumerate(self.planned_for):
            if not planned:
                vehicle = self._by_column.get(column)
                if vehicle is not None and (vehicle.member is Member.FLYING or column == self._plan.leader):
                    return True
        return False

    def returned(self) -> Mask:
        """Return which vehicles are present, but weren't when the transition was planned, (C,)."""
        returned: Mask = self.present() & ~np.array(self.planned_for)
        return returned

    def present(self) -> Mask:
        """Return which vehicles are present, (C,): the leader, and those that fly in the formation."""
        there = np.zeros(len(self.planned_for), dtype=np.bool_)
        there[self._plan.leader] = True
        there[[column for column, vehicle in self._by_column.items() if vehicle.member is Member.FLYING]] = True
        return there
