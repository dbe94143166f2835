"""The scenario: YAML read into immutable typed objects, and the slots, path and start states derived from it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from formation_scenario.fields import Problem, ScenarioError
    from formation_scenario.load import dump_scenario, load_scenario
    from formation_scenario.model import Scenario
    from formation_scenario.vehicles import Vehicle


_HOME = {
    "Problem": "formation_scenario.fields",
    "Scenario": "formation_scenario.model",
    "ScenarioError": "formation_scenario.fields",
    "Vehicle": "formation_scenario.vehicles",
    "dump_scenario": "formation_scenario.load",
    "load_scenario": "formation_scenario.load",
}


def __getattr__(name: str) -> object:
    """Import a name on first use, so that a program that only parses an order doesn't load splines and solvers."""
    if name not in _HOME:
        raise AttributeError(f"module 'formation_scenario' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


__all__ = [
    "Problem",
    "Scenario",
    "ScenarioError",
    "Vehicle",
    "dump_scenario",
    "load_scenario",
]
