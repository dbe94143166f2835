"""`finish: {then: land}`: everybody lands by himself, one after another, and is disarmed; or none takes off."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import pytest

import gcs_formation
from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import ParamRequestRead, ParamValue
from formation_scenario import load_scenario
from gcs_formation.features.ending.approach_heights import ApproachHeights
from gcs_formation.features.ending.landing_check import LandingCheck
from gcs_formation.features.ending.landing_order import lowest_circle_m
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from sim_vehicles.autopilot.modes_and_failsafe import Condition
from tests.flights.conftest import scenario
from tests.flights.in_memory import World
from tests.flights.test_landing import plane

LAND = {"then": "land", "loiter_s": 0}
COPTERS_PATH = {"speed_mps": 5, "waypoints_m": [[0, 0, 30], [300, 0, 30], [600, 0, 30]]}
PX4_PATH = {"speed_mps": 14, "waypoints_m": [[0, 0, 60], [2000, 0, 60], [4000, 0, 60]]}
ON_GROUND: dict[str, Any] = {"start": {"in_air": False}, "duration_s": 10, "finish": LAND, "telemetry": {"rate_hz": 5}}
FAMILIES: dict[str, dict[str, Any]] = {
    "ArduPlane": {"formation": {"shape": "diamond", "spacing_m": 30}, "vehicles": {"count": 4}},
    "ArduPlane by its mission": {
        "formation": {"shape": "line", "spacing_m": 30},
        "vehicles": {"count": 4, "landing": {"approach_m": 500}},
    },
    "ArduCopter": {
        "formation": {"shape": "diamond", "spacing_m": 12},
        "vehicles": {"count": 4, "model": "arducopter"},
        "path": COPTERS_PATH,
    },
    "PX4": {
        "formation": {"shape": "diamond", "spacing_m": 30},
        "vehicles": {"count": 4, "model": "px4", "landing": {}},
        "path": PX4_PATH,
    },
    "PX4 multirotor": {
        "formation": {"shape": "diamond", "spacing_m": 12},
        "vehicles": {"count": 4, "model": "px4_copter"},
        "path": COPTERS_PATH,
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("from_deg", [None, 0, 120, 240])
@pytest.mark.parametrize("family", FAMILIES)
def test_everybody_lands_and_is_disarmed(family: str, from_deg: int | None) -> None:
    keys = ON_GROUND | FAMILIES[family]
    if from_deg is not None:
        towards = math.radians(from_deg + 180.0)
        keys |= {"wind": {"velocity_mps": [4.0 * math.cos(towards), 4.0 * math.sin(towards), 0.0]}}
    world, min_m = World(**keys), math.inf
    while not world.station.flight.ended:
        world.run(0.2)
        flying = [each.body.state for each in world.fleet.vehicles if each.pilot.condition is Condition.FLYING]
        places = [(each.north_m, each.east_m, each.height_m) for each in flying]
        if world.station.flight.phase in (Phase.ENDING, Phase.LOITERING):
            min_m = min([min_m, *(math.dist(one, other) for one, other in combinations(places, 2))])
    assert world.station.phase_machine.failure is None
    assert [each.pilot.condition for each in world.fleet.vehicles] == [Condition.DISARMED] * 4
    assert list((world.station.phase_machine.not_landed or {}).values()) == [None] * 4
    assert min_m > world.station.scenario.safety.kept_m


@pytest.mark.slow
@pytest.mark.parametrize("family", ["ArduCopter", "PX4 multirotor"])
def test_multirotors_that_begin_in_the_air_tell_their_homes_and_land_there(family: str) -> None:
    world = World(**ON_GROUND | FAMILIES[family] | {"start": {"in_air": True, "run_in_s": 6}})
    world.network.run(lambda: world.station.flight.ended)
    assert world.station.phase_machine.failure is None
    assert [each.pilot.condition for each in world.fleet.vehicles] == [Condition.DISARMED] * 4


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 4])
def test_they_land_in_order_though_one_followed_nothing_as_they_separated(number: int) -> None:
    """The others climb above it; when it follows again, who lands after others is above them again."""
    fault = {"at_s": 9.8, "until_s": 25, "vehicles": [number], "kind": "ignore"}
    world, min_m = World(**ON_GROUND | FAMILIES["PX4"] | {"faults": [fault]}), math.inf
    while not world.station.flight.ended:
        world.run(0.2)
        flying = [each.body.state for each in world.fleet.vehicles if each.pilot.condition is Condition.FLYING]
        places = [(each.north_m, each.east_m, each.height_m) for each in flying]
        if world.station.flight.phase in (Phase.ENDING, Phase.LOITERING):
            min_m = min([min_m, *(math.dist(one, other) for one, other in combinations(places, 2))])
    assert world.times_s("disobeys", number)
    assert world.station.phase_machine.failure is None
    assert [each.pilot.condition for each in world.fleet.vehicles] == [Condition.DISARMED] * 4
    assert min_m > world.station.scenario.safety.kept_m


def refused(**keys: Any) -> str:
    """Return why a flight ended before anybody was armed."""
    world = World(**ON_GROUND | keys)
    world.network.run(lambda: world.station.flight.ended)
    assert not any(each.pilot.condition.armed for each in world.fleet.vehicles) or keys.get("start")
    return str(world.station.phase_machine.failure)


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"vehicles": {"count": 2, "model": "px4"}, "path": PX4_PATH}, "vehicle 1 can't land by itself"),
        (
            {"vehicles": {"count": 2}, "formation": {"shape": "follower", "spacing_m": 40}},
            "vehicle 1 would come in over the place of vehicle 2",
        ),
        (
            {"vehicles": {"count": 2}, "start": {"in_air": True, "run_in_s": 6}},
            "vehicle 1 lands where it took off, and that was not seen",
        ),
        (
            {"vehicles": {"count": 2, "landing": {"touchdown_m": [0, 0], "course_deg": 90}}},
            "vehicle 1 would come in over the place of vehicle 2",
        ),
    ],
)
def test_where_somebody_can_not_land_none_takes_off(keys: dict[str, Any], why: str) -> None:
    allowed = "allowed: rtl, loiter, or another place or a stored landing for it"
    assert refused(**keys) == f"finish.then: found land, but {why}; {allowed}"


def test_others_wait_above_the_approach_that_a_vehicles_own_parameter_says() -> None:
    """With AUTOLAND_WP_ALT 90 a plane that lands would climb through those that circle from 70 m on."""
    vehicle = plane(1, 0.0, 0.0)
    vehicles = {vehicle.identity: vehicle}
    heights = ApproachHeights(vehicles)
    asked = [message for _, message in heights.requests(Instant(0)) if isinstance(message, ParamRequestRead)]
    assert [each.param_id for each in asked] == ["AUTOLAND_WP_ALT"]
    assert not heights.passed
    assert lowest_circle_m(vehicles) == 70.0
    heights.take_item(vehicle, ParamValue("AUTOLAND_WP_ALT", 90.0, m.MAV_PARAM_TYPE_INT16, 1, 0), Instant(0))
    assert heights.passed
    assert lowest_circle_m(vehicles) == 105.0


@pytest.mark.parametrize(
    ("checked", "keys", "height_m"),
    [
        (True, {}, 90.0),  # the order may come by `tell`
        (False, {"orders": [{"at_s": 5, "order": "land"}]}, 90.0),
        (False, {}, 55.0),  # nobody asks, and nobody is told to land
    ],
)
def test_the_order_to_land_finds_the_height_of_approaches_read_before_the_take_off(
    checked: bool, keys: dict[str, Any], height_m: float
) -> None:
    own = {"count": 1, "autopilot_parameters": {"AUTOLAND_WP_ALT": 90}}
    world = World(caution=PreFlightOptions(parameters=checked), vehicles=own, start={"in_air": False}, **keys)
    world.network.run(lambda: world.station.gate.passed)
    assert [each.autopilot.own_approach_m for each in world.station.cycle.each] == [height_m]


def test_a_flight_that_goes_on_is_not_refused_for_its_landing() -> None:
    """Refused, vehicles that fly would be left without anybody who commands them."""
    vehicle = plane(1, 0.0, 0.0)
    vehicle.take_off.stood = None
    planned = load_scenario(scenario(finish=LAND))
    check = LandingCheck(planned, {vehicle.identity: vehicle})
    assert not check.passed
    check.only_warns = True
    assert check.passed
    for second in range(30):
        check.requests(after(Instant(0), 2.0 * second))
    assert "that was not seen" in str(check.refusal(ready=True))
    assert check.refusal(ready=True) is None, "it is said once"


@pytest.mark.slow
def test_the_summary_says_who_has_landed(tmp_path) -> None:
    keys = scenario(**ON_GROUND | FAMILIES["ArduCopter"])
    found = gcs_formation.run(keys, clock="virtual", out=tmp_path / "run").to_dict()
    each = {str(number): {"landed": True, "why": None} for number in range(1, 5)}
    assert found["finish"] == {"then": "land", "vehicles": each}
    assert (found["undone"], found["failure"]) == ([], None)
