"""Before take-off: whether what is left lasts for the planned flight, the way home and the reserve."""

import math
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.features.batteries.before_take_off import TAKE_OFF_S, TURN_TO_LAND_S, lacking, planned_s
from gcs_formation.features.batteries.check_warnings import full_batteries
from gcs_formation.features.batteries.way_home import LANDING_S
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from tests.flights.conftest import scenario
from tests.flights.in_memory import World

GROUND: dict[str, Any] = {
    "start": {"in_air": False},
    "vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "battery": {"charged_percent": 60}}],
    "formation": {"shape": "line", "spacing_m": 40},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]},
    "duration_s": 100,
}
NEEDED_S = TAKE_OFF_S + 100.0 + 100.0 + LANDING_S
"""100 s at 22 m/s lead 2200 m away, and the way home takes as long."""


def test_planned_time_is_take_off_path_way_home_and_landing() -> None:
    assert planned_s(load_scenario(scenario(**GROUND)), (0.0, 0.0)) == pytest.approx(NEEDED_S, abs=0.5)


@pytest.mark.parametrize(("then", "waits_s"), [("loiter", 0.0), ("rtl", 0.0), ("land", 2 * TURN_TO_LAND_S[False])])
def test_where_all_land_the_last_one_waits_for_the_others(then: str, waits_s: float) -> None:
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3}]
    planned = load_scenario(scenario(**GROUND | {"vehicles": vehicles, "finish": {"then": then}}))
    assert planned_s(planned, (0.0, 0.0)) == pytest.approx(NEEDED_S + waits_s, abs=0.5)


def test_what_is_left_must_last_for_that_and_the_reserve() -> None:
    planned = load_scenario(scenario(**GROUND))
    assert lacking(planned, 0.61, NEEDED_S / 0.4, (0.0, 0.0)) == ""
    assert lacking(planned, 0.59, NEEDED_S / 0.4, (0.0, 0.0)) == (
        "battery: found 59% left; allowed: 60% or more, for 6 min of flight and way home, of 16 min on a full one, and "
        "the reserve of 20% (safety.battery). Charge it, or plan a shorter flight"
    )


def test_where_use_is_unknown_the_reserve_alone_counts() -> None:
    planned = load_scenario(scenario(**GROUND))
    assert lacking(planned, 0.2, math.nan, (0.0, 0.0)) == ""
    assert lacking(planned, 0.19, math.nan, (0.0, 0.0)).startswith("battery: found 19% left; allowed: 20% or more")


def flown(**battery: Any) -> World:
    world = World(caution=PreFlightOptions(parameters=True), **GROUND, safety={"battery": battery})
    world.run(7.0)
    return world


def test_nobody_takes_off_with_a_battery_that_does_not_last() -> None:
    world = flown(endurance_s=700)
    assert world.station.flight.phase is Phase.FAILED
    assert str(world.station.phase_machine.failure).startswith("vehicle 2: battery: found 5")
    assert not any(each.pilot.condition.armed for each in world.fleet.vehicles)


def test_it_is_only_said_where_that_is_asked_for() -> None:
    world = flown(endurance_s=700, before_take_off="warn")
    assert world.station.phase_machine.failure is None
    assert any("battery: found 5" in text for text in world.words("parameters"))


def test_a_battery_of_unknown_use_refuses_nothing() -> None:
    assert flown().station.phase_machine.failure is None


def test_check_says_that_a_full_battery_does_not_last() -> None:
    def warned(endurance_s: float) -> list[str]:
        keys = GROUND | {"safety": {"battery": {"endurance_s": endurance_s}}}
        return list(full_batteries(load_scenario(scenario(**keys))))

    assert warned(500) == []
    assert [each.partition(":")[0] for each in warned(400)] == ["safety.battery.endurance_s"]
