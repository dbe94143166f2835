"""Changes of the formation in flight: planned, ordered, and behind another leader."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import VehicleId
from flight_model.path import Route
from formation_scenario import Scenario
from formation_scenario import Vehicle as PlannedVehicle
from formation_scenario.expectation import LATE_PERIODS, UNJUDGED_GAP_S
from formation_scenario.feasibility import check_ahead
from formation_scenario.formation import FormationChange
from formation_scenario.formation_changes import ahead, plan_change
from formation_scenario.orders import not_standing, why_not_set_out
from formation_scenario.slot_assignment import Arrangement, SlotStep, assigned, names_by_index
from formation_scenario.slot_motion import SlotMotion, Transition
from formation_scenario.transition_plan import NotFlyableError
from gcs_formation.controller.controller import FormationController
from gcs_formation.mission.joining_up import JoiningUp
from gcs_formation.mission.leading import Leading, Takeover
from gcs_formation.mission.past_flight import PastFlight
from gcs_formation.mission.presence import Presence
from gcs_formation.recorder import LogEvent
from gcs_formation.vehicle.vehicle import Vehicle

TRY_AGAIN_S: Final = 1.0
"""Interval between attempts at a change that can't be flown from the formation's present position."""
CENTRAL: Final = 2.0
"""Vehicles within this multiple of the farthest slot's distance from the leader count as within the formation."""


