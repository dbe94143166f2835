"""What frames that come late or twice change: gaps, what may still come, and nothing after a restart."""

from __future__ import annotations

import pytest

from airlink.clock import after
from tests.gcs_formation.link.test_frame_loss import AT_ONCE, BEGUN, tracked


@pytest.mark.parametrize(
    ("late", "gaps", "mean_gap"),
    [((4,), 2, 3.0), ((4, 6), 3, 5 / 3), ((1,), 1, 6.0), ((1, 7), 1, 5.0), ((4, 3, 5), 2, 2.0)],
)
def test_a_late_frame_parts_the_gap_that_it_was_in_or_shortens_it(
    late: tuple[int, ...], gaps: int, mean_gap: float
) -> None:
    """1 to 7 are missing at first."""
    tracker = tracked(0, 8, *late)
    assert (tracker.gaps, tracker.lost) == (gaps, 7 - len(late))
    assert tracker.mean_gap == pytest.approx(mean_gap)


@pytest.mark.parametrize("behind", [0, 1, 2, 3, 50, 128])
def test_a_copy_of_a_number_up_to_half_a_round_behind_is_repeated(behind: int) -> None:
    tracker = tracked(*range(200))
    for _ in range(2):
        assert not tracker.observe(199 - behind, *AT_ONCE)
    assert (tracker.received, tracker.lost, tracker.repeated) == (200, 0, 2)
    tracker.observe(200, *AT_ONCE)
    assert (tracker.received, tracker.lost, tracker.repeated) == (201, 0, 2)


def test_what_was_missing_before_a_restart_is_not_among_the_numbers_after_it() -> None:
    """A copy of 3, which has come since, closes no gap of before."""
    tracker = tracked(0, 1, 2, 4, 5)
    tracker.restart()
    for number in range(6):
        tracker.observe(number, *AT_ONCE)
    assert not tracker.was_overtaken(3)
    assert not tracker.observe(3, *AT_ONCE)
    assert (tracker.received, tracker.lost, tracker.gaps, tracker.repeated) == (11, 1, 1, 1)


def test_the_number_that_was_next_before_a_silence_is_not_next_after_it() -> None:
    tracker, now = tracked(4, 5), after(BEGUN, 3.0)
    tracker.observe(60, now, BEGUN)
    tracker.observe(6, now, now)
    assert (tracker.received, tracker.repeated) == (3, 1)
    tracker.observe(61, now, now)
    assert (tracker.received, tracker.lost, tracker.repeated) == (4, 0, 1)
