"""Slots on their way, and the wait for who can't keep up."""

from __future__ import annotations

import numpy as np
import pytest

from formation_scenario import load_scenario
from formation_scenario.slot_motion import SlotMotion, Transition
from gcs_formation.guidance.slots import FormationPlan
from tests.flights.conftest import scenario

DURATION_S, TICK_S = 20.0, 0.1


@pytest.fixture
def plan() -> FormationPlan:
    """Return slots of which the last moves 30 m back from 100 s on."""
    made = FormationPlan(load_scenario(scenario()))
    start = made.goal_m + np.array([[0.0, 0.0, 0.0]] * (len(made.goal_m) - 1) + [[30.0, 0.0, 0.0]])
    rest, lifts_m = SlotMotion.at_rest(start), np.zeros(len(start))
    made.adopt(made.arrangement, Transition(100.0, DURATION_S, rest, made.goal_m, lifts_m, 0.0))
    return made


def forward(plan: FormationPlan, now_s: float) -> tuple[float, float]:
    """Return how far ahead of its goal the last slot is, and how fast it moves."""
    slots = plan.at(now_s, begun=False)
    return float(slots.position_m[-1, 0] - plan.goal_m[-1, 0]), float(slots.velocity_mps[-1, 0])


def test_slots_that_wait_stand_and_go_on_where_they_were(plan: FormationPlan) -> None:
    at_m, mps = forward(plan, 108.0)
    assert mps < -1.0
    for tick in range(1, 51):
        plan.wait(0.0, TICK_S)
        assert forward(plan, 108.0 + tick * TICK_S) == pytest.approx((at_m, 0.0), abs=1e-9)
    plan.wait(1.0, TICK_S)
    assert forward(plan, 113.0) == pytest.approx((at_m, mps), abs=1e-9)
    assert not plan.settled(124.9)
    assert plan.settled(125.1)


def test_slots_at_half_their_pace_move_half_as_fast_as_they_say(plan: FormationPlan) -> None:
    _, mps = forward(plan, 108.0)
    plan.wait(0.5, 0.0)
    before_m, said_mps = forward(plan, 108.0)
    assert said_mps == pytest.approx(mps / 2)
    plan.wait(0.5, TICK_S)
    after_m, _ = forward(plan, 108.0 + TICK_S)
    assert (after_m - before_m) / TICK_S == pytest.approx(said_mps, rel=0.02)
