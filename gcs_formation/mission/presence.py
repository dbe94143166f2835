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

    def __init__(self, by_index: Mapping[int, Vehicle], plan: FormationPlan, count: int) -> None:
        """Begin with a transition that was planned with the leader alone."""
        self._by_index, self._plan = by_index, plan
        self.planned_for = [False] * count
        """Whether the present transition was planned with each vehicle, (C,)."""
        self.planned_for[plan.leader] = True

    def plan_behind(self, leader: int) -> None:
        """Forget for whom was planned, but a leader."""
        self.planned_for = [index == leader for index in range(len(self.planned_for))]

    def somebody_returned(self) -> bool:
        """Return whether a vehicle is present that wasn't when the transition was planned."""
        for index, planned in enumerate(self.planned_for):
            if not planned:
                vehicle = self._by_index.get(index)
                if vehicle is not None and (vehicle.member is Member.FLYING or index == self._plan.leader):
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
        there[[index for index, vehicle in self._by_index.items() if vehicle.member is Member.FLYING]] = True
        return there
