"""A virtual leader at the centroid of vehicles under the consensus law, one of which leaves the formation."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from formation_scenario.surroundings import FaultKind
from tests.flights.in_memory import World

OUT, OTHERS = 2, (1, 3)
"""The vehicle that leaves, and those that go on; a tick has the virtual leader in its first column."""
SPEED_MPS, RATE_HZ = 22.0, 5.0
PATH = {"speed_mps": SPEED_MPS, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]}
STRAYED_M = 2.0
"""How far the others may be off: they keep clear of one that is lost."""


def flying(until_s: float) -> World:
    """Return three vehicles behind a virtual leader that have flown to a mission time."""
    world = World(
        vehicles=[{"id": number, "role": "follower"} for number in (1, OUT, 3)],
        law={"type": "consensus", "rate_hz": RATE_HZ},
        formation={"shape": "triangle", "spacing_m": 60},
        path=PATH,
        duration_s=60,
    )
    world.fly_to(until_s)
    return world


def strayed_m(world: World, from_s: float) -> float:
    """Return the others' largest error since a mission time."""
    flown = [tick.error_m for tick in world.recorder.ticks if tick.mission_time_s > from_s]
    return float(np.max(np.abs([[errors_m[number] for number in OTHERS] for errors_m in flown])))


def jumped_m(world: World) -> float:
    """Return how far at most the leader was from where a tick before it would have been by its speed."""
    states = [tick.virtual_leader for tick in world.recorder.ticks if tick.mission_time_s > 1.0]
    places = [(each.north_m, each.east_m) for each in states if each is not None]
    steps_m = [math.dist(*pair) for pair in pairwise(places)]
    return max(abs(step_m - SPEED_MPS / RATE_HZ) for step_m in steps_m)


@pytest.mark.parametrize(("kind", "keys"), [("pilot", {"mode": "LOITER"}), ("crash", {})])
def test_the_others_fly_on_in_their_slots_without_one_that_its_pilot_has_or_that_is_lost(
    kind: FaultKind, keys: dict[str, Any]
) -> None:
    """Its pilot took them 159 m off with it; the state of a leader with one that was lost grew older without end."""
    world = flying(2.0)
    world.inject(OUT, kind, **keys)
    world.fly_to(20.0)
    assert not world.recorder.ticks[-1].active[OUT]
    assert strayed_m(world, 1.0) < STRAYED_M
    assert jumped_m(world) < STRAYED_M
    assert world.recorder.ticks[-1].age_s[0] < 0.5


def test_the_leader_does_not_leap_when_one_is_given_back_far_from_its_slot() -> None:
    """The law draws the others to it, as behind a real leader; they keep their places about the virtual one."""
    world = flying(2.0)
    world.inject(OUT, "pilot", mode="LOITER")
    world.run(8.0)
    world.inject(OUT, "pilot", ends=True)
    world.fly_to(26.0)
    back = [tick for tick in world.recorder.ticks if tick.mission_time_s > 12.0]
    assert all(tick.active[OUT] for tick in back)
    assert max(math.hypot(*tick.error_m[OUT]) for tick in back) > 100.0
    assert jumped_m(world) < STRAYED_M
    assert strayed_m(world, 1.0) < 20.0
