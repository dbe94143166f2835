"""In flight no vehicle leaves the fence, whatever the law asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from airlink.clock import Instant
from flight_model.fence_geometry import inside_m
from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints, advance
from formation_scenario import Scenario, load_scenario
from gcs_formation import from_scenario
from gcs_formation.features.airspace.airspace import FenceLimits
from gcs_formation.features.airspace.keys import Area, Fence
from gcs_formation.recorder import Tick, VehicleLink
from tests.flights.conftest import scenario
from tests.flights.in_memory import World
from tests.gcs_formation import tables

SQUARE = ((-600.0, -600.0), (600.0, -600.0), (600.0, 600.0), (-600.0, 600.0))
LAKE = {"kind": "exclusion", "centre_m": (250.0, 250.0), "radius_m": 120.0}
BAY = ((-600.0, -600.0), (600.0, -600.0), (600.0, 100.0), (0.0, 100.0), (0.0, 600.0), (-600.0, 600.0))
TICK_S = 0.15


def fenced(corners: Any = None, count: int = 3, **keys: Any) -> Scenario:
    """Return vehicles with a fence that isn't checked against their path."""
    planned = load_scenario(scenario(vehicles={"count": count}))
    safety = planned.safety.model_copy(update={"fence": Fence(corners_m=corners, **keys)})
    return planned.model_copy(update={"safety": safety})


def tick(state: FlightStates, setpoints: Setpoints, at_s: float = 0.0) -> Tick:
    """Return a tick in which all vehicles are commanded."""
    now, count = Instant(round(at_s * 1e9)), setpoints.speed_mps.size
    made = Tick(now, 0.0, "flying", 0, [VehicleLink(now)] * count, [0.0] * count, [0.0] * count, [True] * count)
    made.state, made.setpoints = tables.states(state), tables.setpoints(setpoints)
    return made


def minimum(limits: FenceLimits, now: Tick) -> Any:
    """Limit a tick's setpoints; return which were replaced, (C, 3)."""
    limits.keep(now)
    return np.array(now.replaced)


def places(world: World) -> Any:
    """Return the true places, (3, 3) north, east, height."""
    states = [body.state for body in world.fleet.bodies]
    return np.array([(each.north_m, each.east_m, each.height_m) for each in states])


def least(world: World, corners: Any, seconds: int) -> tuple[float, float]:
    """Fly for some seconds; return the least distance inside the fence, and the least separation, m."""
    within_m, distance_m = np.inf, np.inf
    for _ in range(2 * seconds):
        world.run(0.5)
        here = places(world)
        within_m = min(within_m, float(inside_m(np.array(corners), here[:, :2]).min()))
        difference = np.linalg.norm(here[:, None] - here[None], axis=-1)[np.triu_indices(3, 1)]
        distance_m = min(distance_m, float(difference.min()))
    return within_m, distance_m


@pytest.mark.parametrize(
    ("corners", "areas"),
    [
        pytest.param(SQUARE, (), id="square", marks=pytest.mark.slow),
        pytest.param(BAY, (), id="bay"),
        pytest.param(SQUARE, (LAKE,), id="lake"),
    ],
)
def test_whatever_heading_is_asked_for_no_vehicle_leaves(corners: Any, areas: Any) -> None:
    """40 vehicles for 75 s in 4 m/s of wind, each commanded a heading of its own that changes from time to time."""
    rng, count, polygon = np.random.default_rng(1), 40, np.array(corners)
    planned = fenced(corners, count, areas=[Area(**each) for each in areas])
    models = from_scenario.autopilot_models(planned)
    limits, model = FenceLimits(planned, models), AutopilotModels.from_each(models)
    height, climb, speed, wind, still = (np.full(count, value) for value in (100.0, 0.0, 22.0, 4.0, 0.0))
    heading = rng.uniform(-np.pi, np.pi, count)
    state = FlightStates(*np.array([*np.full((2, count), -300.0), height, climb, speed, heading, wind, still]))
    wanted, turned = heading, np.zeros(count, dtype=bool)
    for step in range(500):
        if step % 100 == 0:
            wanted = rng.uniform(-np.pi, np.pi, count)
        now = tick(state, Setpoints.of(np.array([speed, wanted, height])))
        turned |= minimum(limits, now)[:, 1]
        state = advance(state, Setpoints.from_each(now.setpoints).table, np.full(count, TICK_S), model)
        assert inside_m(polygon, state.position_m[:2].T).min() > 0.0, f"after {step * TICK_S:.2f} s"
        for area in areas:
            north_m, east_m = area["centre_m"]
            assert np.hypot(state.north_m - north_m, state.east_m - east_m).min() > area["radius_m"]
    assert turned.sum() > count / 2


