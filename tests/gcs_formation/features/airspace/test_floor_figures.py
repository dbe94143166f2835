"""Heights that the floor commands: closed forms over level ground, and predictions over hills by model (7)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant, after
from flight_model.autopilot_model import advance
from flight_model.flight_state import FlightState
from formation_scenario import Scenario, load_scenario
from gcs_formation import from_scenario
from gcs_formation.features.airspace.airspace import AROUND_M, HeightFloor
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario
from tests.gcs_formation.features.airspace.test_floor import (
    CLEARANCE_M,
    CLIMB_MPS,
    LAG_S,
    SPEED_MPS,
    floor_of,
    flown,
    kept,
    planned,
)

RIDGE: Any = {"height_m": 60.0, "north_m": 300.0, "east_m": 0.0, "radius_m": 100.0}
HILLS = planned(RIDGE)
LEVEL = planned()
MODEL = from_scenario.autopilot_models(LEVEL)[1]


class Stairs:
    """Ground that rises by steps along north, and counts how often its highest part is searched."""

    def __init__(self, *steps: tuple[float, float]) -> None:
        self.steps, self.searched = steps, list[tuple[float, float]]()

    def height(self, north_m: Any, _: Any) -> Any:
        return np.max([np.where(north_m >= from_m, height_m, 0.0) for from_m, height_m in self.steps], axis=0)

    def bound_m(self, north_m: Any, east_m: Any, around_m: float) -> Any:
        self.searched.append((float(north_m[0]), float(around_m)))
        return np.max([np.where(north_m + around_m >= from_m, up_m, 0.0) for from_m, up_m in self.steps], axis=0)


class Pole(Stairs):
    """Level ground with a narrow obstacle."""

    def __init__(self, at_m: float, height_m: float) -> None:
        super().__init__((at_m - 200.0, height_m))
        self.at_m, self.up_m = at_m, height_m

    def height(self, north_m: Any, _: Any) -> Any:
        return np.where(np.abs(north_m - self.at_m) < 1.0, self.up_m, 0.0)


def over(*steps: tuple[float, float]) -> tuple[HeightFloor, Stairs]:
    """Return the floor over stairs."""
    ground, flight = Stairs(*steps), HILLS.model_copy()
    vars(flight)["ground"] = ground
    return floor_of(flight), ground


@pytest.mark.parametrize("height_m", [24.0, 30.0, 60.0])
@pytest.mark.parametrize("asked_m", [-50.0, 0.0, 19.9, 20.0, 20.1, 90.0])
def test_over_level_ground_one_that_flies_level_is_asked_for_no_less_than_the_clearance(
    height_m: float, asked_m: float
) -> None:
    assert flown(floor_of(LEVEL), asked_m, height_m) == max(asked_m, CLEARANCE_M)


@pytest.mark.parametrize("height_m", [0.0, 4.0, 7.9, 8.0, 12.0, 19.0])
def test_below_the_clearance_one_is_asked_for_the_fastest_climb_as_long_as_its_reach_lacks(height_m: float) -> None:
    """Its setpoints lead by 4 s of 3 m/s. Higher than that a climb by its lags comes too late anyway."""
    assert flown(floor_of(LEVEL), -8.0, height_m) == height_m + LAG_S * CLIMB_MPS


def ahead(from_s: float) -> float:
    """Return how far ahead one is after a time at its speed."""
    return from_s * SPEED_MPS


def test_the_later_a_step_comes_the_less_a_setpoint_leads_it() -> None:
    """A step 2 m above the way, within the 4 s that a height takes. In 1 s it can't be climbed; in 4 s all arrive."""
    asked = [flown(over((ahead(LAG_S * share) - 0.5, 82.0))[0], 90.0, 100.0) for share in (0.25, 0.5, 0.75, 1.0)]
    assert asked[0] == 100.0 + LAG_S * CLIMB_MPS
    assert asked[0] > asked[1] > asked[2] > asked[3] == 82.0 + CLEARANCE_M


