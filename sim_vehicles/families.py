"""Which autopilot families there are emulators of."""

from __future__ import annotations

from formation_scenario import Scenario, Vehicle

EMULATED = ("emulator", "arduplane")
"""The scenario's `autopilot` of vehicles that can be emulated; all of them speak as ArduPlane does."""


def without_emulator(scenario: Scenario) -> str:
    """Return which vehicles' autopilot families have no emulator, in words; "" if all have one."""
    told = [_named(vehicle) for vehicle in scenario.vehicles if vehicle.autopilot not in EMULATED]
    return f"{', '.join(told)}: there is no emulator of that; allowed here: {', '.join(EMULATED)}" if told else ""


def stand_ins(scenario: Scenario) -> str:
    """Return which vehicles of a real autopilot family are emulated, in words; "" if none is."""
    told = [_named(vehicle) for vehicle in scenario.vehicles if vehicle.autopilot != "emulator"]
    return f"{', '.join(told)} {'is' if len(told) == 1 else 'are'} emulated" if told else ""


def _named(vehicle: Vehicle) -> str:
    return f"vehicle {vehicle.vehicle_id} ({vehicle.autopilot})"
