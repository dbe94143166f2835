"""What `check` accepts is flown: random formations on random paths, with random aircraft, without delay."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest

import gcs_formation
from formation_scenario import Scenario, ScenarioError, load_scenario

FLIGHTS, GROUPS = 50, 5
MAX_M = 1.0
SHAPES = ("square", "arrow", "line", "echelon", "plus")


def aircraft(draw: random.Random) -> dict[str, float]:
    return {
        "tau_v_s": draw.uniform(1.0, 8.0),
        "tau_psi_s": draw.uniform(0.5, 4.0),
        "tau_ha_s": draw.uniform(0.5, 1.5),
        "tau_hb_s": draw.uniform(1.0, 6.0),
        "accel_max_mps2": draw.uniform(0.3, 3.0),
        "turn_rate_max_rps": draw.uniform(0.12, 0.3),
        "climb_max_mps": draw.uniform(1.0, 12.0),
        "speed_min_mps": draw.uniform(13.0, 17.0),
        "speed_max_mps": draw.uniform(27.0, 32.0),
    }


def path(draw: random.Random) -> dict[str, Any]:
    waypoints_m, course_rad = [[0.0, 0.0, 150.0]], 0.0
    for _ in range(draw.randint(2, 4)):
        course_rad, length_m = course_rad + draw.uniform(-2.0, 2.0), draw.uniform(300.0, 900.0)
        north_m, east_m, height_m = waypoints_m[-1]
        height_m = min(max(height_m + draw.uniform(-0.4, 0.4) * length_m, 120.0), 400.0)
        place_m = [north_m + length_m * math.cos(course_rad), east_m + length_m * math.sin(course_rad), height_m]
        waypoints_m.append(place_m)
    return {"speed_mps": draw.uniform(16.0, 28.0), "waypoints_m": waypoints_m}


def formation(draw: random.Random, followers: int) -> dict[str, Any]:
    frame = draw.choice(["leader_heading", "leader_heading", "follower_heading"])
    if draw.random() < 0.3:
        shape = draw.choice(SHAPES if frame == "leader_heading" else ("arrow", "echelon"))
        return {"frame": frame, "shape": shape, "spacing_m": draw.uniform(25.0, 60.0)}
    ahead_m = 100.0 if frame == "leader_heading" else -5.0
    slots_m = {
        2 + each: [draw.uniform(-300.0, ahead_m), draw.uniform(-200.0, 200.0), draw.uniform(-40.0, 40.0)]
        for each in range(followers)
    }
    return {"frame": frame, "shape": "custom", "slots_m": slots_m}


def scenario(seed: int) -> dict[str, Any]:
    draw = random.Random(seed)
    count = draw.randint(2, 4)
    return {
        "schema": 1,
        "name": f"random-{seed}",
        "seed": seed,
        "duration_s": 1000,
        "start": {"in_air": True},
        "vehicles": {"count": count, "model": aircraft(draw)},
        "formation": formation(draw, count - 1),
        "path": path(draw),
        "safety": {"separation_m": 5},
    }


def accepted(seed: int) -> Scenario | None:
    try:
        return load_scenario(scenario(seed))
    except ScenarioError:
        return None


@pytest.mark.slow
@pytest.mark.parametrize("group", range(GROUPS))
def test_every_formation_that_is_accepted_keeps_its_slots(group: int, tmp_path: Path) -> None:
    """On the whole way, bends and climbs included, within `MAX_M` on each axis."""
    flown, off = 0, dict[str, float]()
    for seed in range(group * 10_000, (group + 1) * 10_000):
        planned = accepted(seed)
        if planned is None:
            continue
        found = gcs_formation.run(planned, clock="virtual", out=tmp_path / str(seed))
        for follower, each in found.figures["followers"].items():
            max_m = max(each[f"error_{axis}_m"]["max"] for axis in "xyz")
            if max_m > MAX_M or found.held is False:
                off[f"seed {seed}, follower {follower}"] = max_m
        flown += 1
        if flown == FLIGHTS // GROUPS:
            break
    assert flown == FLIGHTS // GROUPS
    assert not off
