"""`--set-parameters`: what the check asks for is set before take-off, and restored after the flight."""

from typing import Any

import pytest

from airlink import mavlink as m
from airlink.messages.command import ParamSet
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from tests.flights.in_memory import World

SETS = PreFlightOptions(parameters=True, set_parameters=True)
GROUND: dict[str, Any] = {"start": {"in_air": False}, "vehicles": {"count": 2}, "formation": {"shape": "follower"}}
FAILSAFE = {"FS_GCS_ENABL": 0, "FS_LONG_ACTN": 0}


def put(world: World, name: str, value: float) -> None:
    asked = ParamSet(2, m.MAV_COMP_ID_AUTOPILOT1, name, value, m.MAV_PARAM_TYPE_REAL32)
    assert world.vehicle(2).parameters.set(asked)


def values(world: World, *names: str) -> list[float]:
    return [world.vehicle(2).parameters[name] for name in names]


def begun(caution: PreFlightOptions, **keys: Any) -> World:
    world = World(caution=caution, **GROUND | keys)
    for name, value in {"AIRSPEED_MAX": 20, "TKOFF_ALT": 30, **FAILSAFE}.items():
        put(world, name, value)
    world.run(6.0)
    return world


def restored(world: World) -> list[str]:
    restoration = world.station.gate.restoration
    restoration.begin(world.clock.now())
    world.network.run(lambda: restoration.over(world.clock.now()))
    return restoration.left


def test_they_are_set_shown_with_both_values_and_restored() -> None:
    world = begun(SETS)
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT") == [28.0, 50.0]
    assert {"sets AIRSPEED_MAX: from 20 to 28", "sets TKOFF_ALT: from 30 to 50"} <= set(world.words("parameters"))
    assert world.station.phase_machine.failure is None
    assert values(world, *FAILSAFE) == [0.0, 0.0]  # only its owner sets these
    assert any("FS_GCS_ENABL: found 0" in each for each in world.words("parameters"))
    assert restored(world) == []
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT", *FAILSAFE) == [20.0, 30.0, 0.0, 0.0]
    assert "restored AIRSPEED_MAX: from 28 to 20" in world.words("parameters")


def test_they_are_restored_after_a_failure_too() -> None:
    """The run is over, and its station sends nothing but what restores them."""
    world = begun(SETS)
    world.station.phase_machine.fail("for a test", world.clock.now(), begun=False)
    assert world.station.flight.phase is Phase.FAILED
    ticks = len(world.recorder.ticks)
    assert restored(world) == []
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT") == [20.0, 30.0]
    assert len(world.recorder.ticks) == ticks


def test_what_cannot_be_restored_is_said() -> None:
    world = begun(SETS)
    world.inject(2, "freeze")
    assert restored(world) == ["vehicle 2: TKOFF_ALT is 50, was 30, AIRSPEED_MAX is 28, was 20"]
    assert any(each.startswith("couldn't be restored: TKOFF_ALT is 50, was 30") for each in world.words("parameters"))


def test_without_consent_nothing_is_set() -> None:
    world = begun(PreFlightOptions(parameters=True))
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT") == [20.0, 30.0]
    assert world.station.flight.phase is Phase.FAILED
    assert not world.station.gate.restoration.has_some


def test_a_dry_run_says_what_would_be_set() -> None:
    world = begun(PreFlightOptions(parameters=True, rehearse=True, set_parameters=True))
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT") == [20.0, 30.0]
    said = "; ".join(world.words("parameters"))
    assert "would set TKOFF_ALT: from 30 to 50; would set AIRSPEED_MAX: from 20 to 28" in said


def test_nothing_is_set_in_the_air() -> None:
    keys = {"start": {"in_air": True, "run_in_s": 6}}
    world = begun(SETS, **keys)
    assert values(world, "AIRSPEED_MAX", "TKOFF_ALT") == [20.0, 30.0]


@pytest.mark.parametrize(
    ("model", "speed_mps", "name", "before", "asked"),
    [
        ({"hovers": True, "speed_min_mps": 0, "speed_max_mps": 8}, 5, "WPNAV_SPEED", 300.0, 800.0),
        ({"firmware": "px4"}, 22, "FW_AIRSPD_MAX", 20.0, 28.0),
        ({"firmware": "px4"}, 22, "NAV_LOITER_RAD", 150.0, 100.0),
    ],
)
def test_so_are_those_of_other_families(
    model: dict[str, Any], speed_mps: float, name: str, before: float, asked: float
) -> None:
    """In the units that they have there."""
    path = {"speed_mps": speed_mps, "waypoints_m": [[0, 0, 60], [900, 0, 60]]}
    world = World(caution=SETS, **GROUND | {"vehicles": {"count": 2, "model": model}, "path": path})
    put(world, name, before)
    world.run(4.0)
    assert values(world, name) == [pytest.approx(asked)]
    assert restored(world) == []
    assert values(world, name) == [pytest.approx(before)]
