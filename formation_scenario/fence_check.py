"""Checks that the path and every slot stay inside the fence, with room to turn away from it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from formation_scenario.arrangement import SlotStep, columns
from formation_scenario.arrays import Array
from formation_scenario.demands import Flown
from formation_scenario.errors import Problem
from formation_scenario.fence import CHECKED_M, Fence, inside_m, room_m
from formation_scenario.model import Scenario
from formation_scenario.path import SplinePath
from formation_scenario.source import Source
from formation_scenario.vehicles import Vehicle

OFF_M = 0.01
"""By how much heights may exceed a limit."""

Place = tuple[float, float, float]


def check_fence(
    scenario: Scenario, source: Source, path: SplinePath, steps: tuple[SlotStep, ...], from_m: float
) -> Iterator[Problem]:
    """Yield the worst place of each limit of the fence, from `from_m` on the path; from its start: with the run-in."""
    fence = scenario.safety.fence
    if fence is None:
        return
    begin_m = -scenario.start.run_in_s * scenario.path.speed_mps if from_m <= 0.0 else from_m
    flown, flyers = Flown.along(path, begin_m), _flyers(scenario, steps)
    yield from _heights(fence, source, flown, flyers)
    if fence.corners_m is not None:
        yield from _sides(np.array(fence.corners_m), scenario, source, flown, flyers)


def _flyers(scenario: Scenario, steps: tuple[SlotStep, ...]) -> dict[Place, tuple[str, Vehicle]]:
    """Return who flies at each place of the formations: forward, right and up of the leader."""
    found: dict[Place, tuple[str, Vehicle]] = {}
    everyone = columns(scenario)
    for step in steps:
        for column, vehicle in enumerate(everyone):
            if vehicle is not None:
                leads = column == step.arrangement.leader
                who = "the leader" if leads else f"vehicle {vehicle.vehicle_id}'s slot in shape {step.shape}"
                forward, right, up = step.places_m[column].tolist()
                found.setdefault((forward, right, up), (who, vehicle))
    return found


def _heights(
    fence: Fence, source: Source, flown: Flown, flyers: Mapping[Place, tuple[str, Vehicle]]
) -> Iterator[Problem]:
    lowest, highest = min(flyers, key=lambda place: place[2]), max(flyers, key=lambda place: place[2])
    height_m, (least_m, most_m) = flown.points.height_m, fence.heights_m
    for place, index, limit, key in (
        (lowest, int(height_m.argmin()), least_m, "height_min_m"),
        (highest, int(height_m.argmax()), most_m, "height_max_m"),
    ):
        found_m = float(height_m[index]) + place[2]
        if found_m < limit - OFF_M if key == "height_min_m" else found_m > limit + OFF_M:
            allowed = f"{limit:g} m or {'more' if key == 'height_min_m' else 'less'} (safety.fence.{key})"
            yield flown.problem(source, index, f"{flyers[place][0]} is at {found_m:.1f} m", allowed)


def _sides(
    corners_m: Array, scenario: Scenario, source: Source, flown: Flown, flyers: Mapping[Place, tuple[str, Vehicle]]
) -> Iterator[Problem]:
    """Yield the place farthest outside; if none is, the one with the least room."""
    course, speed = flown.points.course_rad, scenario.path.speed_mps
    along = np.stack((np.cos(course), np.sin(course)), axis=-1)
    across = np.stack((-along[:, 1], along[:, 0]), axis=-1)
    leader = np.stack((flown.points.north_m, flown.points.east_m), axis=-1)
    places = np.stack([leader + x * along + y * across for x, y, _ in flyers])
    within = inside_m(corners_m, places)
    if within.min() < 0.0:
        who, index = np.unravel_index(int(within.argmin()), within.shape)
        found = f"{list(flyers.values())[who][0]} is {-within.min():.0f} m outside the fence"
        yield flown.problem(source, int(index), found, "inside it (safety.fence.corners_m)")
        return
    through_air = speed + math.hypot(*scenario.wind.velocity_mps[:2])
    turn = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])[:, None]
    room = room_m(corners_m, places, speed * along, np.full(within.shape, through_air), turn + 0.0 * within).max(-1)
    if room.min() < CHECKED_M:
        who, index = np.unravel_index(int(room.argmin()), room.shape)
        found = f"{list(flyers.values())[who][0]} is {within[who, index]:.0f} m from the fence and heads for it"
        allowed = f"{CHECKED_M - room.min():.0f} m more room to turn away (safety.fence.corners_m)"
        yield flown.problem(source, int(index), found, allowed)
