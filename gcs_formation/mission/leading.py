"""How a vehicle leads from where it is: its route onto the path, the slots' swing, and turns on the spot."""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink.clock import NANOSECONDS, Instant
from flight_model.flight_state import FlightState
from flight_model.path import Route
from formation_scenario import Scenario
from formation_scenario.formation_changes import take_over
from gcs_formation.controller.controller import FormationController
from gcs_formation.guidance.tracking import Abreast
from gcs_formation.guidance.turn_on_spot import TurnOnSpot
from gcs_formation.vehicle.vehicle import Vehicle
from gcs_formation.vehicle.velocity_setpoint import ground_motion

Takeover = tuple[Route | None, float, float]
"""How a vehicle can lead from where it is: see `Leading.take_over`."""


class Leading:
    """Plans how vehicles take over the lead, for the controller to fly."""

    def __init__(self, controller: FormationController, by_index: Mapping[int, Vehicle], scenario: Scenario) -> None:
        """Take the vehicles by their indices."""
        self._controller, self._by_index = controller, by_index
        self._ground, self._hovers = scenario.ground, scenario.hovers
        self._slots_turn = scenario.formation.slots_turn

    def turn_on_spot(self, heading_rad: float, from_rad: float, now: Instant) -> None:
        """Turn a leader that hovers from a heading to another."""
        controller, models = self._controller, self._controller.models
        reach_m = controller.plan.at(now / NANOSECONDS, begun=True).reach_m
        reach_m = reach_m if self._slots_turn else 0.0
        limits = min(each.speed_max_mps for each in models), min(each.accel_max_mps2 for each in models)
        controller.guidance.turn = TurnOnSpot.to(heading_rad, from_rad, now, reach_m, *limits)

    def path_deg(self) -> float:
        """Return the course of its route where it is, 0 to 360 degrees."""
        guidance = self._controller.guidance
        course_rad = 0.0 if guidance.route is None else guidance.route.at(guidance.distance_m).course_rad
        return math.degrees(course_rad) % 360.0

    def lead_standing(self, leader: int, now: Instant) -> None:
        """Take the slots' axis from a new multirotor leader's yaw; in hover, turn it to the formation's heading."""
        guidance, known = self._controller.guidance, self._controller.estimator.filters[leader]
        if not self._hovers or known.state is None:
            return
        seen = known.state.copy()
        seen.airspeed_mps, seen.heading_rad = self._as_leader(leader, seen)
        known.place(seen, known.stamp)
        if guidance.speed_mps == 0.0:
            facing_rad = math.radians(self.path_deg()) if guidance.turn is None else guidance.turn.goal_rad
            self.turn_on_spot(facing_rad, seen.heading_rad, now)

    def _as_leader(self, index: int, state: FlightState) -> tuple[float, float]:
        """Return the speed and heading that a vehicle in `state` has as a leader."""
        vehicle = self._by_index[index]
        attitude = vehicle.telemetry.attitude
        if not self._hovers or attitude is None:
            return state.airspeed_mps, state.heading_rad
        return ground_motion(attitude.yaw_rad, *state.ground_mps(), leads=True)

    def take_over(self, leader: int, scenario: Scenario, now: Instant) -> Takeover:
        """Return how a vehicle can lead from where it is: by a route onto the path, from a distance along that, m.

        The route is None before the path has begun. Third: the vehicle's heading relative to the present leader's, rad,
        by which the slots swing. `scenario`: at the speed that is flown.
        """
        controller, guidance = self._controller, self._controller.guidance
        tick = controller.last_tick
        if tick is None:
            return None, 0.0, 0.0
        state, before = tick.state[leader], tick.state[controller.plan.leader]
        swing_rad = math.remainder(self._as_leader(leader, state)[1] - before.heading_rad, math.tau)
        swing_rad = swing_rad if self._slots_turn else 0.0
        if not guidance.started:
            return None, 0.0, swing_rad
        slots = controller.plan.seen_from(leader, swing_rad, now / NANOSECONDS)
        distance_m, point = guidance.abreast(state.north_m, state.east_m)
        right_m, up_m = point.lateral_and_up_m(state.north_m, state.east_m, state.height_m)
        abreast, commanded_m = Abreast(point, right_m, up_m), tick.setpoints[leader][2]
        if math.isnan(commanded_m):  # it loiters
            commanded_m = state.height_m
        above = abreast.rise(state, commanded_m, controller.models[leader], guidance.speed_mps)
        lateral = 0.0 if guidance.pauses else abreast.lateral_slope(state)  # at a stop it comes to rest first
        path, reach_m = guidance.path, slots.reach_m
        route = take_over(scenario, path, distance_m, right_m, above, reach_m, self._ground, right_slope=lateral)
        return route, distance_m, swing_rad
