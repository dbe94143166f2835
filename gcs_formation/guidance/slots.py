"""Slots over time, and how they change positions; over terrain `slot_clearance` raises them."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np

from flight_model.arrays import Array, Mask
from formation_scenario import Scenario
from formation_scenario.formation import FormationChange
from formation_scenario.slot_assignment import Arrangement, assigned, slot_schedule
from formation_scenario.slot_motion import SlotMotion, Transition

STEP_S: Final = 0.05
"""Interval of the moments at which slots are evaluated; between them they are extrapolated at constant acceleration.
Tuned: s; 0.02 to 0.2; by judgement."""
ACROSS: Final = np.array([1.0, -1.0, 0.0])
LEVEL: Final = np.array([1.0, 1.0, 0.0])
WAITS_S: Final = 30.0
"""Longest total delay of moving slots that wait for vehicles. Tuned: s; 10 to 60; shown by `pytest
tests/gcs_formation/guidance`."""


class FormationPlan:
    """The slots of all vehicles, (C, 3); before the path begins they are displaced by `start.offset_m`."""

    def __init__(self, scenario: Scenario) -> None:
        """Begin with the scenario's first shape and leader."""
        first = slot_schedule(scenario)[0]
        self.arrangement = first.arrangement
        self.scheduled: deque[FormationChange] = deque(sorted(scenario.formation.changes, key=lambda each: each.at_s))
        """The scenario's changes that haven't begun yet."""
        self._transition = transition = Transition.standing(first.positions_m)
        self._over_s: float = transition.at_s + transition.duration_s
        """Time from which all slots are at rest."""
        self._rest: SlotMotion | None = None
        """The resting slots returned last, and whether the path had begun then."""
        self._rest_begun = False
        self.goal_m = first.positions_m
        """(C, 3) the slots of the arrangement, where all come to rest."""
        self.offset_m = np.tile(scenario.start.offset_m, (len(first.positions_m), 1))
        self.offset_m[0] = 0.0
        self.kept_m = scenario.safety.kept_m
        """Distance that slots are planned to keep from each other while they move."""
        self.alongside: Mask = np.zeros(len(first.positions_m), dtype=np.bool_)
        """(C,) which vehicles fly alongside the turning leader at its speed and heading: slots far to the side can't be
        held."""
        self._any_alongside = False
        self._slots_turn = scenario.formation.frame != "north"
        self._alongside_m, self._alongside_s, self._turn_rps = first.positions_m, 0.0, 0.0
        """Their positions, (C, 3), at a time of the station's clock, and the leader's turn rate since then."""
        self._separation_m: Array | None = None
        self._planned_m: Array | None = None
        self._separation_of = self.goal_m
        """The result of `separation_m`, and the planned distances and goals that it was made from."""
        self._pace, self._late_s = 1.0, 0.0
        """Share of their planned speed at which slots move, and their delay from having waited."""

    def resume(self, scenario: Scenario, arrangement: Arrangement, slots_m: Array, mission_s: float) -> None:
        """Begin with an arrangement, assigned nearest to `slots_m` (C, 3), and the changes due after a mission time."""
        self.arrangement = arrangement
        self.goal_m = assigned(scenario, arrangement, slots_m)
        self.offset_m = self.offset_m - self.offset_m[arrangement.leader]
        self._fly(Transition.standing(self.goal_m))
        while self.scheduled and self.scheduled[0].at_s <= mission_s:
            self.scheduled.popleft()

    @property
    def leader(self) -> int:
        """Index of the one that leads."""
        return self.arrangement.leader

    def at(self, now_s: float, *, begun: bool) -> SlotMotion:
        """Return the slots at a time of the station's clock, s; `begun`: whether the path has begun."""
        over = self.at_rest(now_s)
        if over and self._rest is not None and self._rest_begun == begun:
            return self._rest
        slots = self._moving(now_s, begun=begun)
        if over:
            self._rest, self._rest_begun = slots, begun
        return slots

    def _moving(self, now_s: float, *, begun: bool) -> SlotMotion:
        slots = self._transition.at(now_s)
        if self._pace < 1.0:
            slots = SlotMotion(
                slots.position_m, self._pace * slots.velocity_mps, self._pace**2 * slots.acceleration_mps2
            )
        if self._any_alongside:
            slots = self._with_those_alongside(slots, now_s)
        if begun or not self.offset_m.any():
            return slots
        return SlotMotion(slots.position_m + self.offset_m, slots.velocity_mps, slots.acceleration_mps2)

    def _with_those_alongside(self, slots: SlotMotion, now_s: float) -> SlotMotion:
        """Return slots with those alongside the leader: fixed in direction over ground, they turn in its frame."""
        turn_rps, position_m = self._turn_rps, self._turned_m(now_s)
        motion = (
            (position_m, slots.position_m),
            (turn_rps * position_m[:, [1, 0, 2]] * ACROSS, slots.velocity_mps),
            (-(turn_rps**2) * position_m * LEVEL, slots.acceleration_mps2),
        )
        return SlotMotion(*(np.where(self.alongside[:, None], theirs, others) for theirs, others in motion))

    def _turned_m(self, now_s: float) -> Array:
        swing_rad = self._turn_rps * (now_s - self._alongside_s)
        return SlotMotion.at_rest(self._alongside_m).seen_from(self.leader, swing_rad).position_m

    def turn(self, now_s: float, turn_rps: float) -> None:
        """Set the leader's turn rate from now on, clockwise, rad/s: the frame's, unless it is fixed to north."""
        if self._any_alongside:
            self._alongside_m = self._turned_m(now_s)
        self._alongside_s, self._turn_rps = now_s, turn_rps if self._slots_turn else 0.0

    def at_each(self, each_s: list[float], *, begun: bool) -> SlotMotion:
        """Return every slot at a time of its own, (C,)."""
        if self.at_rest(min(each_s)):
            return self.at(each_s[0], begun=begun)
        times_s = np.array(each_s)
        coarse = np.round(times_s / STEP_S)
        moments = sorted(set(coarse.tolist()))
        motions = [self.at(moment * STEP_S, begun=begun) for moment in moments]
        each = np.array([(m.position_m, m.velocity_mps, m.acceleration_mps2) for m in motions])
        rows = np.searchsorted(moments, coarse)
        near = SlotMotion(*(each[rows, i, np.arange(rows.size)] for i in range(3)))
        return near.after(times_s - coarse * STEP_S)

    def seen_from(self, leader: int, swing_rad: float, now_s: float) -> SlotMotion:
        """Return the slots now, relative to another leader that heads `swing_rad` clockwise of the present one."""
        return self._transition.seen_from(leader, swing_rad).at(now_s)

    def hand_over(self, leader: int, swing_rad: float) -> None:
        """Make another vehicle the leader; all positions stay the same."""
        transition = self._transition.seen_from(leader, swing_rad)
        self.goal_m = SlotMotion.at_rest(self.goal_m).seen_from(leader, swing_rad).position_m
        self.arrangement = self.arrangement._replace(leader=leader)
        self.offset_m = SlotMotion.at_rest(self.offset_m).seen_from(leader, swing_rad).position_m
        self._fly(transition)

    def adopt(self, arrangement: Arrangement, transition: Transition) -> None:
        """Change to another arrangement, along a planned transition."""
        self.arrangement, self.goal_m, self._late_s = arrangement, transition.goal_m, 0.0
        self._fly(transition)

    def _fly(self, transition: Transition) -> None:
        self._transition, self._over_s, self._rest = transition, transition.at_s + transition.duration_s, None
        self.alongside, self._any_alongside = np.zeros_like(self.alongside), False

    def wait(self, pace: float, elapsed_s: float) -> None:
        """Move all slots at a share `pace` of their planned speed from now on; `elapsed_s`: since the last call.

        Slowed down together they keep the planned distances. Once they are `WAITS_S` late they wait no longer: a
        vehicle that can't reach a slot far outside a turn can reach the one that the slot moves to.
        """
        if self._late_s >= WAITS_S:
            pace = 1.0
        if pace < 1.0:
            late_s = (1.0 - pace) * elapsed_s
            self._transition, self._over_s = (
                replace(self._transition, at_s=self._transition.at_s + late_s),
                self._over_s + late_s,
            )
            self._late_s += late_s
        self._pace = pace

    def fly_alongside(self, which: Mask, position_m: Array) -> None:
        """Let the vehicles in a mask (C,) fly alongside the leader, from positions (C, 3), until the next change."""
        self._alongside_m = np.where(self.alongside[:, None], self._alongside_m, position_m)
        self.alongside = self.alongside | which
        self._any_alongside = bool(self.alongside.any())

    def at_rest(self, now_s: float) -> bool:
        """Return whether all slots are at rest from a time on."""
        return now_s >= self._over_s and not self._any_alongside

    def separation_m(self, now_s: float) -> Array | None:
        """Return the minimum planned distances of slots (C, C) while they move; None once all rest in the arrangement.

        Without a planned motion, as for vehicles alongside the leader, they are those of the arrangement. The array is
        the same object for as long as nothing changes.
        """
        if self.settled(now_s):
            return None
        planned_m = self._transition.separation_m if now_s < self._over_s else None
        if self._separation_m is None or planned_m is not self._planned_m or self._separation_of is not self.goal_m:
            self._planned_m, self._separation_of = planned_m, self.goal_m
            separation_m = np.linalg.norm(self.goal_m[:, None] - self.goal_m, axis=-1)
            self._separation_m = separation_m if planned_m is None else np.minimum(separation_m, planned_m)
        return self._separation_m

    def settled(self, now_s: float) -> bool:
        """Return whether all slots are at rest in the arrangement."""
        if not self.at_rest(now_s):
            return False
        return self._transition.goal_m is self.goal_m or np.array_equal(self._transition.goal_m, self.goal_m)
