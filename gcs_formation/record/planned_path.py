"""Figures of the planned path, which `check` says before the flight, in the summary."""

from __future__ import annotations

from flight_model.legs.deviation import deviation
from formation_scenario import Scenario


def planned_path(scenario: Scenario) -> dict[str, float]:
    """Return the planned path's greatest distance from its legs and outside its waypoints' heights, m, and where."""
    return deviation(scenario.written_path, scenario.path.waypoints_m)._asdict()
