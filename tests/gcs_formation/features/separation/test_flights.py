"""Separation in whole flights: kept where a vehicle flies straight on as the others turn; inactive elsewhere."""

from __future__ import annotations

import itertools
import math
import statistics
from typing import Any

import pytest

from tests.flights.conftest import Fly
from tests.flights.in_memory import World

START = {"in_air": True, "run_in_s": 12}
"""Long enough for followers to settle over late links, so that the leader flies no lap."""
LEFT, RIGHT = [-30, -30, 0], [-30, 30, 0]
SWAP: dict[str, Any] = {
    "duration_s": 35,
    "formation": {
        "shape": "custom",
        "slots_m": {2: LEFT, 3: RIGHT},
        "changes": [{"at_s": 2, "shape": "custom", "slots_m": {2: RIGHT, 3: LEFT}}],
    },
}
LINKS = [{}, {"default": {"delay_ms": 300}}, {"default": {"delay_ms": 150, "jitter_ms": 30, "loss": 0.1}}]


@pytest.mark.slow
@pytest.mark.parametrize("links", LINKS)
def test_a_change_of_formation_keeps_apart_by_itself(fly: Fly, links: dict[str, Any]) -> None:
    safety = fly(**SWAP, start=START, links=links).to_dict()["safety"]
    assert safety["violations"] == 0
    assert safety["min_separation_m"] > 20.0
    assert safety["avoidance_s"] == 0.0


@pytest.mark.slow
def test_slots_hardly_farther_apart_than_the_limit_are_flown_and_left_alone(fly: Fly) -> None:
    links = {"default": {"delay_ms": 300, "jitter_ms": 10}}
    close = {"shape": "square", "spacing_m": 6.5}
    safety = fly(duration_s=25, vehicles={"count": 5}, start=START, links=links, formation=close).to_dict()["safety"]
    assert safety["violations"] == 0
    assert safety["avoidance_s"] == 0.0


TURN: dict[str, Any] = {
    "duration_s": 45,
    "path": {
        "speed_mps": 22,
        "waypoints_m": [
            [0, 0, 100],
            [500, 0, 100],
            [1000, -100, 100],
            [1350, -500, 100],
            [1400, -1100, 100],
            [1400, -2500, 100],
        ],
    },
    "formation": {"shape": "custom", "slots_m": {2: [-10, -80, 0], 3: [-30, 30, 0]}},
    "faults": [{"at_s": 14, "kind": "pilot", "vehicles": [2], "mode": "CRUISE"}],
}
"""Follower 2's pilot flies straight on while the formation turns across its way."""


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0, 300])
def test_a_vehicle_that_is_not_commanded_is_kept_away_from(fly: Fly, delay_ms: float) -> None:
    links = {"default": {"delay_ms": delay_ms}}
    off = fly(**TURN, start=START, links=links, safety={"avoidance": {"enabled": False}}).to_dict()["safety"]
    kept = fly(**TURN, start=START, links=links).to_dict()["safety"]
    assert off["min_separation_m"] < 5.0
    assert off["violations"] == 1
    assert kept["min_separation_m"] > 9.0
    assert kept["violations"] == 0
    assert kept["avoidance_s"] > 0.0


@pytest.mark.parametrize("climbed_for_s", [0.0, pytest.param(2.0, marks=pytest.mark.slow)])
def test_who_flies_beside_one_whose_pilot_sets_loiter_climbs_before_it_turns(climbed_for_s: float) -> None:
    """15 m aside, it is reached after 4 s: enough to climb 8 m at once, but 5 m after a turn has been detected.

    When two climb side by side, the one in LOITER levels off, so the way out is upwards.
    """
    world = World(formation={"shape": "custom", "slots_m": {2: [0, 40, 0], 3: [0, 55, 0]}}, duration_s=10)
    world.fly_to(1.0)
    if climbed_for_s:
        world.station.phase_machine.stop(world.clock.now())
        world.run(climbed_for_s)
    world.inject(2, "pilot")
    nearest_m = 15.0
    for _ in range(60):
        world.run(0.1)
        one, other = (body.motion for body in world.fleet.bodies[1:])
        nearest_m = min(nearest_m, math.dist(*((each.north_m, each.east_m, each.height_m) for each in (one, other))))
    assert nearest_m > 7.0


OUT = {"at_s": 36, "vehicles": [2]}
UNRESPONSIVE: list[dict[str, Any]] = [
    {"links": {"changes": [OUT | {"outage": True}]}},
    {"links": {"changes": [OUT | {"uplink": {"outage": True}}]}},
    {"faults": [OUT | {"kind": "ignore"}]},
]
"""Neither link works; no uplink; acknowledges without obeying."""


@pytest.mark.slow
def test_an_unresponsive_vehicle_is_kept_away_from_where_it_flies_straight_on(fly: Fly) -> None:
    """Beside the leader, it holds its last heading setpoint, across the way of the others in their turn."""
    beside = {"shape": "custom", "slots_m": {2: [5, -20, 0], 3: [-40, 40, 0]}}
    flight = {"duration_s": 52, "path": TURN["path"], "formation": beside, "start": START}
    off = fly(**flight, **UNRESPONSIVE[0], safety={"avoidance": {"enabled": False}}).to_dict()["safety"]
    assert off["min_separation_m"] < 5.0
    for trouble in UNRESPONSIVE:
        assert fly(**flight, **trouble).to_dict()["safety"]["min_separation_m"] > 10.0