def test_heights_are_held_between_the_limits_and_it_is_reported_once() -> None:
    limits = FenceLimits(fenced(height_min_m=60.0, height_max_m=120.0), from_scenario.autopilot_models(fenced()))
    state = FlightStates(*np.tile([[0.0], [0.0], [100.0], [0.0], [22.0], [0.0], [0.0], [0.0]], 3))
    words: list[str] = []
    for at_s, height_m in (
        (0.0, 150.0),
        (0.1, 150.0),
        (0.2, 100.0),
        (0.3, 150.0),
        (0.4, 100.0),
        (2.4, 100.0),
        (2.5, 20.0),
    ):
        setpoints = Setpoints.of(np.array([[22.0] * 3, [0.0] * 3, [height_m, 100.0, np.nan]]))
        now = tick(state, setpoints, at_s)
        replaced = minimum(limits, now)
        words += [held.text for held in now.events]
        assert now.setpoints[0][2] == np.clip(height_m, 60.0, 120.0)
        assert replaced[:, 2].tolist() == [height_m != 100.0, False, False]
        assert np.isnan(now.setpoints[2][2])
    assert words == ["height held at 120 m", "height no longer held at 120 m", "height held at 60 m"]


def test_one_that_flies_along_the_fence_is_said_to_be_turned_away_once() -> None:
    """As long as it is commanded outwards, it is held when it runs out of room and released when it has some."""
    planned = fenced(SQUARE, 1)
    limits, model = (
        FenceLimits(planned, from_scenario.autopilot_models(planned)),
        from_scenario.autopilot_models(planned),
    )
    state, held, words = FlightStates(*np.array([[0.0], [0.0], [100.0], [0.0], [22.0], [0.0], [0.0], [0.0]])), [], []
    for step in range(round(60.0 / TICK_S)):
        now = tick(state, Setpoints.of(np.array([[22.0], [0.3], [100.0]])), step * TICK_S)
        held.append(bool(minimum(limits, now)[0, 1]))
        words += [each.text.partition(",")[0] for each in now.events]
        table = Setpoints.from_each(now.setpoints).table
        state = advance(state, table, np.full(1, TICK_S), AutopilotModels.from_each(model))
    assert np.count_nonzero(np.diff(held)) > 10
    assert words == ["turned away"]


def test_a_formation_whose_path_leads_out_stays_inside_and_says_so() -> None:
    world = World()
    corners = ((-700.0, -400.0), (200.0, -400.0), (200.0, 400.0), (-700.0, 400.0))
    world.stage("fence").limits = FenceLimits(fenced(corners), world.station.controller.models)
    within_m, distance_m = least(world, corners, 20)
    assert within_m > 0.0
    assert distance_m > 5.0
    assert world.times_s("fence", 1, "turned away")


def test_vehicles_that_the_fence_turns_towards_each_other_keep_apart() -> None:
    """In a small fence, in wind, each turns to its own side: 7.9 m apart if the rule ignored these turns."""
    world = World(wind={"velocity_mps": [0, 6, 0]})
    corners = ((-500.0, -300.0), (300.0, -300.0), (300.0, 300.0), (-500.0, 300.0))
    world.stage("fence").limits = FenceLimits(fenced(corners), world.station.controller.models)
    within_m, distance_m = least(world, corners, 14)
    assert within_m > 0.0
    assert distance_m > 10.0