@pytest.mark.parametrize(("share", "asked_m"), [(0.25, 88.0), (0.5, 94.0), (0.75, 96.0), (1.0, 97.0)])
def test_on_a_descent_the_straight_path_clears_each_quarter_of_the_way(share: float, asked_m: float) -> None:
    """A pole 77 m high is passed then: 97 m are clear of it, 3 m below here."""
    floor: Any = over((-1e3, 0.0))[0]
    floor._ground = Pole(ahead(LAG_S * share), 77.0)
    assert flown(floor, 50.0, 100.0) == pytest.approx(asked_m)


@pytest.mark.parametrize(("beyond_s", "counts"), [(11.9, True), (12.1, False)])
def test_ground_counts_that_is_reached_within_three_time_constants(beyond_s: float, counts: bool) -> None:
    """12 s ahead a step is so high that it can't be climbed in time."""
    floor, _ = over((ahead(beyond_s), 300.0))
    asked_m = flown(floor, 100.0, 100.0)
    assert asked_m == (100.0 + LAG_S * CLIMB_MPS if counts else 100.0)


def reached(state: FlightState, setpoint_m: float) -> tuple[list[float], list[float]]:
    """Return places north and heights until three time constants if a setpoint is held for half of one.

    The fastest climb follows.
    """
    flying, places, heights, step_s = state.copy(), list[float](), list[float](), 0.05
    for step in range(round(3.0 * LAG_S / step_s)):
        aim_m = setpoint_m if step * step_s < 0.5 * LAG_S else flying.height_m + LAG_S * CLIMB_MPS
        advance(flying, MODEL, SPEED_MPS, 0.0, aim_m, step_s)
        places.append(flying.north_m)
        heights.append(flying.height_m)
    return places, heights


def test_over_a_hill_the_setpoint_is_high_enough_for_a_climb_that_follows_to_clear_it() -> None:
    """Whatever one is at, and however fast it sinks; where a climb matters, clear by half a metre at most."""
    rng, floor, least_m = np.random.default_rng(3), floor_of(HILLS), list[float]()
    for _ in range(40):
        north_m, height_m, climb_mps = rng.uniform(100.0, 260.0), rng.uniform(60.0, 85.0), rng.uniform(-3.0, 1.0)
        setpoint_m = kept(floor, 10.0, height_m, north_m, climb_mps=climb_mps).setpoints[1][2]
        assert 10.0 <= setpoint_m <= height_m + LAG_S * CLIMB_MPS
        if setpoint_m < height_m + LAG_S * CLIMB_MPS - 0.01:
            places, heights = reached(
                FlightState(north_m, 0.0, height_m, climb_mps, SPEED_MPS, 0.0, 0.0, 0.0), setpoint_m
            )
            ground = HILLS.ground.height(np.array(places), np.zeros(len(places)))
            least_m.append(float((np.array(heights) - ground).min()))
    assert len(least_m) > 10
    assert CLEARANCE_M - 0.3 < min(least_m) < CLEARANCE_M + 0.5


def test_over_level_ground_a_setpoint_that_makes_up_for_sinking_brings_one_just_to_the_clearance() -> None:
    """In any air: no lower than 0.3 m between the times that are checked, and at none of these higher."""
    rng, floor, least_m = np.random.default_rng(3), floor_of(LEVEL), list[float]()
    for _ in range(60):
        height_m, climb_mps, up_mps = rng.uniform(20.0, 26.0), rng.uniform(-3.0, 0.0), rng.uniform(-2.5, 1.0)
        tick = kept(floor, 10.0, height_m, climb_mps=climb_mps, updraught_mps=up_mps)
        setpoint_m = tick.setpoints[1][2]
        assert CLEARANCE_M <= setpoint_m <= height_m + LAG_S * CLIMB_MPS
        if CLEARANCE_M + 0.01 < setpoint_m < height_m + LAG_S * CLIMB_MPS - 0.01:
            state = FlightState(0.0, 0.0, height_m, climb_mps, SPEED_MPS, 0.0, 0.0, 0.0, up_mps)
            least_m.append(min(reached(state, setpoint_m)[1]))
    assert len(least_m) > 15
    assert CLEARANCE_M - 0.3 < min(least_m) <= max(least_m) < CLEARANCE_M + 0.01


