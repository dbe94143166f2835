"""The scenario: YAML -> frozen typed objects; slots, path geometry and start states that follow from it."""

from formation_scenario.arrangement import SlotStep, slot_schedule, slot_table
from formation_scenario.errors import Problem, ScenarioError
from formation_scenario.ground import Ground, ground_of
from formation_scenario.lifted_path import leader_path
from formation_scenario.links import Impairment, LinkStep
from formation_scenario.load import dump_scenario, load_scenario
from formation_scenario.model import Scenario
from formation_scenario.path import PathError, PathPoint, PathPoints, SplinePath
from formation_scenario.placement import StartStates, start_states
from formation_scenario.shapes import slots
from formation_scenario.vehicles import Vehicle, VehicleModel

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
    "ground_of",
    "leader_path",
    "load_scenario",
    "slot_schedule",
    "slot_table",
    "slots",
    "start_states",
]
