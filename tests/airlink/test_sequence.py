from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcs_formation.link.connection import MODULUS, SequenceTracker


def tracked(numbers):
    tracker = SequenceTracker()
    for number in numbers:
        tracker.observe(number % MODULUS)
    return tracker


def sent_from(start, arrived):
    return [number for number, came in enumerate(arrived, start) if came]


@given(st.integers(0, 255), st.lists(st.booleans(), max_size=2000))
def test_loss_between_the_first_and_the_last_frame_is_exact(start, arrived):
    numbers = sent_from(start, arrived)
    assume(all(later - earlier <= 127 for earlier, later in pairwise(numbers)))
    tracker = tracked(numbers)
    assert tracker.received == len(numbers)
    assert tracker.lost == (numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 0)


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 40)), min_size=1, max_size=600))
def test_late_frames_take_back_the_loss_of_their_gap(fates):
    """Each frame that isn't lost comes up to 40 frames late."""
    order = sorted((number + 1 + late, number + 1) for number, (came, late) in enumerate(fates) if came)
    tracker = tracked([0, *[number for _, number in order]])
    newest = max([0, *[number for _, number in order]])
    assert tracker.received == 1 + len(order)
    assert tracker.lost == newest - len(order)
    assert tracker.repeated == 0


@given(st.lists(st.tuples(st.booleans(), st.booleans()), max_size=600))
def test_repeated_frames_neither_arrive_again_nor_hide_a_loss(fates):
    numbers = [0]
    for number, (came, twice) in enumerate(fates, 1):
        numbers += [number] * (came + (came and twice))
    assume(all(later - earlier <= 127 for earlier, later in pairwise(numbers)))
    tracker = tracked(numbers)
    assert tracker.received == len(set(numbers))
    assert tracker.lost == numbers[-1] + 1 - len(set(numbers))
    assert tracker.repeated == len(numbers) - len(set(numbers))


def test_a_restart_loses_nothing():
    tracker = tracked([7, 8, 10])
    tracker.restart()
    for number in (0, 1, 3):
        tracker.observe(number)
    assert (tracker.received, tracker.lost) == (6, 2)
    assert tracker.loss == pytest.approx(0.25)


def test_nothing_heard_is_no_loss():
    assert SequenceTracker().loss == 0.0
