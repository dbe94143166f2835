"""What an answer keeps, and how much of it is needed: nothing of what was before it was cleared."""

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


@pytest.mark.parametrize(("period_s", "known"), [(39.95, True), (39.98, False)])
def test_of_ten_ticks_a_second_periods_of_up_to_forty_seconds_are_known(period_s: float, known: bool) -> None:
    """Of the 1200 that are kept, the oldest is 119.9 s older than the newest."""
    answer, radps = Answer(), math.tau / period_s
    for tick in range(2000):
        at_s = TICK_S * tick
        answer.add(at_s, math.sin(radps * at_s), at_s, math.sin(radps * (at_s - 0.5)))
    assert math.isnan(answer.late_s(period_s, 0.0)) != known


def test_three_whole_periods_are_enough_and_an_answer_without_any_lag_is_not_late() -> None:
    answer = Answer()
    for tick in range(97):
        at_s = 0.25 * tick
        assert math.isnan(answer.late_s(PERIOD_S, 0.0))
        answer.add(at_s, math.sin(RADPS * at_s), at_s, math.sin(RADPS * at_s))
    assert answer.late_s(PERIOD_S, 0.0) == 0.0
