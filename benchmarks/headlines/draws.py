"""Held-out flights: paths, steps, hills, links and time constants, drawn by a seeded generator."""

from __future__ import annotations

import math
from random import Random
from typing import Any

LEG_M = 700.0
HARDEST_RAD = math.radians(40.0)
"""Largest bend from one leg to the next: up to 1.4 degrees a second at 22 m/s, as in `configs/paper.yaml`."""
HEIGHT_M, HIGHER_M = 200.0, 35.0
SPEED_MPS = 22.0
STEP_MPS = 0.6 * math.sqrt(2.0)
"""Size of a step of wind: 0.6 m/s in each of two axes."""


def path(random: Random, duration_s: float, *, level: bool = False) -> list[list[float]]:
    """Return waypoints of a path that is straight for a leg, then bends, climbs and descends, for a duration."""
    points, course_rad = [[0.0, 0.0, HEIGHT_M], [LEG_M, 0.0, HEIGHT_M]], 0.0
    while (len(points) - 2) * LEG_M < SPEED_MPS * duration_s:
        course_rad += random.uniform(-HARDEST_RAD, HARDEST_RAD)
        height_m = HEIGHT_M if level else HEIGHT_M + random.uniform(-HIGHER_M, HIGHER_M)
        north_m, east_m, _ = points[-1]
        step_m = LEG_M * math.cos(course_rad), LEG_M * math.sin(course_rad)
        points.append([round(north_m + step_m[0]), round(east_m + step_m[1]), round(height_m)])
    return points


def tight(random: Random, duration_s: float, turn_rps: float) -> list[list[float]]:
    """Return waypoints of a level path, straight at both ends, that swings left and right up to a turn rate."""
    sign, swing_m = random.choice([-1.0, 1.0]), random.uniform(1200.0, 1800.0)
    length_m, points = SPEED_MPS * (duration_s + 10.0), [[0.0, 0.0, HEIGHT_M]]
    north_m = east_m = course_rad = 0.0
    for metre in range(int(length_m)):
        begun, left = (min(max(each / 250.0, 0.0), 1.0) for each in (metre - 500.0, length_m - 300.0 - metre))
        share = (begun * left) ** 2 * (3.0 - 2.0 * begun * left)
        wave = math.sin(math.pi / 2.0 * math.sin(math.tau * (metre - 500.0) / swing_m))
        course_rad += sign * share * wave * turn_rps / SPEED_MPS
        north_m, east_m = north_m + math.cos(course_rad), east_m + math.sin(course_rad)
        if metre % 25 == 24:
            points.append([round(north_m, 2), round(east_m, 2), HEIGHT_M])
    return points


def mission(random: Random, duration_s: float) -> list[list[float]]:
    """Return waypoints of a mission of legs, with corners of up to 100 degrees and legs of 500 to 900 m."""
    points, course_rad, whole_m = [[0.0, 0.0, HEIGHT_M], [LEG_M, 0.0, HEIGHT_M]], 0.0, LEG_M
    while whole_m < 1.2 * SPEED_MPS * duration_s:
        course_rad += random.choice([-1.0, 1.0]) * random.uniform(0.3, 1.75)
        leg_m, (north_m, east_m, _) = random.uniform(500.0, 900.0), points[-1]
        step_m = leg_m * math.cos(course_rad), leg_m * math.sin(course_rad)
        points.append([round(north_m + step_m[0]), round(east_m + step_m[1]), HEIGHT_M])
        whole_m += leg_m
    return points


def seed(random: Random) -> int:
    """Return a scenario's seed."""
    return random.randrange(1, 10**6)


def step(random: Random, at_s: float, vehicles: str | list[int] = "all") -> list[dict[str, Any]]:
    """Return a step of wind from a drawn direction, at an instant anywhere within a tick."""
    bearing_rad = random.uniform(-math.pi, math.pi)
    north_mps, east_mps = STEP_MPS * math.cos(bearing_rad), STEP_MPS * math.sin(bearing_rad)
    velocity_mps = [round(north_mps, 3), round(east_mps, 3), 0.0]
    return [{"at_s": at_s, "vehicles": vehicles, "velocity_mps": velocity_mps}]


def instant(random: Random, min_s: float, max_s: float) -> float:
    """Return an instant, to a millisecond."""
    return round(random.uniform(min_s, max_s), 3)


def time_constants(random: Random, share: float) -> dict[str, float]:
    """Return time constants of equation (7), each off the usual ones by up to a share."""
    usual = {"tau_v_s": 4.0, "tau_psi_s": 1.5, "tau_ha_s": 1.0, "tau_hb_s": 3.0}
    return {name: round(value * random.uniform(1 - share, 1 + share), 3) for name, value in usual.items()}


def hills(random: Random, waypoints_m: list[list[float]]) -> list[dict[str, Any]]:
    """Return a hill or a hollow near each waypoint of a path but the first."""
    return [
        {
            "name": f"hill {number}",
            "shape": random.choice(["gaussian", "cosine"]),
            "north_m": round(north_m + random.uniform(-200, 200)),
            "east_m": round(east_m + random.uniform(-200, 200)),
            "height_m": round(random.choice([-0.5, 1, 1, 1]) * random.uniform(40, 85)),
            "radius_m": round(random.uniform(300, 600)),
        }
        for number, (north_m, east_m, _) in enumerate(waypoints_m[2:], 1)
    ]
