"""What vehicles tell by their parameters bounds what they are commanded; where it isn't enough none takes off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from airlink import mavlink as m
from airlink.messages.command import ParamSet
from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from tests.flights.in_memory import World

GROUND: dict[str, Any] = {
    "start": {"in_air": False},
    "vehicles": {"count": 2},
    "formation": {"shape": "line", "spacing_m": 40},
    "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 130]]},
    "telemetry": {"rate_hz": 5},
}
READ = PreFlightOptions(parameters=True)
FENCE = {"FENCE_ENABLE": 1}


def flown(seconds: float, parameters: Mapping[str, float], **keys: Any) -> World:
    """Return a flight in which the second vehicle has parameters of its own."""
    world = World(caution=READ, **GROUND | keys)
    for name, value in parameters.items():
        kind = m.MAV_PARAM_TYPE_REAL32
        assert world.vehicle(2).parameters.set(ParamSet(2, m.MAV_COMP_ID_AUTOPILOT1, name, value, kind))
    world.run(seconds)
    return world


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        (
            FENCE | {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 120},
            "vehicle 2: FENCE_ALT_MAX: found 120; allowed: 147 m or more, for path, slots and the circles at the end, "
            "or another path.waypoints_m",
        ),
        (FENCE | {"FENCE_TYPE": 2, "FENCE_RADIUS": 900}, "vehicle 2: FENCE_RADIUS: found 900; allowed: "),
        ({"TECS_CLMB_MAX": 0.3}, "what vehicles tell (vehicle 2: TECS_CLMB_MAX 0.3) isn't enough for path.waypoints_m"),
    ],
)
def test_where_path_or_slots_need_more_none_takes_off(parameters: dict[str, float], why: str) -> None:
    world = flown(8.0, parameters)
    assert world.station.flight.phase is Phase.FAILED
    assert str(world.station.phase_machine.failure).startswith(why)
    assert not any(each.pilot.condition.armed for each in world.fleet.vehicles)


def test_where_they_suffice_they_bound_what_is_commanded() -> None:
    """So does a fence that is wide enough, and one that is off bounds nothing."""
    world = flown(8.0, FENCE | {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 200, "TECS_SINK_MAX": 1.5})
    assert world.station.phase_machine.failure is None
    models, each = world.station.controller.models, list(world.station.vehicles.values())
    assert [round(model.climb_max_mps, 2) for model in models] == [3.0, 1.5]
    assert each[0].autopilot.heights_m is None
    assert each[1].autopilot.heights_m is not None
    assert each[1].autopilot.heights_m[1] == pytest.approx(198.0, abs=0.1)
    assert world.station.controller.guidance.climb_max_mps == 1.5


def test_in_the_air_heights_are_held_within_a_fence_that_is_too_low() -> None:
    """It is taken over in flight, where refusing would leave it without a commander."""
    keys = {
        "start": {"in_air": True, "run_in_s": 6},
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [900, 0, 100]]},
    }
    world = flown(12.0, FENCE | {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 97}, **keys)
    assert world.station.phase_machine.failure is None
    column = next(each.index for each in world.station.vehicles.values() if each.identity.system == 2)
    commanded_m = [tick.setpoints[column][2] for tick in world.recorder.ticks if tick.active[column]]
    assert commanded_m
    assert max(commanded_m) <= 95.0
