"""In flight no vehicle is sent into the ground, whatever the law asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant, after
from flight_model.autopilot_model import advance
from flight_model.earth import GeodeticOrigin
from flight_model.flight_state import FlightState
from formation_scenario import Scenario, load_scenario
from formation_scenario.terrain import ElevationGrid
from gcs_formation import from_scenario
from gcs_formation.control.setpoint import AS_DECIDED
from gcs_formation.features.airspace.airspace import OVER_S, HeightFloor
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario
from tests.gcs_formation.features.sinking import sunk

CLEARANCE_M, LAG_S, SPEED_MPS, CLIMB_MPS = 20.0, 4.0, 20.0, 3.0
HIGH = {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 200], [4000, 0, 200]]}
SLOPE: Any = {"shape": "gaussian", "north_m": 0.0, "east_m": 0.0, "height_m": 100.0, "radius_m": 600.0}


def planned(*hills: Any) -> Scenario:
    """Return a leader and two followers, which keep 20 m above the ground."""
    terrain = {"terrain": {"hills": list(hills), "clearance_m": 30}} if hills else {}
    return load_scenario(scenario(safety={"clearance_m": CLEARANCE_M}, path=HIGH, **terrain))


def floor_of(over: Scenario) -> HeightFloor:
    return HeightFloor(over, from_scenario.autopilot_models(over))


def kept(
    floor: HeightFloor,
    commanded_m: float,
    height_m: float,
    north_m: float = 0.0,
    at_s: float = 0.0,
    climb_mps: float = 0.0,
    updraught_mps: float = 0.0,
    east_m: float = 0.0,
) -> Tick:
    """Return the tick at which a vehicle that heads north is commanded to a height."""
    now = after(Instant(0), at_s)
    tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [False, True, False])
    tick.state[1] = FlightState(north_m, east_m, height_m, climb_mps, SPEED_MPS, 0.0, 0.0, 0.0, updraught_mps)
    tick.setpoints[1] = SPEED_MPS, 0.0, commanded_m
    floor.keep(tick)
    assert tick.replaced == [AS_DECIDED, (False, False, tick.setpoints[1][2] != commanded_m), AS_DECIDED]
    return tick


def flown(
    floor: HeightFloor, commanded_m: float, height_m: float, north_m: float = 0.0, climb_mps: float = 0.0
) -> float:
    return kept(floor, commanded_m, height_m, north_m, climb_mps=climb_mps).setpoints[1][2]


def test_over_level_ground_heights_are_held_and_it_is_reported_when_it_begins_and_ends() -> None:
    floor, words = floor_of(planned()), list[str]()
    heights = (50.0, 19.0, -30.0, 25.0, 19.0, 25.0, 25.0)
    for at_s, commanded_m in zip((0.0, 1.0, 1.1, 1.2, 1.3, 1.4, 1.3 + OVER_S + 0.1), heights, strict=True):
        tick = kept(floor, commanded_m, 24.0, at_s=at_s)
        assert tick.setpoints[1][2] == max(commanded_m, CLEARANCE_M)
        words += [each.text for each in tick.events]
    assert words == ["height held at 20 m, 20 m above the ground", "height no longer held above the ground"]


def test_one_that_is_too_low_is_asked_for_no_more_than_it_can_climb() -> None:
    assert flown(floor_of(planned()), -8.0, 4.0) == 4.0 + LAG_S * CLIMB_MPS
    assert flown(floor_of(planned()), 17.0, 4.0) == 17.0


@pytest.mark.parametrize("north_m", [-700.0, -300.0, -100.0, 60.0, 300.0, 700.0])
def test_one_that_flies_along_a_slope_is_given_the_ground_that_it_comes_to(north_m: float) -> None:
    """Setpoints lead: a metre above the clearance nothing changes, uphill or downhill; below, the height is raised."""
    over = planned(SLOPE)
    ground = over.ground.height(np.array([north_m, north_m + SPEED_MPS, north_m + LAG_S * SPEED_MPS]), np.zeros(3))
    here_m, soon_m, there_m = (ground + CLEARANCE_M).tolist()
    climb_mps = soon_m - here_m
    assert flown(floor_of(over), there_m + 1.0, here_m + 1.0, north_m, climb_mps) == there_m + 1.0
    held_m = flown(floor_of(over), there_m - 5.0, here_m + 1.0, north_m, climb_mps)
    assert there_m <= held_m < there_m + 2.0


def test_a_ridge_on_the_way_counts_also_where_the_ground_beyond_is_low() -> None:
    ridge: Any = {"north_m": 40, "east_m": 0, "height_m": 30, "radius_m": 10, "length_m": 500, "bearing_deg": 90}
    floor = floor_of(planned(ridge))
    assert flown(floor, 45.0, 45.0) == 45.0 + LAG_S * CLIMB_MPS, "5 m in 2 s: all that it can climb"
    assert 50.0 <= flown(floor, 40.0, 50.0) < 51.0
    assert flown(floor, 45.0, 45.0, 150.0) == 45.0


@pytest.mark.parametrize(
    ("speed_mps", "sinks_mps", "radius_m"), [(26.0, 1.5, 600.0), (22.0, 3.0, 500.0), (18.0, 0.0, 400.0)]
)
def test_one_that_is_asked_down_over_a_hill_climbs_in_time_by_its_time_constants(
    speed_mps: float, sinks_mps: float, radius_m: float
) -> None:
    """Flown by model (7), told again each tick, from where it sinks before the hill until behind it."""
    hill: Any = {"north_m": 1500.0, "east_m": 0.0, "height_m": 90.0, "radius_m": radius_m}
    over = planned(hill)
    floor, model = floor_of(over), from_scenario.autopilot_models(over)[1]
    state = FlightState(500.0, 0.0, 70.0, -sinks_mps, speed_mps, 0.0, 0.0, 0.0)
    clear_m, highest_m = list[float](), 0.0
    for step in range(round(1500.0 / (0.1 * speed_mps))):
        now = after(Instant(0), 0.1 * step)
        tick = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * 3, [0.0] * 3, [0.0] * 3, [False, True, False])
        tick.state[1], tick.setpoints[1] = state.copy(), (speed_mps, 0.0, -30.0)
        floor.keep(tick)
        advance(state, model, *tick.setpoints[1], 0.1)
        ground_m = float(over.ground.height(np.array([state.north_m]), np.array([0.0]))[0])
        clear_m.append(state.height_m - ground_m)
        highest_m = max(highest_m, state.height_m)
    assert min(clear_m) > CLEARANCE_M
    assert highest_m < 90.0 + CLEARANCE_M + 3.0, "no higher than the hill asks for"


@pytest.mark.parametrize("updraught_mps", [-3.0, -1.0, 0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("climb_mps", [-3.0, 0.0, 3.0, 4.0])
def test_in_any_air_a_climb_before_a_hill_is_commanded_that_is_no_faster_than_the_limit(
    climb_mps: float, updraught_mps: float
) -> None:
    """In air that rises at 2 m/s a vehicle that climbs at its limit climbs no faster by any setpoint."""
    hill: Any = {"north_m": 300.0, "east_m": 0.0, "height_m": 60.0, "radius_m": 100.0}
    floor, height_m = floor_of(planned(hill)), 40.0
    for north_m in (100.0, 150.0, 200.0, 250.0):
        held_m = kept(floor, 30.0, height_m, north_m, climb_mps=climb_mps, updraught_mps=updraught_mps).setpoints[1][2]
        assert 30.0 < held_m <= height_m + LAG_S * CLIMB_MPS
    assert held_m == height_m + LAG_S * CLIMB_MPS, "already below the clearance"


def test_where_the_ground_is_not_known_there_is_no_floor() -> None:
    over = planned(SLOPE)
    origin = GeodeticOrigin(0.0, 0.0, 0.0)
    vars(over)["ground"] = ElevationGrid(np.full((3, 3), np.nan), 0.1, -0.1, 0.1, 0.1, origin)
    assert flown(floor_of(over), -10.0, 15.0) == -10.0


def test_a_leader_that_sinks_to_the_ground_does_not_take_its_followers_there() -> None:
    """Where their path is low the floor holds them."""
    world, min_m = sunk(18.0)
    assert min_m == pytest.approx(5.0, abs=0.05)  # safety.clearance_m
    for number in (2, 3):
        assert len(world.times_s("fence", number, "height held at 5 m, 5 m above the ground")) == 1
