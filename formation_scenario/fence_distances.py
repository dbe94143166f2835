"""How near the leader and every slot come to the fence on the path."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flight_model.fence_geometry import Flyers, positions_along
from formation_scenario.fence_limits import slot_flyers
from formation_scenario.model import Scenario
from formation_scenario.sampled_path import SampledPath
from formation_scenario.slot_assignment import slot_schedule
from formation_scenario.wind_triangle import drift


class FenceDistance(NamedTuple):
    """The least distance of a vehicle to the fence: in which slot, in words, and where on the path, m."""

    who: str
    least_m: float
    at_m: float
    north_m: float
    """Position of the vehicle there; as all figures, infinite where there is nothing to be near to."""
    east_m: float
    height_m: float
    """Least distance to the fence's lowest and highest height."""
    area: str
    """The key of the polygon or circle that is so near; empty without any."""


def fence_distances(scenario: Scenario) -> list[FenceDistance]:
    """Return the least distance to the fence, m, negative outside, of the leader and of every slot, the nearest first.

    From the run-in to the path's end; empty without a fence.
    """
    fence = scenario.fence
    if fence is None:
        return []
    sampled = SampledPath.along(scenario.leader_path, -scenario.run_in_m)
    flyers = slot_flyers(scenario, slot_schedule(scenario))
    points, (lowest_m, highest_m) = sampled.points, fence.heights_m
    turn_rps = np.array([vehicle.model.turn_rate_max_rps for _, vehicle in flyers.values()])
    forward_m, right_m, up_m = np.array(list(flyers)).T
    path = points.north_m, points.east_m, points.course_rad
    positions_m = positions_along(
        path, Flyers(forward_m, right_m, turn_rps, scenario.formation.slots_turn), drift(scenario)
    )
    found = list[FenceDistance]()
    for row, (who, _) in enumerate(flyers.values()):
        height_m, area = points.height_m + up_m[row], ""
        minimum = math.inf, math.inf, math.inf, math.inf
        if fence.sides is not None:
            within_m = fence.sides.inside_m(positions_m[row])
            index = int(within_m.argmin())
            north_m, east_m = positions_m[row, index].tolist()
            minimum = float(within_m[index]), float(sampled.at_m[index]), north_m, east_m
            area = fence.sides.nearest(positions_m[row, index]).key
        room_m = float(min(height_m.min() - lowest_m, highest_m - height_m.max()))
        found.append(FenceDistance(who, *minimum, room_m, area))
    return sorted(found, key=lambda each: min(each.least_m, each.height_m))
