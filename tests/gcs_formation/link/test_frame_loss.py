"""Frames lost, late, repeated and missed in silences, against one who knows what was sent.

Source: MAVLink guide, "Packet loss": a sender numbers its frames modulo 256.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant, after
from gcs_formation.link.frame_loss import SequenceTracker, Silence, run_length

BEGUN = Instant(1_000_000_000_000)
AT_ONCE = BEGUN, BEGUN
STALE_NS = 1_500_000_000
FATES = st.lists(st.tuples(st.integers(0, 100), st.integers(0, 20), st.booleans()), max_size=70)
"""Of each frame that comes: how many are lost before it, by how many numbers it comes late, whether it comes twice."""


def tracked(*numbers: int) -> SequenceTracker:
    tracker = SequenceTracker()
    for number in numbers:
        tracker.observe(number % 256, *AT_ONCE)
    return tracker


@given(st.integers(0, 255), FATES)
def test_losses_gaps_and_copies_are_those_of_one_who_knows_what_was_sent(
    start: int, fates: list[tuple[int, int, bool]]
) -> None:
    """Whatever is lost, late and repeated by less than half a round of numbers; each change of the loss is reported."""
    number, arrivals = start, [(start, start)]
    for skipped, late, twice in fates:
        number += skipped + 1
        arrivals += [(number + late, number)] * (1 + twice)
    tracker = SequenceTracker()
    for _, each in sorted(arrivals):
        lost = tracker.lost
        assert tracker.observe(each % 256, *AT_ONCE) == (tracker.lost != lost)
    came = {each for _, each in arrivals}
    missing = set(range(start, max(came))) - came
    assert (tracker.received, tracker.lost) == (len(came), len(missing))
    assert tracker.repeated == len(arrivals) - len(came)
    assert tracker.gaps == sum(each - 1 not in missing for each in missing)
    assert tracker.loss == tracker.whole_loss == len(missing) / (len(came) + len(missing))
    assert tracker.mean_gap == (len(missing) / tracker.gaps if missing else 1.0)


@pytest.mark.parametrize(("newest", "lost"), [(130, 0), (131, 1 + 126)])
def test_a_number_up_to_half_a_round_behind_is_late_and_others_are_ahead(newest: int, lost: int) -> None:
    """2 is 128 behind 130. After 131 it is the 126th but one ahead: 132 to 257 are between."""
    tracker = tracked(0, 1, *range(3, newest + 1))
    assert tracker.lost == 1
    tracker.observe(2, *AT_ONCE)
    assert tracker.lost == lost


@given(st.integers(0, 255), st.integers(0, 126))
def test_after_silence_numbers_skipped_are_no_loss_of_normal_operation(start: int, skipped: int) -> None:
    """Silence begins at 1.5 s; numbers that were skipped in it aren't expected late."""
    for silence_ns, counts in ((STALE_NS - 1, True), (STALE_NS, False)):
        tracker, now = tracked(start), Instant(BEGUN + silence_ns)
        changed = tracker.observe((start + 1 + skipped) % 256, now, BEGUN)
        assert tracker.lost == (skipped if counts else 0)
        assert changed == (tracker.lost + tracker.missed > 0)
        assert tracker.silent_s == (0.0 if counts else 1.5)
        assert tracker.received == 2
        tracker.observe((start + 2 + skipped) % 256, now, now)
        assert (tracker.received, tracker.repeated) == (3, 0)
        if skipped:
            tracker.observe((start + 1) % 256, now, now)
            assert tracker.repeated == (0 if counts else 1)
            assert not tracker.was_overtaken((start + 1) % 256)


def test_silences_add_up() -> None:
    tracker = tracked(5)
    for number in (1, 2, 3):
        tracker.observe(5 + number, after(BEGUN, 3.0 * number), after(BEGUN, 3.0 * (number - 1)))
    assert (tracker.silent_s, tracker.missed, tracker.received) == (9.0, 0, 4)


