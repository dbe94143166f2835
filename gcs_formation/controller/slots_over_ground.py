"""Slots at the instants when setpoints act, raised clear of the ground."""

from __future__ import annotations

from airlink.clock import NANOSECONDS, Instant, after
from flight_model.arrays import Array
from flight_model.slot import Slot
from formation_scenario import Scenario
from formation_scenario.slot_motion import SlotMotion
from gcs_formation import from_scenario
from gcs_formation.control.law_interface import Lead
from gcs_formation.estimation.projection import States
from gcs_formation.guidance.leader_guidance import LeaderGuidance
from gcs_formation.guidance.slot_clearance import TrackAhead
from gcs_formation.guidance.slots import FormationPlan
from gcs_formation.recorder import Tick


class SlotsOverGround:
    """The plan's slots, with their offsets over terrain if the scenario has any."""

    def __init__(self, scenario: Scenario, plan: FormationPlan, guidance: LeaderGuidance) -> None:
        """Begin without offsets."""
        self._plan, self._guidance = plan, guidance
        self._count = 1 + len(scenario.followers)
        self._clearance = from_scenario.slot_clearance(scenario)
        self.terrain_offset_m = [0.0] * self._count
        """By how much each slot commanded last is raised, m."""

    def planned(self, now: Instant, mission_time_s: float) -> SlotMotion:
        """Return the slots as planned for an instant."""
        return self._plan.at(now / NANOSECONDS, begun=mission_time_s >= 0)

    def at(self, tick: Tick, states: States, lead: Lead) -> tuple[list[Slot], list[Slot]]:
        """Return the slots at the instants when setpoints act, clear of the ground, and the slots commanded now."""
        slots, route = self.planned(tick.now, tick.mission_time_s), self._guidance.route
        later, earliest = slots, int(tick.now)
        for index in range(self._count):
            earliest = min(earliest, states.instant(index))
        rests = self._plan.at_rest(earliest / NANOSECONDS)
        if rests and (self._clearance is None or route is None):
            return slots.each, slots.each
        instants = [states.instant(index) for index in range(self._count)]
        if not rests:
            later = self._plan.at_each([each / NANOSECONDS for each in instants], begun=tick.mission_time_s >= 0)
        if self._clearance is None or route is None:
            return later.each, slots.each

        def ahead(seconds: float) -> Array:
            return self.planned(after(tick.now, seconds), tick.mission_time_s).position_m

        along_mps, arranged = lead.path.along_mps, self._plan.arrangement
        leader = states.of(tick.leader, tick.leader)
        outlook = TrackAhead(route, leader, tick.leader, self._guidance.distance_m, along_mps, ahead, arranged)
        at_m = [outlook.distance_m + along_mps * ((each - lead.at) / NANOSECONDS) for each in instants]
        self._clearance.look_ahead(outlook, at_m)
        now_m = outlook.distance_m - along_mps * ((lead.at - tick.now) / NANOSECONDS)
        self.terrain_offset_m = [offset_m for offset_m, _, _ in self._clearance.offsets([now_m] * self._count)]
        commanded = [slot.raised(up_m, 0.0, 0.0) for slot, up_m in zip(slots.each, self.terrain_offset_m, strict=True)]
        return self._clearance.raised(later.each, at_m, along_mps), commanded
