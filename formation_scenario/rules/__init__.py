"""Rules between keys, for scenarios in which every key is valid by itself."""

from __future__ import annotations

from formation_scenario.errors import Problem
from formation_scenario.model import Scenario
from formation_scenario.rules import events, surroundings, vehicles
from formation_scenario.source import Source

RULES = (
    vehicles.identities,
    vehicles.roles,
    vehicles.endpoints,
    vehicles.speeds,
    vehicles.hovering,
    events.references,
    events.disturbances,
    events.faults,
    events.traces,
    events.bursts,
    vehicles.slots,
    vehicles.changes,
    vehicles.orders,
    vehicles.consensus,
    surroundings.row,
    surroundings.path,
    surroundings.places,
    surroundings.wind,
    surroundings.terrain,
    vehicles.avoidance,
    surroundings.fence,
    events.expectations,
)
"""Each yields the problems that it finds, in the order of the scenario's keys."""


def inconsistencies(scenario: Scenario, source: Source) -> list[Problem]:
    """Return every violation of a rule between keys."""
    return [problem for rule in RULES for problem in rule(scenario, source)]
