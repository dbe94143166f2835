"""Vehicles that have taken off join up behind the leader, before the path begins."""

from __future__ import annotations

from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after
from formation_scenario import Scenario
from formation_scenario.formation_changes import ahead, plan_joining_up
from formation_scenario.slot_motion import Transition
from formation_scenario.transition_plan import NotFlyableError
from gcs_formation.controller.controller import FormationController
from gcs_formation.mission.presence import Presence
from gcs_formation.recorder import LogEvent

JOINS_LATE_S: Final = 30.0
"""Time without trajectories to the slots after which that is reported."""
JOINED_M: Final = 300.0
"""Vehicles this near the leader count as having taken off with it; the law leads others to their slots."""


class JoiningUp:
    """Leads newly joined vehicles to their slots, clear of each other and of those that joined before.

    Where no trajectories cross, the law does this alone. Until a transition is found, vehicles fly alongside the
    leader.
    """

    def __init__(self, controller: FormationController, presence: Presence, log_event: LogEvent) -> None:
        """Plan for the formation that `controller` flies."""
        self._controller, self._presence, self._log_event = controller, presence, log_event
        self._late_at: Instant | None = None
        """When to report that vehicles still can't join up; None while they aren't about to."""

    def plan(self, scenario: Scenario, now: Instant) -> None:
        """Plan trajectories to their slots for the vehicles that have returned near the leader, which has a route.

        Args:
            scenario: at the speed that is flown.
            now: when they begin.
        """
        controller, plan = self._controller, self._controller.plan
        route, guidance = controller.guidance.route, controller.guidance
        if route is None:
            return
        present, positions_m = self._presence.present(), controller.positions_m(now) - plan.offset_m
        returned, near = self._presence.returned(), np.hypot(positions_m[:, 0], positions_m[:, 1]) <= JOINED_M
        plan.fly_alongside(returned & near & ~plan.alongside, positions_m)
        start = plan.at(now / NANOSECONDS, begun=True).standing(returned & ~near, plan.goal_m)
        course = ahead(route, guidance.speed_mps, guidance.distance_m)
        try:
            transition = plan_joining_up(scenario, start, plan.goal_m, plan.leader, now / NANOSECONDS, course, present)
        except NotFlyableError as error:
            self._report_late(str(error), now)
            return
        self._late_at = None
        if transition is not None or plan.alongside.any():
            plan.adopt(plan.arrangement, transition or Transition.standing(plan.goal_m))
        self._presence.planned_for = present.tolist()
        if transition is not None:
            text = "joins up clear of the others' trajectories"
            self._log_event(now, "gathering", text, None, {"duration_s": transition.duration_s})

    def _report_late(self, why: str, now: Instant) -> None:
        """Report, once in `JOINS_LATE_S`, why vehicles still fly alongside the leader: the path doesn't begin so."""
        if self._late_at is None:
            self._late_at = after(now, JOINS_LATE_S)
        elif now >= self._late_at:
            self._late_at = after(now, JOINS_LATE_S)
            self._log_event(
                now, "postponed", f"no trajectories to the slots yet; they are tried again every second: {why}"
            )
