import random
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from airlink.clock import Instant, after
from gcs_formation.link.frame_loss import MODULUS, SequenceTracker

AT_ONCE = Instant(0), Instant(0)


def tracked(numbers):
    tracker = SequenceTracker()
    for number in numbers:
        tracker.observe(number % MODULUS, *AT_ONCE)
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
    """Each frame that isn't lost arrives up to 40 frames late."""
    order = sorted((number + 1 + late, number + 1) for number, (came, late) in enumerate(fates) if came)
    tracker = tracked([0, *[number for _, number in order]])
    newest = max([0, *[number for _, number in order]])
    assert tracker.received == 1 + len(order)
    assert tracker.lost == newest - len(order)
    assert tracker.repeated == 0
    missing = sorted(set(range(newest)) - {0, *(number for _, number in order)})
    assert tracker.gaps == sum(number - 1 not in missing for number in missing)


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


def test_the_mean_gap_tells_bursts_from_losses_one_by_one():
    assert tracked(range(9)).mean_gap == 1.0
    assert tracked([*range(0, 40, 2), 39, 40]).mean_gap == 1.0
    assert tracked([0, 1, 7, 8, 12]).mean_gap == pytest.approx((5 + 3) / 2)
    assert tracked([0, 1, 7, 8, 12, 11]).mean_gap == pytest.approx((5 + 2) / 2)
    assert tracked([0, 6, 8, 7, 3]).mean_gap == pytest.approx(4 / 2), "one late frame closed a gap, another parted one"


@pytest.mark.parametrize(("burst", "likely"), [(1, 2), (5, 30)])
def test_where_frames_are_lost_in_bursts_a_longer_gap_is_no_reason_for_doubt(burst: int, likely: int):
    """A fifth is lost; bursts of 5 on average go on with a probability of 0.8, and 0.8 ** 31 = 1/1000."""
    numbers = [number for number in range(1000) if number % (5 * burst) >= burst]
    tracker = tracked(numbers)
    assert tracker.loss == pytest.approx(0.2, abs=0.01)
    begun = numbers[-1] + 1
    assert tracker.may_follow((begun + likely) % MODULUS, *AT_ONCE)
    assert not tracker.may_follow((begun + 3 * likely) % MODULUS, *AT_ONCE)


def test_a_restart_loses_nothing():
    tracker = tracked([7, 8, 10])
    tracker.restart()
    for number in (0, 1, 3):
        tracker.observe(number, *AT_ONCE)
    assert (tracker.received, tracker.lost) == (6, 2)
    assert tracker.loss == pytest.approx(0.25)


def test_what_a_restarted_vehicle_s_numbers_seem_to_skip_was_not_lost():
    """Its clock tells of the restart some frames after its numbers began again at 0, here 100 numbers ahead."""
    tracker = tracked([154, 155, 0, 1, 2])
    assert tracker.lost == 100
    tracker.restart()
    for number in (3, 4, 6):
        tracker.observe(number, *AT_ONCE)
    assert (tracker.received, tracker.lost) == (8, 1)


def test_a_silence_that_a_restart_ends_lost_nothing():
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    tracker.observe(50, after(received, 15.0), received)
    assert tracker.missed > 0
    tracker.restart()
    assert tracker.missed == 0


@pytest.mark.parametrize("every", [False, True])
def test_after_an_outage_that_both_counts_fit_none_is_thought_to_have_answered(every):
    """In 15 s: 640 unasked frames; with 256 answers the numbers would be the same."""
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    tracker.asked += 256
    tracker.observe((20 * 64 + 640 + (256 if every else 0)) % MODULUS, after(received, 15.0), received)
    assert tracker.missed == 640


def test_a_copy_is_not_taken_for_a_frame_that_was_lost_a_round_of_numbers_ago():
    tracker = tracked(number for number in range(300) if number != 5)
    tracker.observe((256 + 5) % MODULUS, *AT_ONCE)
    assert (tracker.received, tracker.lost, tracker.repeated) == (299, 1, 1)


@pytest.mark.parametrize("newest", [50, 250, 3])
def test_numbers_shortly_before_and_after_the_newest_are_near_it(newest):
    tracker = tracked([newest])
    near = [tracker.is_near((newest + off) % MODULUS) for off in (-40, -20, -10, 0, 1, 10, 20, 40, 128)]
    assert near == [False, False, True, True, True, True, False, False, False]


def test_nothing_heard_is_no_loss():
    assert SequenceTracker().loss == 0.0


@given(st.floats(1.6, 60.0), st.sampled_from([0.0, 0.1]), st.floats(20.0, 120.0))
def test_what_a_silence_lost_is_counted_however_often_numbers_come_round(silent_s, loss, rate_hz):
    """20 s of frames, a silence, 20 s more; every tenth frame is lost."""
    tracker, received, came, sent = SequenceTracker(), Instant(0), 0, round((40.0 + silent_s) * rate_hz)
    newest = -1
    for number in range(sent):
        at_s = number / rate_hz
        if 20.0 <= at_s < 20.0 + silent_s or (loss and number % 10 == 5):
            continue
        now = after(Instant(1), at_s)
        assume((number - newest) % MODULUS != 1 or number == newest + 1)  # else it may have hung
        tracker.observe(number % MODULUS, now, received)
        received, came, newest = now, came + 1, number
    last = sent - 1 if not loss or (sent - 1) % 10 != 5 else sent - 2
    assert tracker.received == came
    assert tracker.whole_loss == pytest.approx(1.0 - came / (last + 1))
    assert tracker.loss == pytest.approx(loss, abs=0.01)
    assert tracker.repeated == 0


