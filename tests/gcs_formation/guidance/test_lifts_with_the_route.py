"""Lifts of slots along a leader's route: where they begin, how steep they are, and how they go on onto another."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.path_offsets import TRIFLE_M
from formation_scenario import load_scenario
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import Hills
from gcs_formation.guidance.join_route import JoinRoute, Leg
from gcs_formation.guidance.slot_clearance import SlotClearance, TrackAhead
from gcs_formation.guidance.slots import FormationPlan
from tests.flights.conftest import scenario
from tests.gcs_formation.guidance.test_slot_clearance import (
    BOUNDS,
    CLEARANCE_M,
    SLOTS,
    SPEED_MPS,
    TICK_M,
    TOPS_M,
    Flight,
    Seen,
    straight,
)


@pytest.mark.parametrize(("slope", "steepest_up", "steepest_down"), [(0.04, 0.07, 0.15), (-0.04, 0.15, 0.07)])
def test_route_and_lift_together_are_as_steep_as_they_may_be(
    slope: float, steepest_up: float, steepest_down: float
) -> None:
    """Over a hill that is steeper than the bound of 0.11 on both of its sides."""
    ground = Hills(0.0, [Hill(north_m=1460.0, east_m=float(SLOTS[1, 1]), height_m=120.0, radius_m=150.0)])
    begin_m = 130.0 - 1460.0 * slope
    route = JoinRoute((Leg(PathPoint(0.0, 0.0, begin_m, 0.0), 3000.0, 0.0),), begin_m, begin_m + 3000.0 * slope, 0.04)
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")
    leader = FlightState(0.0, 0.0, begin_m, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    plan = FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(route, leader, 0, 0.0, SPEED_MPS, lambda _: SLOTS, plan), [0.0, 0.0])
    slopes = [offsets.offsets([at_m, at_m])[1][1] for at_m in np.arange(900.0, 2400.0, 5.0).tolist()]
    assert max(slopes) == pytest.approx(steepest_up, abs=1e-4)
    assert min(slopes) == pytest.approx(-steepest_down, abs=1e-4)


def test_on_another_route_a_lift_that_is_needed_no_more_bends_down_from_the_next_step_on() -> None:
    """It rises by a tenth and bends upwards where the route changes; 20 to 40 m farther it bends as it may."""
    flight = Flight()
    flight.on(1300.0)
    _, slope, curvature = flight.offsets_m.offsets([flight.at_m] * 2)[1]
    assert slope > 0.09
    assert curvature > 1e-5
    flight.take_route()
    flight.slots_m = flight.slots_m + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 80.0]])
    flight.on(TICK_M)
    bends = [flight.offsets_m.offsets([flight.at_m + each] * 2)[1][2] for each in (40.0, 60.0, 80.0, 100.0)]
    assert bends == pytest.approx([-BOUNDS.curvature_1pm] * 4)


def test_a_flight_that_begins_over_a_hill_begins_at_its_clearance() -> None:
    """Nothing was flown before that it would have to go on from."""
    flight = Flight()
    flight.at_m = TOPS_M[0]
    flight.on(TICK_M)
    assert flight.missing_m() <= TRIFLE_M


@pytest.mark.parametrize(("at_m", "begins_m"), [(93.0, 40.0), (100.0, 60.0), (-93.0, -140.0), (-100.0, -140.0)])
def test_lifts_begin_at_a_step_forty_to_sixty_metres_behind_before_a_paths_start_too(
    at_m: float, begins_m: float
) -> None:
    ground = Seen()
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")  # type: ignore[arg-type]
    leader = FlightState(at_m, 0.0, 70.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    plan = FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(straight(), leader, 0, at_m, SPEED_MPS, lambda _: SLOTS, plan), [at_m, at_m])
    north, _ = ground.places[0]
    assert north[0, 0] == pytest.approx(begins_m)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_slot_farther_ahead_than_a_turns_radius_still_has_a_place(side: float) -> None:
    """None could fly along the turn's circle there, whatever it heads; it is looked at as almost at right angles."""
    ground = Seen()
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "follower_heading")  # type: ignore[arg-type]
    route = JoinRoute((Leg(PathPoint(0.0, 0.0, 70.0, 0.0), 1e5, side / 50.0),), 70.0, 70.0, 0.1)
    leader = FlightState(0.0, 0.0, 70.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    slots_m, plan = np.array([[0.0, 0.0, 0.0], [90.0, 0.0, 0.0]]), FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(route, leader, 0, 100.0, SPEED_MPS, lambda _: slots_m, plan), [100.0, 100.0])
    north, east = ground.places[0]
    assert np.hypot(north[1] - north[0], east[1] - east[0]) == pytest.approx(np.full(561, 90.0))


def test_a_leaders_nose_is_turned_into_a_wind_on_any_course() -> None:
    """Eastwards in 11 m/s to the north, half of its airspeed: 30 degrees to the right, and its slots with it."""
    ground = Seen()
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")  # type: ignore[arg-type]
    route = JoinRoute((Leg(PathPoint(0.0, 0.0, 70.0, math.pi / 2), 1e5, 0.0),), 70.0, 70.0, 0.1)
    leader = FlightState(0.0, 0.0, 70.0, 0.0, SPEED_MPS, 0.0, 11.0, 0.0)
    slots_m, plan = np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0]]), FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(route, leader, 0, 100.0, SPEED_MPS, lambda _: slots_m, plan), [100.0, 100.0])
    north, east = ground.places[0]
    assert north[1] - north[0] == pytest.approx(np.full(561, -50.0 * math.sqrt(3.0)))
    assert east[1] - east[0] == pytest.approx(np.full(561, -50.0))


class Counted(JoinRoute):
    """A route that counts for how many distances it was asked."""

    asked = 0

    def at(self, distance_m: float) -> PathPoint:
        self.asked += 1
        return super().at(distance_m)


def test_a_routes_points_are_asked_for_once_and_another_routes_are_its_own() -> None:
    """900 m farther on, 180 more of 5 m each; the other route lies 300 m to the right."""
    ground = Seen()
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")  # type: ignore[arg-type]
    one, other = (
        Counted((Leg(PathPoint(0.0, east_m, 70.0, 0.0), 1e5, 0.0),), 70.0, 70.0, 0.1) for east_m in (0.0, 300.0)
    )
    leader, plan = FlightState(0.0, 0.0, 70.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0), FormationPlan(load_scenario(scenario()))
    for route, at_m, asked in ((one, 100.0, 561), (one, 200.0, 561), (one, 1000.0, 741), (other, 1100.0, 561)):
        ahead = TrackAhead(route, leader, 0, at_m, SPEED_MPS, lambda _: SLOTS, plan.arrangement)
        offsets.look_ahead(ahead, [at_m, at_m])
        north, east = ground.places[-1]
        assert north[0, 0] == pytest.approx(at_m - 40.0)
        assert east[0] == pytest.approx(np.full(north.shape[1], 300.0 if route is other else 0.0))
        assert route.asked == asked