@pytest.mark.slow
def test_a_follower_that_passes_its_leader_comes_to_its_slot(fly: Fly) -> None:
    """It begins ahead of the leader. Flying as slowly as it can, it evades in height and goes on falling back."""
    behind = {"shape": "custom", "slots_m": {2: [-40, 0, 0]}}
    start = {"in_air": True, "run_in_s": 6, "offset_m": [75, 2, 0]}
    found = fly(duration_s=60, vehicles={"count": 2}, law={"type": "pid"}, start=start, formation=behind).to_dict()
    assert found["safety"]["violations"] == 0
    assert found["safety"]["avoidance_s"] > 2.0
    assert found["followers"]["2"]["settled_at_s"] < 50.0


def dryden(seed: int, shape: str) -> dict[str, Any]:
    """Return turbulence of a wind of 15 m/s in slots 12 m apart."""
    return {
        "seed": seed,
        "duration_s": 40,
        "vehicles": {"count": 4},
        "start": {"in_air": True, "run_in_s": 10},
        "finish": {"loiter_s": 20},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 150], [3000, 0, 150]]},
        "formation": {"shape": shape, "spacing_m": 12},
        "disturbances": [{"kind": "dryden", "at_s": 1, "vehicles": "all", "wind_6m_mps": 15.0}],
    }


@pytest.mark.slow
def test_heavy_turbulence_brings_near_slots_and_those_that_circle_together_in_few_flights(fly: Fly) -> None:
    """19 of 20 keep to the limit of 5 m, half of each shape's to 6.5 m.

    The rule can't prevent all effects of gusts (docs/separation.md): 3 of the 60 come below 5 m.
    """
    nearest_m = dict[str, list[float]]()
    for shape in ("square", "line", "follower"):
        flights = [fly(**dryden(seed, shape)).to_dict()["safety"] for seed in range(1, 21)]
        assert all(each["avoidance_s"] > 0.0 for each in flights)
        nearest_m[shape] = [each["min_separation_m"] for each in flights]
        assert statistics.median(nearest_m[shape]) > 6.5
    assert sorted(itertools.chain(*nearest_m.values()))[3] > 5.0


@pytest.mark.slow
def test_vehicles_that_climb_a_third_as_fast_as_declared_are_kept_apart(fly: Fly) -> None:
    """As they turn across the way of one flown straight on by its pilot, and near one that doesn't respond."""
    slow = {"vehicles": {"count": 3, "true_model": {"climb_max_mps": 1.0}}}
    assert fly(**TURN, **slow, start=START).to_dict()["safety"]["min_separation_m"] > 6.5
    beside = {"shape": "custom", "slots_m": {2: [5, -20, 0], 3: [-40, 40, 0]}}
    flight = {"duration_s": 52, "path": TURN["path"], "formation": beside, "start": START}
    for trouble in UNRESPONSIVE:
        assert fly(**flight, **slow, **trouble).to_dict()["safety"]["min_separation_m"] > 5.5


@pytest.mark.parametrize(
    ("model", "distance_m", "mode", "whose"),
    [
        ("px4_copter", 12, "RTL", 1),
        *(
            pytest.param(model, distance_m, mode, whose, marks=pytest.mark.slow)
            for model in ("px4_copter", "arducopter")
            for distance_m in (8, 12, 25)
            for mode in ("RTL", "LOITER")
            for whose in (1, 2)
            if (model, distance_m, mode, whose) != ("px4_copter", 12, "RTL", 1)
        ),
    ],
)
def test_multirotors_keep_apart_from_one_whose_pilot_stops_it_or_sends_it_back(
    fly: Fly, model: str, distance_m: float, mode: str, whose: int
) -> None:
    """It comes back through their column at up to twice their speed; by climbing alone they missed it by 0.1 to 1.1 m.

    They stop, or fly to the side; a vehicle that does so isn't reported as disobedient.
    """
    vehicles = [{"id": each, "model": model, "role": "leader" if each == 1 else "follower"} for each in range(1, 5)]
    index = {"shape": "custom", "slots_m": {each: [-distance_m * (each - 1), 0, 0] for each in range(2, 5)}}
    run = fly(
        duration_s=20,
        vehicles=vehicles,
        start={"in_air": True, "tolerance_m": 1},
        finish={"loiter_s": 0},
        formation=index,
        path={"speed_mps": 5, "waypoints_m": [[0, 0, 60], [400, 0, 60]]},
        safety={"separation_m": 3},
        faults=[{"at_s": 8, "vehicles": [whose], "kind": "pilot", "mode": mode}],
    )
    assert run.to_dict()["safety"]["min_separation_m"] > 4.5
    assert "disobeys" not in (run.run_dir / "events.jsonl").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(("model", "distance_m", "whose"), [("arducopter", 12, 1), ("px4_copter", 25, 2)])
def test_multirotors_that_hover_keep_apart_from_one_that_is_sent_home_over_a_long_link(
    fly: Fly, model: str, distance_m: float, whose: int
) -> None:
    """When detected by its acceleration, it passed at 4.3 m; when they dithered in front of it, at 2.6 m."""
    run = fly(
        duration_s=30,
        vehicles=[{"id": each, "model": model, "role": "leader" if each == 1 else "follower"} for each in range(1, 5)],
        start={"in_air": True, "tolerance_m": 1},
        finish={"loiter_s": 0},
        formation={"shape": "custom", "slots_m": {each: [-distance_m * (each - 1), 0, 0] for each in range(2, 5)}},
        path={"speed_mps": 5, "waypoints_m": [[0, 0, 60], [400, 0, 60]]},
        links={"default": {"delay_ms": 200}},
        orders=[{"at_s": 10, "order": "speed 0"}],
        faults=[{"at_s": 20, "vehicles": [whose], "kind": "pilot", "mode": "RTL"}],
    )
    assert run.to_dict()["safety"]["min_separation_m"] > 6.0