class Reconfiguration:
    """Plans changes for the controller to fly."""

    def __init__(
        self,
        scenario: Scenario,
        controller: FormationController,
        vehicles: dict[VehicleId, Vehicle],
        log_event: LogEvent,
    ) -> None:
        """Change the formation that `controller` flies."""
        self._scenario = scenario
        self._controller = controller
        self._by_index = {vehicle.index: vehicle for vehicle in vehicles.values()}
        self._names = names_by_index(scenario)
        self._log_event = log_event
        self._wanted: Arrangement | None = None
        self._next_try = Instant(0)
        self._postponed: Arrangement | None = None
        self._postponed_for = ""
        """Reason for the postponement, in words."""
        self._changing = ""
        """The last change of the arrangement, in words; "" once vehicles return to it after its end."""
        self._late_s = 0.0
        """By how much late ticks delayed the beginning of what was planned last, s."""
        self._presence = Presence(self._by_index, controller.plan, len(self._names))
        self._joining_up = JoiningUp(controller, self._presence, log_event)
        self._leading = Leading(controller, self._by_index, scenario)

    @property
    def leader(self) -> Vehicle | None:
        """The leading vehicle, None for a virtual leader."""
        return self._by_index.get(self._controller.plan.leader)

    @property
    def _flown(self) -> Scenario:
        """The scenario at the speed that is planned where the leader is."""
        guidance = self._controller.guidance
        return self._scenario.at_speed(guidance.speed_mps) if guidance.follows_plan else self._scenario

    @property
    def unflown(self) -> list[str]:
        """The planned change that is still postponed, with the reason; empty if there is none."""
        wanted = self._wanted
        if wanted is None or wanted == self._controller.plan.arrangement:
            return []
        return [f"the change to {self._in_words(wanted)} wasn't flown: {self._postponed_for}"]

    @property
    def left(self) -> list[str]:
        """The scenario's changes that haven't begun, in words."""
        over = "wasn't flown: the flight was over"
        return [f"the change of the formation at {each.at_s:g} s {over}" for each in self._controller.plan.scheduled]

    def under_way(self, ended: Instant | None) -> list[str]:
        """The change whose slots hadn't come to rest at an instant, in words; empty if there was none.

        A late tick that delayed its beginning doesn't count against it.
        """
        if ended is None or not self._changing:
            return []
        still = not self._controller.plan.at_rest(ended / NANOSECONDS + self._late_s)
        return [f"the change to {self._changing} was under way when the flight was over"] if still else []

    def record_lateness(self, late_s: float) -> None:
        """Take by how much what was planned begins late; up to a period it's on time, beyond `UNJUDGED_GAP_S` not."""
        missed = late_s >= LATE_PERIODS / self._scenario.law.rate_hz
        self._late_s = late_s if missed and late_s <= UNJUDGED_GAP_S else 0.0

    def plan_with(self, vehicles: tuple[PlannedVehicle, ...]) -> None:
        """Judge changes and orders from now on by the scenario's vehicles with the limits that they have reported."""
        self._scenario = self._scenario.model_copy(update={"vehicles": vehicles})

    def resume(self, resumed: PastFlight) -> None:
        """Resume an interrupted flight; on the path, each vehicle moves to its slot from where it is found."""
        guidance = self._controller.guidance
        self._controller.plan.resume(self._scenario, resumed.arrangement, resumed.slots_m, resumed.mission_s)
        if resumed.speed_mps != self._scenario.path.begin_mps:
            self._scenario = self._scenario.at_speed(resumed.speed_mps)
        centroid_m = None if resumed.path_began is None else resumed.reach_m
        guidance.resume(resumed.speed_mps, resumed.at, resumed.heading_rad, centroid_m)
        self._presence.plan_behind(resumed.arrangement.leader)

    def lead(self, vehicle: VehicleId, now: Instant) -> None:
        """Make a vehicle the leader from the beginning."""
        leader = next(index for index, each in self._by_index.items() if each.identity == vehicle)
        if leader != self._controller.plan.leader:
            self._controller.hand_over(leader, 0.0)
            self._presence.plan_behind(leader)
            self._log_event(now, "leader", "leads the formation", self._by_index[leader])

    def advance(self, now: Instant, mission_time_s: float) -> None:
        """Begin the planned change that is due; if it can't be flown, try again later.

        A transition planned without an absent vehicle is planned again when that vehicle is back. Before the path
        begins, vehicles join one after another.
        """
        plan = self._controller.plan
        if plan.scheduled and mission_time_s >= plan.scheduled[0].at_s:
            self.record_lateness(mission_time_s - plan.scheduled[0].at_s)
            self._want((self._wanted or plan.arrangement).changed(plan.scheduled.popleft(), self._scenario), now)
        if self._wanted is None and self._presence.somebody_returned():
            if math.isnan(mission_time_s):
                if self._controller.guidance.route is not None and now >= self._next_try:
                    self._next_try = after(now, TRY_AGAIN_S)
                    self._joining_up.plan(self._flown, now)
                return
            self._want(plan.arrangement, now)
        if self._wanted is None or now < self._next_try:
            return
        self._next_try = after(now, TRY_AGAIN_S)
        try:
            self.change(self._wanted, now)
        except NotFlyableError as error:
            if self._postponed != self._wanted:
                self._postponed, self._postponed_for = self._wanted, str(error)
                self._log_event(now, "postponed", f"the change is tried again: {error}")

    def change(self, wanted: Arrangement, now: Instant) -> None:
        """Begin a change.

        Raises:
            NotFlyableError: it can't be flown from here; nothing has changed.
        """
        plan = self._controller.plan
        changes, passes_on = wanted != plan.arrangement, wanted.leader != plan.leader
        present = self._presence.present().tolist()
        transition, taken = self._planned(wanted, now)
        if passes_on:
            self._hand_over(wanted.leader, *taken, now)
        if changes:
            self._changing = self._in_words(wanted)
        elif plan.at_rest(now / NANOSECONDS):
            self._changing = ""
        plan.adopt(wanted, transition)
        self._wanted, self._presence.planned_for = None, present
        self._log_event(now, "formation", self._in_words(wanted), None, {"duration_s": transition.duration_s})

    def _planned(self, wanted: Arrangement, now: Instant) -> tuple[Transition, Takeover]:
        """Return the transition to an arrangement, and how its leader takes over; nothing changes.

        Raises:
            NotFlyableError: it can't be flown from here.
        """
        controller, present = self._controller, self._presence.present()
        passes_on = wanted.leader != controller.plan.leader
        route, distance_m, swing_rad = controller.guidance.route, controller.guidance.distance_m, 0.0
        if passes_on:
            if not present[wanted.leader]:
                found = f"{self._names[wanted.leader]} doesn't fly in the formation"
                raise NotFlyableError(found, "a vehicle that does", 0.0)
            turn = controller.guidance.turn
            if turn is not None and not turn.over(now):
                raise NotFlyableError("the formation turns on the spot", "another leader once it hovers", 0.0)
            route, distance_m, swing_rad = self._take_over(wanted.leader, now)
        start = self._slots(now).seen_from(wanted.leader, swing_rad)
        if route is None:
            raise NotFlyableError("the leader isn't on its way yet", "a change in flight", 0.0)
        course = ahead(route, controller.guidance.speed_mps, distance_m)
        transition = plan_change(self._flown, start, wanted, now / NANOSECONDS, course, present)
        return transition, (route, distance_m, swing_rad)

    def order_change(self, change: FormationChange, now: Instant) -> str | None:
        """Begin an ordered change; return why its slots can't be flown, None if it has begun.

        Raises:
            NotFlyableError: the transition to its slots can't be flown.
            ValueError: it names a vehicle that doesn't exist.
        """
        wanted = self._changed(change)
        refusal = self._why_not(wanted, now)
        if refusal is None:
            self.change(wanted, now)
        return refusal

    def why_not_change(self, change: FormationChange, now: Instant) -> str | None:
        """Return why an ordered change can't be flown from here, None if it can.

        Raises:
            NotFlyableError: the transition to its slots can't be flown.
            ValueError: it names a vehicle that doesn't exist.
        """
        wanted = self._changed(change)
        refusal = self._why_not(wanted, now)
        if refusal is None:
            self._planned(wanted, now)
        return refusal

    def _changed(self, change: FormationChange) -> Arrangement:
        return (self._wanted or self._controller.plan.arrangement).changed(change, self._scenario)

    def _why_not(self, wanted: Arrangement, now: Instant) -> str | None:
        if wanted.leader != self._controller.plan.leader and self.leader is None:
            return "a virtual leader flies the path; allowed: shape, spacing, speed, loiter, rtl, land"
        return self._unflyable(self._scenario, wanted, now)

    def order_speed(self, speed_mps: float, now: Instant) -> str | None:
        """Fly at another speed; return why it can't be flown, None if it is."""
        refusal = self.why_not_speed(speed_mps, now)
        if refusal is None:
            self._scenario = self._scenario.at_speed(speed_mps)
            self._controller.guidance.fly_at(speed_mps)
        return refusal

    def why_not_speed(self, speed_mps: float, now: Instant) -> str | None:
        """Return why another speed can't be flown from here, None if it can."""
        turn, refusal = self._controller.guidance.turn, None
        if turn is not None and speed_mps > 0.0:
            refusal = why_not_set_out(turn.goal_rad, math.radians(self._leading.path_deg()))
        if refusal is None:
            wanted = self._wanted or self._controller.plan.arrangement
            refusal = self._unflyable(self._scenario.at_speed(speed_mps), wanted, now)
        return refusal

    def order_heading(self, heading_rad: float, now: Instant) -> str | None:
        """Turn on the spot to a heading; return why that can't be done, None if it is."""
        controller, refusal = self._controller, self.why_not_heading()
        if refusal is None and controller.last_tick is not None:
            leader = controller.last_tick.state[controller.plan.leader]
            self._leading.turn_on_spot(heading_rad, controller.guidance.facing_rad(leader), now)
        return refusal

    def why_not_heading(self) -> str | None:
        """Return why the formation can't turn on the spot, None if it can."""
        guidance = self._controller.guidance
        if not self._scenario.hovers:
            return "found vehicles that can't hover; allowed: of vehicles that hover"
        if guidance.speed_mps > 0.0 or self._controller.last_tick is None or guidance.route is None:
            return not_standing(guidance.speed_mps)
        if guidance.pauses:
            return "found a stop of its path, which it leaves by itself; allowed: after the order speed 0"
        return None

    def replace_leader(self, leader: int, now: Instant) -> None:
        """Make another vehicle the leader at once; the others move to their slots behind it as soon as possible."""
        self._changing = ""  # a change behind the lost leader is void; the move behind another isn't planned
        self._hand_over(leader, *self._take_over(leader, now), now)
        self._want(self._wanted or self._controller.plan.arrangement, now)

    def _unflyable(self, scenario: Scenario, wanted: Arrangement, now: Instant) -> str | None:
        """Return why an arrangement can't be flown from here, in the words of `check`; None if it can."""
        guidance = self._controller.guidance
        slots = self._controller.plan.seen_from(wanted.leader, 0.0, now / NANOSECONDS)
        step = SlotStep(0.0, wanted, assigned(scenario, wanted, slots.position_m, self._presence.present()))
        leader = self._controller.estimator.filters[self._controller.plan.leader].state
        if leader is not None:
            scenario = scenario.in_wind(leader.wind_north_mps, leader.wind_east_mps)
        found = check_ahead(scenario, step, guidance.path, guidance.distance_m if guidance.on_path else 0.0)
        return found[0] if found else None

    def _want(self, arrangement: Arrangement, now: Instant) -> None:
        self._wanted, self._next_try = arrangement, now

    def _hand_over(self, leader: int, route: Route | None, distance_m: float, swing_rad: float, now: Instant) -> None:
        """Make another vehicle the leader, with what `_take_over` returned for it."""
        controller = self._controller
        controller.guidance.take_over(route, distance_m)
        controller.hand_over(leader, swing_rad)
        self._leading.lead_standing(leader, now)
        if self._wanted is not None:
            self._wanted = self._wanted._replace(leader=leader)
        self._log_event(now, "leader", "leads the formation", self._by_index[leader])

    def _take_over(self, leader: int, now: Instant) -> Takeover:
        """Return how a vehicle can lead from where it is."""
        flown = self._scenario if self._controller.guidance.pauses else self._flown
        return self._leading.take_over(leader, flown, now)

    def _slots(self, now: Instant) -> SlotMotion:
        """Return the present slots; a vehicle that returns within the formation has its slot where it is.

        From there the transition leads it to its goal, clear of the others. Vehicles that are farther away keep their
        assigned slots: the law leads them there, and the others don't wait.
        """
        slots, positions_m = self._controller.plan.at(now / NANOSECONDS, begun=True), self._controller.positions_m(now)
        central = np.hypot(positions_m[:, 0], positions_m[:, 1]) <= CENTRAL * slots.reach_m
        return slots.standing(self._presence.returned() & central, positions_m)

    def _in_words(self, wanted: Arrangement) -> str:
        return f"{wanted.shape}, {wanted.spacing_m:g} m, behind {self._names[wanted.leader]}"
