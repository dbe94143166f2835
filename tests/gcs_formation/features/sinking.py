"""A flight whose leader sinks to the ground."""

from __future__ import annotations

import numpy as np

from tests.flights.in_memory import World

CLIMB_MPS = 3.0
LOW = {"speed_mps": 22, "waypoints_m": [[0, 0, 40], [4000, 0, 40]]}


def sunk(height_m: float) -> tuple[World, float]:
    """Return a flight whose leader sinks, in air that sinks at twice its rate of climb, and the others' lowest height.

    `height_m`: of the path.
    """
    sinks = {"at_s": 3, "vehicles": [1], "velocity_mps": [0, 0, 2 * CLIMB_MPS]}
    path = LOW | {"waypoints_m": [[0, 0, height_m], [4000, 0, height_m]]}
    world = World(duration_s=60, path=path, disturbances=[sinks], formation={"shape": "arrow", "succession": "none"})
    world.fly_to(2.0)
    min_m, bodies = np.inf, world.fleet.bodies
    for _ in range(34):
        world.run(1.0)
        min_m = min(min_m, *(body.state.height_m for body in bodies[1:]))
    assert bodies[0].state.height_m == 0.0
    return world, min_m
