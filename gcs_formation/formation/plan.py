"""The slots over time, and who leads: successive transitions, each of which starts from the previous one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from formation_scenario import Scenario, slot_schedule
from formation_scenario.arrangement import Arrangement, assigned
from formation_scenario.formation import FormationChange
from formation_scenario.slot_motion import SlotMotion
from formation_scenario.transition import Transition
from gcs_formation.arrays import Array

APART_S = 0.05
"""Interval of the moments at which slots are evaluated; between them they are extrapolated at constant acceleration."""


@dataclass(frozen=True)
class Proposal:
    """A change that can be flown and hasn't been adopted yet."""

    arrangement: Arrangement
    way: Transition


class FormationPlan:
    """The slots of all columns, (C, 3); before the path begins they are displaced by `start.offset_m`."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with the scenario's first shape and leader."""
        first = slot_schedule(scenario)[0]
        self.arrangement = first.arrangement
        self.scheduled: deque[FormationChange] = deque(sorted(scenario.formation.changes, key=lambda each: each.at_s))
        """The scenario's changes that haven't begun yet."""
        self._way = Transition.standing(first.places_m)
        self._offset_m = np.tile(scenario.start.offset_m, (len(first.places_m), 1))
        self._offset_m[0] = 0.0

    def resume(self, scenario: Scenario, arrangement: Arrangement, slots_m: Array, mission_s: float) -> None:
        """Begin with an arrangement, assigned nearest to `slots_m` (C, 3), and the changes due after a mission time."""
        self.arrangement = arrangement
        everyone = np.ones(len(slots_m), dtype=np.bool_)
        self._way = Transition.standing(assigned(scenario, arrangement, slots_m, everyone))
        self._offset_m -= self._offset_m[arrangement.leader]
        while self.scheduled and self.scheduled[0].at_s <= mission_s:
            self.scheduled.popleft()

    @property
    def leader(self) -> int:
        """The column that leads."""
        return self.arrangement.leader

    def at(self, now_s: float, *, begun: bool) -> SlotMotion:
        """Return the slots at a time of the station's clock, s; `begun`: whether the path has begun."""
        slots = self._way.at(now_s)
        return slots if begun else SlotMotion.at_rest(slots.position_m + self._offset_m)

    def at_each(self, times_s: Array, *, begun: bool) -> SlotMotion:
        """Return every slot at a time of its own, (C,)."""
        coarse = np.round(times_s / APART_S)
        moments = sorted(set(coarse.tolist()))
        motions = [self.at(moment * APART_S, begun=begun) for moment in moments]
        each = np.array([(m.position_m, m.velocity_mps, m.acceleration_mps2) for m in motions])
        rows = np.searchsorted(moments, coarse)
        near = SlotMotion(*(each[rows, i, np.arange(rows.size)] for i in range(3)))
        return near.after(times_s - coarse * APART_S)

    def seen_from(self, leader: int, swing_rad: float, now_s: float) -> SlotMotion:
        """Return the slots now, relative to another leader that heads `swing_rad` clockwise of the present one."""
        return self._way.seen_from(leader, swing_rad).at(now_s)

    def hand_over(self, leader: int, swing_rad: float) -> None:
        """Make another column the leader; all positions stay the same."""
        self._way = self._way.seen_from(leader, swing_rad)
        self.arrangement = self.arrangement._replace(leader=leader)
        self._offset_m -= self._offset_m[leader]

    def adopt(self, proposal: Proposal) -> None:
        """Fly a change."""
        self.arrangement, self._way = proposal.arrangement, proposal.way
