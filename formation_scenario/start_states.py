"""Initial states of the vehicles: in their slots, or on the ground where they take off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flight_model.arrays import Array, offset_points
from formation_scenario.model import Scenario
from formation_scenario.slot_assignment import slot_table
from formation_scenario.slot_frame import axis_rad


@dataclass(frozen=True, slots=True)
class StartState:
    """State of a vehicle at boot: NED from the origin, height upwards, heading clockwise from north."""

    north_m: float
    east_m: float
    height_m: float = 0.0
    heading_rad: float = 0.0
    airspeed_mps: float = 0.0
    in_air: bool = False


def start_states(scenario: Scenario) -> list[StartState]:
    """Return each vehicle's start state, in the scenario's order.

    The leader starts `run_in_s` before the path's start, followers at their slots. In the air each follower is
    `start.offset_m` from its slot, and higher where the terrain's clearance requires it. On the ground they stand in a
    row if the scenario says so; otherwise those nearer to others than `safety.separation_m` are placed farther back.
    """
    leader = scenario.written_path.at(-scenario.run_in_m)
    in_air, slots, positions = scenario.start.in_air, slot_table(scenario), np.zeros((len(scenario.vehicles), 3))
    slots = slots + np.array(scenario.start.offset_m) if in_air else _on_ground(scenario, slots)
    positions[[vehicle.role == "follower" for vehicle in scenario.vehicles]] = slots
    in_row = not in_air and scenario.start.row_m is not None
    axis = leader.course_rad if in_row else axis_rad(scenario.formation.frame, leader.course_rad, leader.course_rad)
    north_m, east_m = offset_points(leader.north_m, leader.east_m, axis, positions[:, 0], positions[:, 1])
    height_m = leader.height_m + positions[:, 2] if in_air else np.zeros_like(north_m)
    if in_air and scenario.terrain is not None:
        height_m = np.fmax(height_m, scenario.ground.height(north_m, east_m) + scenario.terrain.clearance_m)
    speed_mps = scenario.path.begin_mps if in_air else 0.0
    each = zip(north_m.tolist(), east_m.tolist(), height_m.tolist(), strict=True)
    return [StartState(*position, leader.course_rad, speed_mps, in_air) for position in each]


def start_positions_m(scenario: Scenario) -> Array:
    """Return the positions (V, 3) at which the vehicles start: north, east and height, m."""
    return np.array([(each.north_m, each.east_m, each.height_m) for each in start_states(scenario)])


def _on_ground(scenario: Scenario, slots: Array) -> Array:
    if scenario.start.row_m is None:
        return _spread(slots, scenario.safety.separation_m)
    lateral_m = scenario.start.row_m * np.arange(1.0, len(slots) + 1.0)
    return np.column_stack((np.zeros(len(slots)), lateral_m, np.zeros(len(slots))))


def _spread(slots: Array, separation_m: float) -> Array:
    """Return slots moved so that they are at least `separation_m` apart horizontally, and from the leader.

    A follower that is too near to an earlier one moves straight back, in steps of twice the separation.
    """
    taken = [np.zeros(2)]
    step = np.array([2.0 * separation_m, 0.0])
    for slot in slots[:, :2]:
        position = slot.copy()
        while min(np.hypot(*(position - other)) for other in taken) < separation_m * (1.0 - 1e-9):
            position = position - step
        taken.append(position)
    return np.column_stack((np.array(taken[1:]).reshape(-1, 2), slots[:, 2]))
