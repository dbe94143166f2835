"""What precedes the first command where no feature examines vehicles."""

from __future__ import annotations

from gcs_formation.mission.gate import PreFlightOptions
from gcs_formation.phases import Phase
from tests.flights.in_memory import Between, World


def unexamined(caution: PreFlightOptions) -> World:
    world = World(Between, caution, vehicles={"count": 2}, start={"in_air": True, "run_in_s": 1})
    world.station.gate._examinations.clear()
    world.station.gate.checks.clear()
    return world


def test_vehicles_are_commanded_once_all_are_ready() -> None:
    world = unexamined(PreFlightOptions(parameters=True))
    assert not world.station.gate.passed
    world.run(3.0)
    assert world.station.gate.passed
    assert world.station.flight.phase is Phase.ASSEMBLING
    assert world.words("parameters") == []


def test_the_operators_word_is_awaited_all_the_same() -> None:
    world = unexamined(PreFlightOptions(parameters=True, confirm=True))
    world.run(3.0)
    assert world.station.gate.awaits_word
    assert world.station.flight.phase is Phase.CONNECTING
