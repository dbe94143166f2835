"""Writes the path of a scenario, and its slots' paths, for other programs (`check --export`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flight_model.arrays import Array, offset_points
from flight_model.stops.timetable import Timetable
from formation_scenario import Scenario
from formation_scenario.fields import VehicleRef
from formation_scenario.mission_fence import file_fence
from formation_scenario.mission_files.export import NamedPath, export
from formation_scenario.mission_files.mission import MissionFileError
from formation_scenario.sampled_path import with_turns
from formation_scenario.slot_assignment import slot_schedule, vehicles_by_index
from formation_scenario.slot_frame import axis_rad

SAMPLE_M = 2.0
"""Distance of the points by which a path is known to the exporter, which thins them."""
MISSIONS = (".plan", ".waypoints")
"""Formats that hold one path."""


def export_path(scenario: Scenario, file: Path, vehicle: VehicleRef | None = None) -> None:
    """Write the leader's path and, in a format that holds several, each follower's slot along it.

    Slots are those of the formation at the start, by the path's course.

    Args:
        scenario: whose path is written.
        file: the file to write; its suffix names the format.
        vehicle: write the path of this vehicle alone.

    Raises:
        MissionFileError: no such format or vehicle, or a file that can't be written.
    """
    paths = _paths(scenario)
    if vehicle is not None:
        if str(vehicle) not in paths:
            raise MissionFileError(f"found no vehicle {vehicle}; allowed: {', '.join(paths)}")
        paths = {str(vehicle): paths[str(vehicle)]}
    elif file.suffix.lower() in MISSIONS:
        paths = dict([next(iter(paths.items()))])
    holds_s, origin = _holds_s(scenario), scenario.origin.geodetic
    named = [NamedPath(f"vehicle {name}", points, holds_s) for name, points in paths.items()]
    export(file, named, origin, file_fence(scenario.fence, origin), hovering=scenario.hovers)


def _holds_s(scenario: Scenario) -> dict[int, float]:
    """Return how long the leader hovers at points of its sampled path, by their index: the first ones of its stops."""
    planned = scenario.speeds
    if not isinstance(planned, Timetable):
        return {}
    at_m, _ = with_turns(scenario.leader_path, _sampled_m(scenario))
    first = np.searchsorted(at_m, [each.begin_m for each in planned.stops], side="left").tolist()
    return {index: each.hold_s for index, each in zip(first, planned.stops, strict=True) if each.hold_s}


def _sampled_m(scenario: Scenario) -> Array:
    length_m = scenario.leader_path.length_m
    return np.linspace(0.0, length_m, 2 + int(length_m / SAMPLE_M))


def _paths(scenario: Scenario) -> dict[str, Array]:
    """Return the paths (N, 3), north, east and height, m, of the leader, real or virtual, and of the followers."""
    _, points = with_turns(scenario.leader_path, _sampled_m(scenario))
    axis = axis_rad(scenario.formation.frame, points.course_rad, points.course_rad)
    paths = dict[str, Array]()
    for vehicle, place in zip(vehicles_by_index(scenario), slot_schedule(scenario)[0].positions_m, strict=True):
        forward_m, right_m, up_m = place.tolist()
        north_m, east_m = offset_points(points.north_m, points.east_m, axis, forward_m, right_m)
        name = "leader" if vehicle is None else str(vehicle.vehicle_id)
        paths[name] = np.stack((north_m, east_m, points.height_m + up_m), axis=1)
    return paths