@pytest.mark.parametrize("silent_s", [1.6, 2.0, 4.0, 7.0])
@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3])
def test_a_vehicle_that_hangs_loses_nothing_by_that(silent_s, loss):
    """It sends nothing meanwhile, and its sequence numbers continue where they stopped."""
    tracker, drops, received, came, last = SequenceTracker(), random.Random(1), Instant(0), 0, 0
    for number in range(4000):
        now = after(Instant(1), 0.01 * number + (silent_s if number >= 3000 else 0.0))
        if drops.random() >= loss:
            tracker.observe(number % MODULUS, now, received)
            received, came, last = now, came + 1, number
    assert tracker.whole_loss == pytest.approx(1.0 - came / (last + 1), abs=1e-3)


def received_for(tracker, seconds):
    """Feed frames from instant 1 on, 64 per second, every third an answer; return when the last one came."""
    received = Instant(1)
    for number in range(seconds * 64):
        now = after(Instant(1), number / 64)
        if number % 3 == 0:
            tracker.asked += 1
            tracker.answers += 1
        tracker.observe(number % MODULUS, now, received)
        received = now
    return received


def test_repeated_frames_do_not_shorten_what_rates_are_counted_over():
    """After a multiple of 256 frames each repeat restarted the count: of 640 lost in 15 s, 512 fewer were seen."""
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    for _ in range(3):
        tracker.observe(20 * 64 - 1 & 255, after(received, 0.001), received)
    tracker.observe((20 * 64 + 640) % MODULUS, after(received, 15.0), received)
    assert (tracker.repeated, tracker.missed) == (3, 640)


@pytest.mark.parametrize("answers", [0, 320])
def test_a_silence_has_lost_what_is_sent_unasked_and_answers_or_none(answers):
    """In 15 s: 640 unasked frames and 320 answers; sequence numbers alone can't tell 640 from 896."""
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    tracker.asked += 320
    tracker.observe((20 * 64 + 640 + answers) % MODULUS, after(received, 15.0), received)
    assert tracker.missed == 640 + answers


@pytest.mark.parametrize(
    ("gap", "sent_s", "missed"), [(3, 0.1, 3), (3, 8.0, 515), (3, 9.0, 515), (3, -30.0, 0), (0, 8.0, 0)]
)
def test_a_vehicle_s_clock_tells_whether_it_sent_in_a_silence(gap, sent_s, missed):
    """Either nearly all frames came later, or two rounds of numbers were lost, or it restarted.

    If no number is missing it hung; by chance one in 256 silences of a link ends like that, too.
    """
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    tracker.asked += 171
    tracker.observe((20 * 64 + gap) % MODULUS, after(received, 8.0), received)
    tracker.sent_for(sent_s)
    assert tracker.missed == missed


def test_what_a_silence_without_an_end_lost_is_what_was_sent_unasked_before():
    tracker = SequenceTracker()
    received = received_for(tracker, 20)
    tracker.break_off(received, after(received, 30.0))
    assert tracker.missed == pytest.approx(30 * 64 * 2 / 3, rel=0.01)
    assert tracker.loss == 0.0


def test_a_filter_that_keeps_back_four_of_five_is_no_reason_to_think_that_a_vehicle_hung():
    """Four numbers in a row are skipped as usual; of losses by chance, as many, one run in a thousand would have 31.

    Before 10 s of silence a frame comes each 29 ms. 1741 numbers are expected meanwhile, and 1806 were sent.
    """
    tracker, received, number = SequenceTracker(), Instant(0), 0
    for frame in range(700):
        now = after(Instant(1), 0.02877 * frame)
        number = 5 * frame % MODULUS
        tracker.observe(number, now, received)
        received = now
    tracker.observe((number + 1 + 1806) % MODULUS, after(received, 10.02), received)
    assert tracker.missed == 1806


def test_a_number_that_others_have_just_overtaken_is_in_its_turn_and_a_repeated_one_is_not():
    """Also if the same frame was received before, as a heartbeat may be, whose number comes again after 255 others."""
    tracker = tracked([*range(40), 41, 42, 43])
    assert tracker.may_follow(40, *AT_ONCE)
    assert not tracker.may_follow(41, *AT_ONCE)
    tracker.observe(40, *AT_ONCE)
    assert not tracker.may_follow(40, *AT_ONCE)


def test_a_link_that_reorders_makes_gaps_as_long_as_frames_came_late():
    """They are no reason for doubt, however rare losses are; a longer one is."""
    tracker = tracked([*range(40), 44, *range(40, 44), *range(45, 80)])
    assert tracker.lost == 0
    assert tracker.may_follow(84, *AT_ONCE)
    assert not tracker.may_follow(85, *AT_ONCE)


def test_only_a_number_that_was_skipped_just_now_and_has_not_come_was_overtaken():
    tracker = tracked([*range(40), 41, *range(43, 48)])
    assert [each for each in range(MODULUS) if tracker.was_overtaken(each)] == [40, 42]
    tracker.observe(40, *AT_ONCE)
    assert not tracker.was_overtaken(40)
    for each in range(48, 60):
        tracker.observe(each, *AT_ONCE)
    assert not tracker.was_overtaken(42)