def received(
    own_hz: int, asked_hz: int = 0, answered: int = 1, lost: int = 0, seconds: int = 30
) -> tuple[SequenceTracker, Instant, int]:
    """Return what was counted of a vehicle, when its last frame came, and that frame's number.

    It sends `own_hz` frames unasked and an answer to every `answered`-th of `asked_hz` requests, evenly; every
    `lost`-th frame is lost. In its first half it sends a quarter as much.
    """
    tracker, number, last, sent = SequenceTracker(), 0, BEGUN, -1
    tracker.asked = 7
    events = sorted(
        (tick / hz, kind)
        for kind, hz in enumerate((own_hz, asked_hz))
        for tick in range(1, seconds * hz + 1)
        if tick / hz > seconds / 2 or tick % 4 == 0
    )
    for at_s, is_request in events:
        now = after(BEGUN, at_s)
        if is_request:
            tracker.asked += 1
            if tracker.asked % answered:
                continue
        sent += 1
        if lost and sent % lost == lost // 2:
            continue
        tracker.answers += is_request
        number = sent
        tracker.observe(number % 256, now, last)
        last = now
    return tracker, last, number


@pytest.mark.parametrize("answers", [False, True])
@pytest.mark.parametrize(
    ("own_hz", "asked_hz", "answered", "lost", "silent_s"),
    [(50, 0, 1, 0, 60), (40, 10, 1, 0, 20), (40, 12, 2, 0, 27), (60, 20, 1, 11, 15), (60, 20, 2, 11, 33)],
)
def test_what_a_silence_lost_fits_the_rates_of_just_before_it(
    own_hz: int, asked_hz: int, answered: int, lost: int, silent_s: int, answers: bool
) -> None:
    """The numbers tell it modulo 256. Requests go on meanwhile; whether they arrive, the numbers tell too."""
    tracker, last, number = received(own_hz, asked_hz, answered, lost)
    tracker.asked += asked_hz * silent_s
    missed = own_hz * silent_s + answers * asked_hz * silent_s // answered
    before = tracker.received, tracker.lost, tracker.gaps
    assert tracker.observe((number + 1 + missed) % 256, after(last, silent_s), last)
    assert tracker.missed == missed
    assert (tracker.received - 1, tracker.lost, tracker.gaps) == before
    all_lost, sent = tracker.lost + missed, tracker.received + tracker.lost + missed
    assert tracker.whole_loss == float(all_lost) / float(sent)


def test_a_vehicle_that_was_not_asked_before_answers_everything() -> None:
    """1000 frames unasked in 20 s; 320 requests: 1320 - 1000 isn't a multiple of 256."""
    tracker, last, number = received(50)
    tracker.asked += 320
    tracker.observe((number + 1 + 1320) % 256, after(last, 20.0), last)
    assert tracker.missed == 1320


@pytest.mark.parametrize("lost", [0, 7])
def test_a_silence_that_does_not_end_lost_what_is_sent_unasked(lost: int) -> None:
    tracker, last, _ = received(40, 10, 1, lost)
    tracker.break_off(last, after(last, 100.0))
    assert tracker.missed == pytest.approx(4000, rel=0.03)


def test_the_rate_of_a_short_time_is_taken_over_as_long_as_a_silence_lasts() -> None:
    """30 frames in 0.3 s are 20 a second, over 1.5 s: in 15 s 300 are lost."""
    tracker, last = SequenceTracker(), BEGUN
    for number in range(30):
        now = after(BEGUN, 0.01 * number)
        tracker.observe(number, now, last)
        last = now
    tracker.break_off(last, after(last, 15.0))
    assert tracker.missed == 300


def test_a_second_silence_at_once_is_judged_by_the_rate_before_the_first() -> None:
    """50 frames a second; between two silences of 30 s three come in 20 ms."""
    tracker, last, number = received(50)
    for _ in range(2):
        number += 1501
        now = after(last, 30.0)
        tracker.observe(number % 256, now, last)
        for _ in range(2):
            number, last, now = number + 1, now, after(now, 0.01)
            tracker.observe(number % 256, now, last)
        last = now
    assert tracker.missed == 3000


