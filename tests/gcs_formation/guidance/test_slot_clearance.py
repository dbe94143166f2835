"""Lifts of slots over hills: they are computed again only where those there are no longer serve."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.optimize

from flight_model.arrays import Array
from flight_model.curve import PathPoint
from flight_model.flight_state import FlightState
from flight_model.path_offsets import TRIFLE_M, Bounds
from flight_model.slot import Slot
from flight_model.spline import SplinePath
from formation_scenario import load_scenario
from formation_scenario.fields import Frame
from formation_scenario.surroundings import Hill
from formation_scenario.terrain import Hills
from gcs_formation.guidance.join_route import JoinRoute, Leg
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
        self.bounds = BOUNDS
        self.offsets_m = SlotClearance(self.ground, CLEARANCE_M, lambda _: self.bounds, "leader_heading")
        self.take_route()
        self.plan = FormationPlan(load_scenario(scenario())).arrangement
        self.at_m = 0.0

    def take_route(self) -> None:
        """Fly along a new route, which lies where the one before did."""
        self.route = straight()

    def on(self, by_m: float, wind_east_mps: float = 0.0) -> None:
        """Fly on."""
        until_m = self.at_m + by_m
        while self.at_m < until_m:
            self.at_m += TICK_M
            leader = FlightState(self.at_m, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, wind_east_mps)
            ahead = TrackAhead(self.route, leader, 0, self.at_m, SPEED_MPS, lambda _: self.slots_m, self.plan)
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


@pytest.mark.parametrize(("share", "computed"), [(1.0, 0), (0.992, 0), (1.008, 0), (0.985, 1), (1.015, 1)])
def test_a_bound_of_slope_that_differs_by_a_hundredth_has_offsets_computed_again(
    programmes: list[object], share: float, computed: int
) -> None:
    """As the leader's speed over ground makes it; they are checked each 100 m, not before.

    Wind shifts it by less all the time, which is no reason to compute them; by more, they would climb too steeply.
    """
    flight = Flight()
    flight.on(TICK_M)
    flight.bounds = Bounds(share * BOUNDS.slope, BOUNDS.curvature_1pm)
    flight.on(90.0)
    assert len(programmes) == 1
    flight.on(TICK_M)
    assert len(programmes) == 1 + computed


def test_offsets_reach_two_kilometres_ahead_of_who_is_last(programmes: list[object]) -> None:
    """140 steps of 20 m from 40 m behind it: 100 are left once it has flown 800 m, here 100 m behind the leader."""
    flight = Flight()
    leader = FlightState(0.0, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    for at_m in np.arange(0.0, 1000.0, ADVANCE_M).tolist():
        ahead = TrackAhead(flight.route, leader, 0, at_m, SPEED_MPS, lambda _: flight.slots_m, flight.plan)
        flight.offsets_m.look_ahead(ahead, [at_m, at_m - 100.0])
        assert len(programmes) == (1 if at_m < 850.0 else 2)


def test_another_plan_has_offsets_computed_again_at_once(programmes: list[object]) -> None:
    flight = Flight()
    flight.on(2 * TICK_M)
    assert len(programmes) == 1
    flight.plan = FormationPlan(load_scenario(scenario())).arrangement
    flight.on(TICK_M)
    assert len(programmes) == 2
    flight.on(TICK_M)
    assert len(programmes) == 2


def test_what_is_near_is_not_changed_when_offsets_are_computed_again() -> None:
    """Setpoints act at different times: within 40 m of each vehicle's own place on the path nothing jumps."""
    flight, near_m = Flight(), np.arange(-55.0, 41.0, 5.0)
    flight.on(1250.0)
    before = [flight.offsets_m.offsets([each, each])[1] for each in (flight.at_m + near_m).tolist()]
    soon_m, ahead_m = (flight.offsets_m.offsets([flight.at_m + each] * 2)[1][0] for each in (80.0, 400.0))
    flight.slots_m = flight.slots_m - np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 7.0]])
    flight.plan = FormationPlan(load_scenario(scenario())).arrangement
    leader = FlightState(flight.at_m, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    ahead = TrackAhead(flight.route, leader, 0, flight.at_m, SPEED_MPS, lambda _: flight.slots_m, flight.plan)
    flight.offsets_m.look_ahead(ahead, [flight.at_m, flight.at_m - 15.0])
    after = [flight.offsets_m.offsets([each, each])[1] for each in (flight.at_m + near_m).tolist()]
    assert np.array(after) == pytest.approx(np.array(before), abs=1e-9)
    assert flight.offsets_m.offsets([flight.at_m + 80.0] * 2)[1][0] > soon_m + 0.1, "it isn't kept any farther"
    assert flight.offsets_m.offsets([flight.at_m + 400.0] * 2)[1][0] > ahead_m + 1.0


@pytest.mark.parametrize("leading", [0, 1])
def test_on_another_route_height_slope_and_curvature_go_on_relative_to_the_leaders_own(leading: int) -> None:
    """A new leader's route begins at its raised height: one that wasn't raised is below its slot by as much."""
    flight = Flight()
    flight.on(1370.0)
    held = np.array(flight.offsets_m.offsets([flight.at_m] * 2))
    assert held[1, 0] > 5.0
    assert abs(held[1, 1]) > 0.01
    assert abs(held[1, 2]) > 1e-5
    flight.take_route()
    leader = FlightState(flight.at_m, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
    slots_m, at_m = flight.slots_m - flight.slots_m[leading], [flight.at_m - 313.0 * leading] * 2
    ahead = TrackAhead(flight.route, leader, leading, at_m[0], SPEED_MPS, lambda _: slots_m, flight.plan)
    flight.offsets_m.look_ahead(ahead, at_m)
    assert np.array(flight.offsets_m.offsets(at_m)) == pytest.approx(held - held[leading], abs=1e-9)


def test_a_slot_rises_as_fast_as_its_leader_passes_the_offsets_slope() -> None:
    """Rates by time are the derivatives at 22 m/s, whatever the slot's own are."""
    flight, step_s = Flight(), 0.01
    flight.on(1310.0)
    slots = [Slot([0.0] * 3, [0.0] * 3, [0.0] * 3), Slot([-60.0, 100.0, 4.0], [1.0, 2.0, 0.3], [0.1, 0.2, -0.02])]

    def raised(later_s: float) -> Slot:
        at_m = flight.at_m + SPEED_MPS * later_s
        return flight.offsets_m.raised(slots, [at_m, at_m], SPEED_MPS)[1]

    before, here, after = (raised(each) for each in (-step_s, 0.0, step_s))
    assert (here.forward_m, here.right_m, here.forward_mps, here.right_mps2) == (-60.0, 100.0, 1.0, 0.2)
    assert here.up_m == pytest.approx(4.0 + flight.offsets_m.offsets([flight.at_m] * 2)[1][0])
    assert here.up_mps - 0.3 == pytest.approx((after.up_m - before.up_m) / (2.0 * step_s), rel=1e-3)
    assert here.up_mps2 + 0.02 == pytest.approx((after.up_mps - before.up_mps) / (2.0 * step_s), rel=1e-2)


class Seen:
    """Flat ground far below, that keeps where it was asked for."""

    def __init__(self) -> None:
        self.places = list[tuple[Array, Array]]()

    def height(self, north_m: Array, east_m: Array) -> Array:
        self.places.append((north_m, east_m))
        return np.full_like(north_m, -500.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("frame", ["leader_heading", "follower_heading", "north"])
@pytest.mark.parametrize("crosswind", [False, True])
def test_the_ground_is_looked_at_where_slots_will_be(frame: Frame, crosswind: bool, side: float) -> None:
    """In a turn of 400 m radius, of a slot that moves back by 0.5 m/s, 60 m behind at first, and 100 m to the side.

    In its own frame a follower heads at right angles to the line from the turn's centre. A crosswind of half of the
    airspeed turns the nose by 30 degrees.
    """
    ground, seconds = Seen(), list[float]()

    def slots(later_s: float) -> Array:
        seconds.append(later_s)
        return np.array([[0.0, 0.0, 0.0], [-60.0 - 0.5 * later_s, 100.0, 0.0]])

    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, frame)  # type: ignore[arg-type]
    route = JoinRoute((Leg(PathPoint(0.0, 0.0, HEIGHT_M, 0.0), 1e5, side / 400.0),), HEIGHT_M, HEIGHT_M, 0.1)
    wind_mps = 11.0 if crosswind else 0.0
    leader = FlightState(0.0, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, wind_mps)
    plan = FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(route, leader, 0, 100.0, SPEED_MPS, slots, plan), [100.0, 95.0])
    (north, east), begin_m = ground.places[0], 40.0
    assert seconds == pytest.approx([(begin_m + 20.0 * each - 100.0) / SPEED_MPS for each in range(141)])
    assert north.shape == (2, 561)
    for sample in range(0, 561, 7):
        at_m = begin_m + 5.0 * sample
        here, later_s = route.at(at_m), (at_m - 100.0) / SPEED_MPS
        assert (north[0, sample], east[0, sample]) == pytest.approx((here.north_m, here.east_m))
        away = np.array([north[1, sample] - here.north_m, east[1, sample] - here.east_m])
        forward_m, nose_rad = -60.0 - 0.5 * later_s, 0.0
        if frame != "north":
            nose_rad = here.course_rad - math.asin(wind_mps / SPEED_MPS * math.cos(here.course_rad))
        if frame != "follower_heading":
            cos, sin = math.cos(nose_rad), math.sin(nose_rad)
            assert away == pytest.approx([forward_m * cos - 100.0 * sin, forward_m * sin + 100.0 * cos])
        elif not crosswind:
            assert math.hypot(*away) == pytest.approx(math.hypot(forward_m, 100.0))
            centre = np.array([-math.sin(here.course_rad), math.cos(here.course_rad)]) * 400.0 * side
            own_rad = math.atan2(away[1], away[0]) - math.atan2(100.0, forward_m)
            along = np.array([math.cos(own_rad), math.sin(own_rad)])
            assert float(along @ (away - centre)) == pytest.approx(0.0, abs=1e-6)


def test_in_a_crosswind_that_it_cannot_outfly_a_leader_faces_the_wind() -> None:
    """From the left on its way to the north: what is behind it lies to the east, what is to its right to the north."""
    ground = Seen()
    offsets = SlotClearance(ground, CLEARANCE_M, lambda _: BOUNDS, "leader_heading")  # type: ignore[arg-type]
    leader = FlightState(0.0, 0.0, HEIGHT_M, 0.0, SPEED_MPS, 0.0, 0.0, 30.0)
    plan = FormationPlan(load_scenario(scenario())).arrangement
    offsets.look_ahead(TrackAhead(straight(), leader, 0, 0.0, SPEED_MPS, lambda _: SLOTS, plan), [0.0, 0.0])
    (north, east), ahead_m = ground.places[0], 5.0 * np.arange(561) - 40.0
    assert north[1] - ahead_m == pytest.approx(np.full(561, RIGHT_M))
    assert east[1] == pytest.approx(np.full(561, BEHIND_M))


def test_slower_than_one_metre_a_second_slots_are_looked_at_as_at_that() -> None:
    """A leader that stands would be at no place ahead, ever."""
    seconds = list[float]()

    def slots(later_s: float) -> Array:
        seconds.append(later_s)
        return SLOTS

    for along_mps in (0.0, 1.0, 2.0):
        offsets = SlotClearance(Seen(), CLEARANCE_M, lambda _: BOUNDS, "leader_heading")  # type: ignore[arg-type]
        leader = FlightState(0.0, 0.0, HEIGHT_M, 0.0, 0.0, 0.0, 0.0, 0.0)
        plan = FormationPlan(load_scenario(scenario())).arrangement
        offsets.look_ahead(TrackAhead(straight(), leader, 0, 0.0, along_mps, slots, plan), [0.0, 0.0])
    assert seconds[:141] == seconds[141:282] == pytest.approx([2.0 * each for each in seconds[282:]])
    assert seconds[:3] == pytest.approx([-40.0, -20.0, 0.0])
