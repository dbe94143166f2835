"""Lifts of slots over hills: they are computed again only where those there are no longer serve."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.optimize

from flight_model.arrays import Array
from flight_model.flight_state import FlightState
from flight_model.path_offsets import TRIFLE_M, Bounds
from flight_model.spline import SplinePath
from formation_scenario import load_scenario
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import Hills
from gcs_formation.guidance.slot_clearance import ADVANCE_M, SlotClearance, TrackAhead
from gcs_formation.guidance.slots import FormationPlan
from tests.flights.conftest import scenario

SPEED_MPS, CLEARANCE_M, HEIGHT_M = 22.0, 60.0, 70.0
BEHIND_M, RIGHT_M = 60.0, 100.0
TICK_M = 10.0
SEEN_M = 1800.0
BOUNDS = Bounds(0.11, 1e-3)
TOPS_M = (1500.0, 3200.0, 4900.0)
"""North of the origin, beneath the follower's track in calm."""
SLOTS = np.array([[0.0, 0.0, 0.0], [-BEHIND_M, RIGHT_M, 0.0]])


def straight() -> SplinePath:
    """Return 9 km to the north at one height."""
    return SplinePath([[0.0, 0.0, HEIGHT_M], [9000.0, 0.0, HEIGHT_M]])


class Flight:
    """A leader that flies north at one height, with a follower behind to its right."""

    def __init__(self, up_m: float = 0.0) -> None:
        self.slots_m = SLOTS + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, up_m]])
        hills = [Hill(north_m=each, east_m=RIGHT_M, height_m=40.0, radius_m=250.0) for each in TOPS_M]
        self.ground = Hills(0.0, hills)
        self.offsets_m = SlotClearance(self.ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")
        self.take_route()
        self.plan = FormationPlan(load_scenario(scenario())).arrangement
        self.at_m = 0.0

    def take_route(self) -> None:
        """Fly along a new route, which lies where the one before did."""
        self._route = straight()

    def on(self, by_m: float, wind_east_mps: float = 0.0) -> None:
        """Fly on."""
        until_m = self.at_m + by_m
        while self.at_m < until_m:
            self.at_m += TICK_M
            leader = FlightState(self.at_m, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, wind_east_mps)
            ahead = TrackAhead(self._route, leader, 0, self.at_m, SPEED_MPS, lambda _: self.slots_m, self.plan)
            self.offsets_m.look_ahead(ahead, [self.at_m, self.at_m])

    def missing_m(self, wind_east_mps: float = 0.0) -> float:
        """Return by how much the follower would fly below its clearance at the worst place that is seen."""
        crab = math.asin(wind_east_mps / SPEED_MPS)
        sees = np.arange(self.at_m, self.at_m + SEEN_M, TICK_M / 2)
        north = sees - BEHIND_M * math.cos(crab) + RIGHT_M * math.sin(crab)
        east = np.full_like(sees, BEHIND_M * math.sin(crab) + RIGHT_M * math.cos(crab))
        offsets_m = [self.offsets_m.offsets([each, each])[1][0] for each in sees.tolist()]
        flown_m = HEIGHT_M + self.slots_m[1, 2] + np.array(offsets_m)
        return float((self.ground.height(north, east) + CLEARANCE_M - flown_m).max())


@pytest.fixture
def programmes(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Return a list that grows by one with each linear programme."""
    solved, solve = list[object](), scipy.optimize.milp
    monkeypatch.setattr(scipy.optimize, "milp", lambda *args, **more: (solved.append(args), solve(*args, **more))[1])
    return solved


def test_a_lift_in_steady_air_is_computed_for_kilometres_and_covers_what_is_ahead(programmes: list[object]) -> None:
    flight = Flight()
    for _ in range(40):
        flight.on(ADVANCE_M)
        assert flight.missing_m() <= TRIFLE_M
    assert 4 <= len(programmes) <= 6


def test_a_wind_that_puts_the_slot_above_other_ground_raises_it_again(programmes: list[object]) -> None:
    flight, wind_mps = Flight(), -8.0
    flight.on(200.0)
    assert flight.missing_m() <= TRIFLE_M
    assert flight.missing_m(wind_mps) > 1.0
    before = len(programmes)
    flight.on(ADVANCE_M, wind_mps)
    assert flight.missing_m(wind_mps) <= TRIFLE_M
    assert len(programmes) == before + 1


@pytest.mark.parametrize("up_m", [-8.0, 12.0])
def test_a_slot_above_its_leader_is_raised_by_as_much_less_and_one_below_by_as_much_more(up_m: float) -> None:
    flight = Flight(up_m)
    flight.on(900.0)
    assert flight.missing_m() <= TRIFLE_M
    top_m = TOPS_M[0] + BEHIND_M
    needed_m = 40.0 + CLEARANCE_M - HEIGHT_M - up_m
    assert flight.offsets_m.offsets([top_m] * 2)[1][0] == pytest.approx(needed_m, abs=0.5)


def test_a_slot_that_moves_is_raised_where_it_will_be() -> None:
    """It moves to the left by 5 m/s, and is above the first hill's top when it passes it."""
    flight, passes_s = Flight(), (TOPS_M[0] + BEHIND_M) / SPEED_MPS
    slots_m, leader = flight.slots_m, FlightState(0.0, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)

    def moving(later_s: float) -> Array:
        return slots_m + np.array([[0.0, 0.0, 0.0], [0.0, 5.0 * (passes_s - later_s), 0.0]])

    ahead = TrackAhead(straight(), leader, 0, 0.0, SPEED_MPS, moving, flight.plan)
    flight.offsets_m.look_ahead(ahead, [0.0, 0.0])
    at_m = np.arange(0.0, SEEN_M, TICK_M)
    slot_m = np.array([moving(each / SPEED_MPS)[1] for each in at_m.tolist()])
    needed_m = flight.ground.height(at_m + slot_m[:, 0], slot_m[:, 1]) + CLEARANCE_M - HEIGHT_M
    offsets_m = [flight.offsets_m.offsets([each, each])[1][0] for each in at_m.tolist()]
    assert max(needed_m) == pytest.approx(40.0 + CLEARANCE_M - HEIGHT_M, abs=0.5)
    assert max(needed_m - offsets_m) <= TRIFLE_M + 0.05
    assert max(offsets_m) < max(needed_m) + 1.0


def test_on_another_route_a_slot_goes_on_at_its_height_with_its_slope() -> None:
    flight = Flight()
    flight.on(1300.0)
    offset_m, slope, _ = flight.offsets_m.offsets([flight.at_m] * 2)[1]
    assert offset_m > 5.0
    assert slope > 0.01
    flight.take_route()
    flight.on(TICK_M)
    assert flight.offsets_m.offsets([flight.at_m] * 2)[1][:2] == pytest.approx((offset_m, slope), rel=0.02)