def test_nothing_is_known_of_a_vehicle_that_was_never_received() -> None:
    tracker = SequenceTracker()
    tracker.break_off(Instant(BEGUN), after(BEGUN, 100.0))
    assert (tracker.missed, tracker.lost, tracker.received) == (0, 0, 0)
    assert (tracker.loss, tracker.whole_loss, tracker.mean_gap) == (0.0, 0.0, 1.0)
    assert tracker.may_follow(77, *AT_ONCE)


@given(st.integers(0, 255), st.integers(0, 3000), st.integers(0, 500))
def test_of_the_counts_that_agree_with_the_numbers_the_nearest_to_what_is_sent_was_lost(
    gap: int, unasked: int, answers: int
) -> None:
    """With or without answers; without, if that is within 2 %, for most outages are of both ways."""
    agreeing, own = range(gap, 8000, 256), unasked + 0.25
    one, other = (min(agreeing, key=lambda each: abs(each - own - more)) for more in (0, answers))
    one_off, other_off = abs(one - own), abs(other - own - answers)
    found = Silence(12.0, gap, own, float(answers), -1.0).missed(12.0)
    assert found == (one if one_off <= max(other_off, 0.02 * own) else other)


@pytest.mark.parametrize(
    ("gap", "own", "answers", "run", "seconds", "missed"),
    [
        (100, 612.0, 0.0, 0.0, 10.0, 612),
        (100, 306.0, 0.0, 0.0, 5.0, 100),
        (100, 612.0, 0.0, 0.0, 30.0, 612),
        (100, 612.0, 0.0, 0.0, 0.0, 100),
        (100, 612.0, 0.0, 0.0, -1e-9, 0),
        (100, 492.0, 120.0, 0.0, 10.0, 612),
        (100, 600.0, 12.0, 0.0, 10.0, 612),
        (100, 600.1, 256.0, 0.0, 10.0, 612),
        (100, 599.9, 268.1, 0.0, 10.0, 868),
        (100, 603.0, 265.0, 0.0, 10.0, 612),
        (3, 600.0, 0.0, 3.0, 10.0, 3),
        (4, 600.0, 0.0, 3.0, 10.0, 516),
        (3, 514.0, 0.0, 3.0, 10.0, 515),
        (3, 514.0, 1.0, 3.0, 10.0, 515),
        (228, 100.0, 0.0, 0.0, 10.0, 228),
    ],
)
def test_what_a_silence_lost_by_hand(
    gap: int, own: float, answers: float, run: float, seconds: float, missed: int
) -> None:
    """Of 10 s; 612 = 100 + 2 · 256, 868 = 100 + 3 · 256, 515 = 3 + 2 · 256. 12 is 2 % of 600.

    Rates vary by as much: 603 is 1.5 % off 612, so no answers are counted though 868 would fit exactly with them.
    Where a run of as many is usual and no count fits to 2 %, the vehicle hung: only the gap was lost. After a restart
    nothing was; what it sends no longer than the silence lasted counts.
    """
    assert Silence(10.0, gap, own, answers, run).missed(seconds) == missed


@pytest.mark.parametrize(
    ("loss", "probability", "run"), [(0.1, 1e-3, 3.0), (0.5, 1 / 1024, 10.0), (0.0, 0.1, 0.0), (1.0, 0.1, 0.0)]
)
def test_a_run_of_n_losses_has_the_probability_of_one_to_the_n(loss: float, probability: float, run: float) -> None:
    assert run_length(loss, probability) == pytest.approx(run)


def test_the_vehicle_s_clock_corrects_what_a_silence_lost_once() -> None:
    """It sent in half of the 20 s: 500 of 1000; by then nothing more is known of the silence."""
    tracker, last, number = received(50)
    tracker.observe((number + 1 + 500) % 256, after(last, 20.0), last)
    assert tracker.missed == 1012
    for seconds in (10.0, 20.0):
        tracker.sent_for(seconds)
        assert tracker.missed == 500


