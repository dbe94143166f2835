"""Which autopilot families there are emulators of."""

from __future__ import annotations

from collections.abc import Iterator

from formation_scenario import Scenario, Vehicle

EMULATED = ("emulator", "arduplane")
"""The scenario's `autopilot` of vehicles that can be emulated; all of them speak as ArduPlane does."""


def without_emulator(scenario: Scenario) -> Iterator[str]:
    """Yield each vehicle whose autopilot family has no emulator, in words."""
    for vehicle in scenario.vehicles:
        if vehicle.autopilot not in EMULATED:
            yield f"{_named(vehicle)}: there is no emulator of that; allowed here: {', '.join(EMULATED)}"


def stand_ins(scenario: Scenario) -> str:
    """Return which vehicles of a real autopilot family are emulated, in words; "" if none is."""
    told = [_named(vehicle) for vehicle in scenario.vehicles if vehicle.autopilot != "emulator"]
    return f"{', '.join(told)} {'is' if len(told) == 1 else 'are'} emulated" if told else ""


def _named(vehicle: Vehicle) -> str:
    return f"vehicle {vehicle.vehicle_id} ({vehicle.autopilot})"
