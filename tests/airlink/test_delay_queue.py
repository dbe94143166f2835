"""Items come out of a queue when they are due, in that order, and first in, first out at one instant."""

from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant
from airlink.engine import MANY_POPPED, DelayQueue

INSTANTS = st.integers(0, 20)
PUSHED, POPPED, DROPPED = "push", "pop", "drop"
STEPS = st.lists(st.tuples(st.sampled_from([PUSHED, PUSHED, PUSHED, POPPED, DROPPED]), INSTANTS), max_size=60)


@given(STEPS)
def test_it_gives_what_a_stable_sort_by_instants_gives(steps: list[tuple[str, int]]) -> None:
    queue, expected = DelayQueue[int](), list[tuple[int, int]]()
    for number, (step, at) in enumerate(steps):
        if step == PUSHED:
            queue.push(Instant(at), number)
            expected.append((at, number))
        elif step == POPPED:
            due = sorted(each for each in expected if each[0] <= at)
            assert queue.pop_due(Instant(at)) == [number for _, number in due]
            expected = [each for each in expected if each[0] > at]
        else:
            queue.drop(lambda instant, item: item % 3 == at % 3 and instant >= at)  # noqa: B023 - called at once
            expected = [each for each in expected if not (each[1] % 3 == at % 3 and each[0] >= at)]
        assert queue.next() == min((instant for instant, _ in expected), default=None)


def test_a_long_queue_of_which_one_is_popped_at_a_time_keeps_its_order() -> None:
    queue, count = DelayQueue[int](), 5 * MANY_POPPED
    for number in range(count):
        queue.push(Instant(number + 1), number)
    for number in range(count):
        assert queue.next() == number + 1
        assert queue.pop_due(Instant(number + 1)) == [number]
        queue.push(Instant(count + 1 + number), count + number)
    assert queue.pop_due(Instant(3 * count)) == [*range(count, 2 * count)]
    assert queue.next() is None