@pytest.mark.parametrize(("lost", "skipped"), [(0, 0), (10, 3), (2, 9)])
def test_a_number_is_in_its_turn_after_as_many_losses_as_happen_once_in_a_thousand_times(
    lost: int, skipped: int
) -> None:
    """0.1 ** 3 = 1/1000, 0.5 ** 9 > 1/1000 > 0.5 ** 10. After a silence any number is."""
    numbers = [number for number in range(2560) if not lost or number % lost != 1]
    tracker, newest = tracked(*numbers), numbers[-1]
    turn = [tracker.may_follow((newest + 1 + each) % 256, *AT_ONCE) for each in range(100)]
    assert turn == [True] * (skipped + 1) + [False] * (99 - skipped)
    assert not tracker.may_follow(newest % 256, *AT_ONCE)
    for silence_ns, follows in ((STALE_NS - 1, False), (STALE_NS, True)):
        assert tracker.may_follow((newest + 50) % 256, Instant(BEGUN + silence_ns), BEGUN) == follows


@pytest.mark.parametrize("displaced", [4, 15, 16, 17, 30])
def test_on_a_link_that_reorders_as_many_numbers_are_skipped_as_usual_and_up_to_16(displaced: int) -> None:
    """A number that was skipped just now, and hasn't come since, no copy has."""
    tracker = tracked(*range(200), 200 + displaced)
    skipped = list(range(200, 200 + displaced))
    assert [each for each in range(256) if tracker.was_overtaken(each)] == skipped[-15:]
    assert tracker.may_follow(199 + displaced, *AT_ONCE)
    assert tracker.may_follow(200, *AT_ONCE) == (displaced <= 15)
    for each in skipped:
        tracker.observe(each, *AT_ONCE)
    assert (tracker.lost, tracker.gaps, tracker.repeated) == (0, 0, 0)
    newest = 200 + displaced
    turn = [tracker.may_follow((newest + 1 + each) % 256, *AT_ONCE) for each in range(60)]
    assert turn == [each <= min(displaced, 16) for each in range(60)]


@pytest.mark.parametrize("newest", [0, 100, 250])
def test_numbers_within_16_of_the_newest_are_near(newest: int) -> None:
    tracker = tracked(newest)
    assert {each for each in range(256) if tracker.is_near(each)} == {(newest + off) % 256 for off in range(-15, 17)}


@pytest.mark.parametrize(("seen", "back"), [(47, False), (48, True), (168, True), (169, False)])
def test_the_turn_goes_back_from_where_copies_led_it(seen: int, back: bool) -> None:
    """Copies showed a number 8 to 128 ahead of the present one, 40: what they skipped beyond it was never lost."""
    tracker = tracked(*range(30), *range(32, 40), *([100, 101] if seen > 110 else []), seen)
    lost = tracker.lost
    tracker.return_to(40)
    assert tracker.lost == (2 if back else lost)
    if back:
        received = tracker.received
        for each in (40, 41, 42, 44):
            tracker.observe(each, *AT_ONCE)
        assert (tracker.lost, tracker.received, tracker.repeated) == (3, received + 4, 0)


def test_there_is_no_turn_to_go_back_to_before_the_first_number() -> None:
    tracker = SequenceTracker()
    tracker.return_to(140)
    tracker.observe(3, *AT_ONCE)
    assert (tracker.received, tracker.lost) == (1, 0)


def test_one_that_others_overtook_is_a_copy_or_was_counted_as_lost() -> None:
    tracker = tracked(0, 1, 4, 5)
    tracker.overtaken(2, copy=True)
    assert (tracker.received, tracker.lost, tracker.repeated) == (4, 2, 1)
    tracker.overtaken(2, copy=False)
    assert (tracker.received, tracker.lost, tracker.repeated) == (5, 1, 1)
    for lost in (0, 0):
        tracker.overtaken(200, copy=False)
        assert tracker.lost == lost
    assert (tracker.received, tracker.repeated) == (7, 1)


