"""What an answer keeps: nothing of what was before it was cleared."""

from __future__ import annotations

import math

import pytest

from gcs_formation.features.limit_cycle.answer import Answer

PERIOD_S, TICK_S = 8.0, 0.1
RADPS = math.tau / PERIOD_S


def swing(answer: Answer, begins_s: float, seconds: float, late_s: float) -> None:
    for tick in range(round(seconds / TICK_S)):
        at_s = begins_s + tick * TICK_S
        answer.add(at_s, math.sin(RADPS * at_s), at_s, 0.7 * math.sin(RADPS * (at_s - late_s)))


def test_three_periods_are_needed_again_after_it_was_cleared() -> None:
    answer = Answer()
    swing(answer, 50.0, 30.0, 0.9)
    answer.clear()
    swing(answer, 80.0, 2.9 * PERIOD_S, 0.4)
    assert math.isnan(answer.late_s(PERIOD_S, 0.0))
    swing(answer, 80.0 + 2.9 * PERIOD_S, 0.2 * PERIOD_S, 0.4)
    assert answer.late_s(PERIOD_S, 0.0) == pytest.approx(0.4)
