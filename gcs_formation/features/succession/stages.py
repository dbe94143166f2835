# Compiled by mypyc: it runs every tick.

"""The stage that replaces a lost leader."""

from __future__ import annotations

import math
from collections.abc import Callable

from flight_model.flight_state import FlightState
from gcs_formation.core.cycle import Cycle, Stage
from gcs_formation.features.succession.candidates import Candidate, best_successor, can_lead
from gcs_formation.fleet.membership import SUCCESSION_S
from gcs_formation.phases import Phase
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.vehicle import Vehicle


class Succession(Stage):
    """Lets a follower lead when the leader is lost, before it is decided who flies in the formation behind it."""

    name = "succession"
    after = ("estimates", "motion_seen")

    def run(self, cycle: Cycle) -> None:
        """Replace the leader if it is lost and another can lead."""
        leader, phase = cycle.reconfiguration.leader, cycle.flight.phase
        if leader is None or phase is Phase.CONNECTING or phase is Phase.LOITERING:
            return

        def replaceable() -> bool:
            return successor(cycle) is not None

        if not is_lost(leader, cycle, replaceable):
            return
        if _comes_back(leader, cycle) and cycle.membership.order_may_come(leader, cycle.now):
            return  # it is about to: a command to loiter has reached it late
        index = successor(cycle)
        if index is None:
            index = successor(cycle, among=_comes_back)
        if index is not None:
            cycle.reconfiguration.replace_leader(index, cycle.now)


def is_lost(leader: Vehicle, cycle: Cycle, replaceable: Callable[[], bool]) -> bool:
    """Judge the leader alone; return whether it is lost, sooner if it can be replaced, and then if it sinks, too."""
    membership, estimator, now, beyond = cycle.membership, cycle.controller.estimator, cycle.now, cycle.findings.beyond
    fresh = membership.is_fresh(leader, estimator, beyond, now)
    late = not membership.is_fresh(leader, estimator, beyond, now, SUCCESSION_S)
    membership.judge_one(leader, estimator, now, fresh=fresh and not (late and replaceable()))
    sinks = leader.identity in cycle.findings.sinking
    return leader.member is not Member.FLYING or (sinks and replaceable())


def _flies(vehicle: Vehicle, _: Cycle) -> bool:
    return vehicle.member is Member.FLYING


def _comes_back(vehicle: Vehicle, cycle: Cycle) -> bool:
    """Return whether a vehicle loiters for no reason of its own: it comes back as soon as it leads, or is led."""
    loiters = vehicle.member is Member.HOLDING or vehicle.member is Member.RETURNING
    estimator, beyond = cycle.controller.estimator, cycle.findings.beyond
    return loiters and cycle.membership.is_fresh(vehicle, estimator, beyond, cycle.now)


def successor(cycle: Cycle, among: Callable[[Vehicle, Cycle], bool] = _flies) -> int | None:
    """Return the index of the follower that is to take over, None if none can; sinking ones can't.

    `among`: whether a vehicle is asked at all; by default those that fly in the formation.
    """
    tick, leader, now = cycle.controller.last_tick, cycle.controller.plan.leader, cycle.now
    if cycle.scenario.formation.succession == "none" or tick is None:
        return None
    age_s, leads, sinking = cycle.controller.estimator.age_s, tick.state[leader], cycle.findings.sinking
    candidates = [
        Candidate.of(each.index, each, _distance_m(tick.state[each.index], leads))
        for each in cycle.each
        if each.index != leader and each.identity not in sinking and among(each, cycle)
        if can_lead(each, age_s(each.index, now), now)
    ]
    return best_successor(candidates, cycle.controller.plan.arrangement.spacing_m)


def _distance_m(one: FlightState, other: FlightState) -> float:
    return math.hypot(one.north_m - other.north_m, one.east_m - other.east_m, one.height_m - other.height_m)
