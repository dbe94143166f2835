"""Ground speed and drift in the scenario's wind, of a leader or formation that keeps its course by a crab angle."""

from __future__ import annotations

import numpy as np

from flight_model.arrays import Array
from flight_model.fence_geometry import Drift
from formation_scenario.model import Scenario


def wind_mps(scenario: Scenario, course_rad: Array) -> tuple[Array, Array]:
    """Return the wind that carries the leader, along courses and to their right, m/s."""
    north_mps, east_mps = scenario.drift_mps
    cos, sin = np.cos(course_rad), np.sin(course_rad)
    return north_mps * cos + east_mps * sin, east_mps * cos - north_mps * sin


def over_ground_mps(scenario: Scenario, course_rad: Array, airspeed_mps: float | Array) -> Array:
    """Return the leader's ground speed along courses at airspeeds, m/s, with the crab angle that the wind requires."""
    along_mps, crosswind_mps = wind_mps(scenario, course_rad)
    return np.sqrt(np.maximum(airspeed_mps**2 - crosswind_mps**2, 0.0)) + along_mps


def drift(scenario: Scenario) -> Drift:
    """Return the drift of a formation at its path's speed in the scenario's wind; multirotors don't drift."""
    speed_mps = scenario.path.fastest_mps
    return Drift(speed_mps, *scenario.drift_mps, speed_mps + scenario.wind.speed_mps)
