"""Who flies in the formation, decided anew at every tick, and what those who don't are told instead."""

from __future__ import annotations

import math
from collections.abc import Mapping

from airlink.clock import Instant
from airlink.identity import VehicleId
from formation_scenario import Scenario
from gcs_formation.estimation.estimator import StateEstimator
from gcs_formation.loitering import loiter_heights
from gcs_formation.membership import Member, following
from gcs_formation.records import Note
from gcs_formation.vehicle.vehicle import Vehicle


class Roster:
    """The vehicles' places in the formation."""

    def __init__(
        self, scenario: Scenario, vehicles: Mapping[VehicleId, Vehicle], columns: Mapping[VehicleId, int], note: Note
    ) -> None:
        """Judge `vehicles`, the leader first; `columns` are theirs in the estimator."""
        self._law = scenario.law
        self._vehicles = vehicles
        self._columns = columns
        self._note = note

    def judge(self, estimator: StateEstimator, now: Instant, *, connecting: bool) -> None:
        """Decide who flies in the formation: without its leader, nobody does once that has been there."""
        led = True
        for identity, vehicle in self._vehicles.items():
            fresh = led and self._is_fresh(vehicle, estimator, now)
            member = following(vehicle.member, vehicle.sight(now, fresh=fresh))
            if member is not vehicle.member:
                vehicle.member = member
                self._note(now, "member", member.value, vehicle)
                self._tell(vehicle, now)
            if self._columns[identity] == 0:
                led = member is Member.FLYING or connecting

    def _is_fresh(self, vehicle: Vehicle, estimator: StateEstimator, now: Instant) -> bool:
        if vehicle.beyond_margin and self._law.on_delay == "hold":
            return False
        age_s = estimator.age_s(self._columns[vehicle.identity], now)
        return math.isnan(age_s) or age_s <= self._law.max_age_s

    def _tell(self, vehicle: Vehicle, now: Instant) -> None:
        autopilot = vehicle.autopilot
        if vehicle.member is Member.HOLDING:
            vehicle.commands.begin(autopilot.loiter(self._holding_height_m(vehicle)), now)
        elif vehicle.member is Member.RETURNING:
            vehicle.commands.begin((autopilot.set_mode(autopilot.guided_mode),), now)
        elif vehicle.member is not Member.STARTING:
            vehicle.commands.begin((), now)

    def _holding_height_m(self, vehicle: Vehicle) -> float:
        """Return the height at which a vehicle loiters apart from the others, wherever they are."""
        places = {i: v.telemetry.motion for i, v in self._vehicles.items() if v.telemetry.motion}
        return loiter_heights(places)[vehicle.identity]
