"""The scenario on a command line."""

from __future__ import annotations

from pathlib import Path

from airlink.cli.status import fail
from formation_scenario import Scenario, ScenarioError, load_scenario


def load(scenario: Path, overrides: tuple[str, ...]) -> Scenario:
    """Return a scenario, or end with what's wrong in it."""
    try:
        return load_scenario(scenario, overrides)
    except ScenarioError as error:
        fail(str(error))
