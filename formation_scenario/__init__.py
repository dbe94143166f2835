"""The scenario: YAML read into immutable typed objects, and the slots, path and start states that follow from it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flight_model.curve import PathPoint
    from flight_model.path import PathError, PathPoints, SplinePath
    from formation_scenario.begin_and_end import StartStates, start_states
    from formation_scenario.errors import Problem, ScenarioError
    from formation_scenario.ground import Ground
    from formation_scenario.links import Impairment, LinkStep
    from formation_scenario.load import dump_scenario, load_scenario
    from formation_scenario.model import Scenario
    from formation_scenario.shapes import SlotStep, slot_schedule, slot_table, slots
    from formation_scenario.vehicles import Vehicle, VehicleModel

_HOME = {
    "Ground": "formation_scenario.ground",
    "Impairment": "formation_scenario.links",
    "LinkStep": "formation_scenario.links",
    "PathError": "flight_model.path",
    "PathPoint": "flight_model.curve",
    "PathPoints": "flight_model.path",
    "Problem": "formation_scenario.errors",
    "Scenario": "formation_scenario.model",
    "ScenarioError": "formation_scenario.errors",
    "SlotStep": "formation_scenario.shapes",
    "SplinePath": "flight_model.path",
    "StartStates": "formation_scenario.begin_and_end",
    "Vehicle": "formation_scenario.vehicles",
    "VehicleModel": "formation_scenario.vehicles",
    "dump_scenario": "formation_scenario.load",
    "load_scenario": "formation_scenario.load",
    "slot_schedule": "formation_scenario.shapes",
    "slot_table": "formation_scenario.shapes",
    "slots": "formation_scenario.shapes",
    "start_states": "formation_scenario.begin_and_end",
}


def __getattr__(name: str) -> object:
    """Import a name on first use, so that a program that only parses an order doesn't load splines and solvers."""
    if name not in _HOME:
        raise AttributeError(f"module 'formation_scenario' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


__all__ = [
    "Ground",
    "Impairment",
    "LinkStep",
    "PathError",
    "PathPoint",
    "PathPoints",
    "Problem",
    "Scenario",
    "ScenarioError",
    "SlotStep",
    "SplinePath",
    "StartStates",
    "Vehicle",
    "VehicleModel",
    "dump_scenario",
    "load_scenario",
    "slot_schedule",
    "slot_table",
    "slots",
    "start_states",
]
