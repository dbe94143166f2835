"""How long the run-in is where the scenario doesn't say: as usual, or as long as it stays inside the fence."""

from __future__ import annotations

import math

import numpy as np

from flight_model.fence_geometry import CHECKED_M, Flyers, room_along_m
from flight_model.path import FlightPath
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import models_by_index, slot_schedule
from formation_scenario.wind_triangle import drift

SHORTEST_S = 10.0
"""Shortest run-in that a fence makes, s: with less room the fence's check says what is outside."""
BETWEEN_M = 5.0


def run_in_inside_fence_s(scenario: Scenario, path: FlightPath) -> float | None:
    """Return the longest run-in on which every slot has room to turn away from the fence, s.

    `SHORTEST_S` where there is less; None where the usual one has. A formation that isn't assembled then flies holding
    patterns.
    """
    fence = scenario.fence
    if fence is None or fence.sides is None:
        return None
    before_m = np.arange(0.0, scenario.run_in_m + BETWEEN_M, BETWEEN_M)
    points, (forward_m, right_m, _) = path.at(-before_m), slot_schedule(scenario)[0].positions_m.T
    flyers = Flyers(forward_m, right_m, np.array([each.turn_rate_max_rps for each in models_by_index(scenario)]))
    line = points.north_m, points.east_m, points.course_rad
    _, room_m = room_along_m(fence.sides, line, flyers, drift(scenario))
    cramped = room_m.min(axis=0) < CHECKED_M
    if not cramped.any():
        return None
    longest_s = (int(cramped.argmax()) - 1) * BETWEEN_M / scenario.path.begin_mps
    return max(math.floor(10.0 * longest_s) / 10.0, SHORTEST_S)