def test_the_highest_ground_is_searched_again_only_where_it_may_be_another() -> None:
    """Within 500 m of the last search, less the 12 s that it may fly on: 240 m at 20 m/s."""
    floor, ground = over((1e6, 50.0))
    for north_m in (0.0, 100.0, 260.0, 261.0, 521.0, 522.0, 261.0, 0.0):
        kept(floor, 90.0, 100.0, north_m)
    assert ground.searched == [(north_m, AROUND_M) for north_m in (0.0, 261.0, 522.0, 261.0, 0.0)]


@pytest.mark.parametrize("bearing_deg", [0.0, 37.0, 143.0, 217.0, 323.0])
def test_the_distance_from_the_last_search_counts_in_any_direction(bearing_deg: float) -> None:
    """260 m, as it may fly on for 240 m."""
    cos, sin = math.cos(math.radians(bearing_deg)), math.sin(math.radians(bearing_deg))
    floor, ground = over((1e6, 50.0))
    for away_m in (0.0, 259.0, 261.0):
        kept(floor, 90.0, 100.0, 3000.0 + away_m * cos, east_m=-4000.0 + away_m * sin)
    assert [north_m for north_m, _ in ground.searched] == [3000.0, 3000.0 + 261.0 * cos]


def test_a_fast_one_is_searched_for_in_twice_the_distance_that_it_may_fly_on() -> None:
    floor, ground = over((1e6, 50.0))
    now = after(Instant(0), 1.0)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [False, True, False])
    tick.state[1] = FlightState(0.0, 0.0, 100.0, 0.0, 36.0, 0.3, 0.0, 0.0)
    tick.setpoints[1] = 36.0, 0.3, 90.0
    floor.keep(tick)
    assert ground.searched == [(0.0, pytest.approx(2.0 * 12.0 * 36.0))]


def test_each_vehicle_is_held_by_the_ground_ahead_of_it_and_a_virtual_leader_by_none() -> None:
    """The second is before a step that the first has passed; the third flies away from it, the wind sideways."""
    floor, _ = over((0.0, 100.0))
    now = after(Instant(0), 1.0)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [True] * 3)
    places = ((50.0, 130.0, 0.0, 0.0), (-30.0, 130.0, 0.0, 0.0), (-30.0, 130.0, math.pi, 10.0))
    for index, (north_m, height_m, heading_rad, wind_mps) in enumerate(places):
        tick.state[index] = FlightState(north_m, 0.0, height_m, 0.0, SPEED_MPS, heading_rad, wind_mps, 0.0)
        tick.setpoints[index] = SPEED_MPS, heading_rad, 30.0
    floor.keep(tick)
    assert [each[2] for each in tick.setpoints] == [120.0, 120.0, 30.0]
    assert [(each[0], each[1]) for each in tick.setpoints] == [(SPEED_MPS, 0.0), (SPEED_MPS, 0.0), (SPEED_MPS, math.pi)]
    said = "height held at 120 m, 20 m above the ground"
    assert [(each.text, each.vehicle.system) for each in tick.events if each.vehicle] == [(said, 1), (said, 2)]


def virtual() -> Scenario:
    each = [{"id": number, "role": "follower"} for number in (1, 2)]
    shape = {"shape": "custom", "slots_m": {1: [-20, -20, 0], 2: [-20, 20, 0]}}
    return load_scenario(scenario(vehicles=each, formation=shape, safety={"clearance_m": CLEARANCE_M}))


def test_a_virtual_leader_has_no_floor_and_its_followers_have() -> None:
    floor, now = floor_of(virtual()), after(Instant(0), 1.0)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [True] * 3)
    for index in range(3):
        tick.state[index] = FlightState(0.0, 0.0, 40.0, 0.0, SPEED_MPS, 0.0, 0.0, 0.0)
        tick.setpoints[index] = SPEED_MPS, 0.0, 5.0
    floor.keep(tick)
    assert [each[2] for each in tick.setpoints] == [5.0, CLEARANCE_M, CLEARANCE_M]