@pytest.mark.parametrize(
    ("doubtful", "following", "received", "lost", "repeated"),
    [(12, 13, 10, 4, 0), (12, 10, 9, 2, 1), (12, 12, 9, 4, 1), (5, 10, 9, 2, 1), (5, 130, 9, 122, 1)],
)
def test_the_next_number_shows_whether_a_doubtful_one_was_in_its_turn(
    doubtful: int, following: int, received: int, lost: int, repeated: int
) -> None:
    """0 to 8 have come but for 5; 12 was in its turn if 13 is next."""
    tracker = tracked(*range(5), *range(6, 9))
    tracker.doubt(doubtful)
    assert (tracker.received, tracker.lost, tracker.repeated) == (8, 1, 1)
    tracker.observe(following, *AT_ONCE)
    assert (tracker.received, tracker.lost, tracker.repeated) == (received, lost, repeated)
    before = tracker.received
    tracker.observe((following + 20) % 256, *AT_ONCE)
    assert (tracker.received, tracker.repeated) == (before + 1, repeated), "it is settled"


@pytest.mark.parametrize(("skipped", "came", "lost"), [(8, 5, 8), (9, 5, 0), (100, 129, 0), (100, 130, 100)])
def test_what_numbers_skipped_shortly_before_a_restart_is_known_was_not_lost(
    skipped: int, came: int, lost: int
) -> None:
    """More than 8 numbers, up to 128 frames before; two are lost before that, and come no more."""
    tracker = tracked(0, 3, *range(4 + skipped, 4 + skipped + came))
    tracker.restart()
    assert tracker.lost == 2 + lost
    tracker.restart()
    assert tracker.lost == 2 + lost
    for each in (77, 78, 79, 81):
        tracker.observe(each, *AT_ONCE)
    assert (tracker.lost, tracker.repeated, tracker.received) == (3 + lost, 0, 2 + came + 4)


def test_of_what_a_restart_skipped_that_which_came_late_is_not_taken_back_twice() -> None:
    tracker = tracked(0, 1, 22, *range(4, 9))
    assert tracker.lost == 15
    tracker.restart()
    assert tracker.lost == 0


def test_a_silence_before_a_restart_lost_nothing() -> None:
    tracker, last, number = received(50)
    tracker.observe((number + 77) % 256, after(last, 20.0), last)
    assert tracker.missed > 0
    tracker.restart()
    assert (tracker.missed, tracker.silence) == (0, None)


def test_numbers_that_a_router_keeps_back_are_no_sign_that_the_vehicle_hung() -> None:
    """Three of four are skipped; by chance 24 in a row would be lost once in a thousand times, here never more than 3.

    40 s at 40 numbers a second are 1600; with 20 of 256 the count is 1556, 2.8 % off.
    """
    tracker, last, number = SequenceTracker(), BEGUN, 0
    for number in range(0, 1200, 4):
        now = after(BEGUN, number / 40)
        tracker.observe(number % 256, now, last)
        last = now
    tracker.observe((number + 1 + 20 + 6 * 256) % 256, after(last, 40.0), last)
    assert tracker.missed == 1556


@pytest.mark.parametrize(("skipped", "missed"), [(2, 2), (3, 1539)])
def test_a_vehicle_that_hung_has_skipped_no_more_than_is_usual(skipped: int, missed: int) -> None:
    """Here up to two in a row, of 40 numbers a second, for 40 s: 1600 would be 1538 or 1539, 3.8 % off."""
    tracker, last, number = SequenceTracker(), BEGUN, 0
    for number in range(1200):
        now = after(BEGUN, number / 40)
        if number % 30 not in {7, 8}:
            tracker.observe(number % 256, now, last)
            last = now
    tracker.observe((number + 1 + skipped) % 256, after(last, 40.0), last)
    assert tracker.missed == missed
