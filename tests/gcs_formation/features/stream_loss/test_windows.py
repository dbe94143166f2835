"""Loss by what requested streams lack, of counts by hand: no link, and no flight."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages import KINDS
from gcs_formation.features.stream_loss.stream_loss import StreamLoss

FAST, ALSO, SLOW = m.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, m.MAVLINK_MSG_ID_VFR_HUD, m.MAVLINK_MSG_ID_ATTITUDE
RATES_HZ = {FAST: 10.0, ALSO: 10.0, SLOW: 10.0}
ALL = dict.fromkeys(RATES_HZ, 1.0)
FILTERED = 0.8
"""Loss by sequence numbers behind a filter that passes a fifth of all frames."""


class Counted:
    """A vehicle whose messages come in some shares of their rates, and whose numbers show a loss."""

    def __init__(self, rates_hz: dict[int, float] | None = None, numbers: float = FILTERED) -> None:
        self.now = Instant(0)
        vehicle: Any = SimpleNamespace(
            rates_hz=RATES_HZ if rates_hz is None else rates_hz,
            messages_in=[0.0] * len(KINDS),
            sequence=self.sequence(numbers),
            connection=SimpleNamespace(last_received=self.now),
            start_up=SimpleNamespace(asked_for_telemetry=True),
        )
        self.vehicle, self.loss = vehicle, StreamLoss(vehicle)
        self.loss.close_window()

    @staticmethod
    def sequence(loss: float, missed: int = 0) -> Any:
        """Return what the numbers of 1000 received frames show."""
        whole = 1.0 - 1000 / (1000 / (1.0 - loss) + missed)
        return SimpleNamespace(loss=loss, mean_gap=1.5, whole_loss=whole, received=1000, missed=missed, silent_s=0.0)

    def pass_s(self, seconds: float, shares: dict[int, float], silent_s: float = 0.0) -> float:
        """Let seconds pass, silence besides; return the loss once windows that are over have been closed."""
        self.now = after(self.now, seconds + silent_s)
        self.vehicle.connection.last_received = self.now
        self.vehicle.sequence.silent_s += silent_s
        for kind, share in shares.items():
            self.vehicle.messages_in[KINDS[kind].index] += share * self.vehicle.rates_hz[kind] * seconds
        self.loss.close_window()
        return self.loss.loss


@settings(deadline=None, max_examples=20, derandomize=True)
@given(share=st.floats(0.4, 1.0), windows=st.integers(1, 4))
def test_behind_a_filter_the_loss_is_what_streams_lack(share: float, windows: int) -> None:
    counted = Counted()
    for _ in range(windows):
        loss = counted.pass_s(10.0, dict.fromkeys(RATES_HZ, share))
    assert loss == pytest.approx(1.0 - share, abs=0.02)
    assert counted.loss.mean_gap == 5.0


def test_without_a_whole_window_numbers_count() -> None:
    """50 messages of 10 Hz and 5 s at least: a window is 5 s long."""
    counted = Counted()
    assert counted.pass_s(4.9, ALL) == FILTERED
    assert (counted.loss.mean_gap, counted.loss.whole_loss) == (1.5, pytest.approx(FILTERED))
    assert counted.pass_s(0.2, ALL) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("rate_hz", "window_s"), [(2.0, 25.0), (10.0, 5.0), (50.0, 5.0)])
def test_a_window_has_fifty_messages_and_five_seconds(rate_hz: float, window_s: float) -> None:
    counted = Counted({FAST: rate_hz})
    assert counted.pass_s(window_s - 0.1, {FAST: 1.0}) == FILTERED
    assert counted.pass_s(0.2, {FAST: 1.0}) < 0.02
    assert Counted({FAST: rate_hz}).pass_s(window_s, {FAST: 1.0}) == 0.0


@pytest.mark.parametrize(("numbers", "by_streams"), [(0.20, False), (0.32, True)])
def test_numbers_count_unless_they_show_more_than_streams_and_chance_do(numbers: float, by_streams: bool) -> None:
    """Of 300 messages due a loss of 0.2 scatters by 0.023, and one of 0.32 by 0.027: four of them and 0.05 more."""
    counted = Counted(numbers=numbers)
    due = dict.fromkeys(RATES_HZ, 0.9)
    assert counted.pass_s(10.0, due) == pytest.approx(0.1 if by_streams else numbers)
    assert counted.loss.mean_gap == (5.0 if by_streams else 1.5)


def test_more_messages_leave_less_to_chance() -> None:
    """0.2 by numbers and 0.1 by streams: after 300 messages that may be chance, after 9000 it isn't."""
    counted = Counted(numbers=0.2)
    found = [counted.pass_s(10.0, dict.fromkeys(RATES_HZ, 0.9)) for _ in range(30)]
    assert found[0] == 0.2
    assert found[-1] == pytest.approx(0.1)


def test_a_silence_is_no_loss_of_streams() -> None:
    counted = Counted()
    assert counted.pass_s(10.0, ALL, silent_s=8.0) == pytest.approx(0.0, abs=1e-9)
    assert counted.pass_s(10.0, ALL, silent_s=3.0) == pytest.approx(0.0, abs=1e-9)
    assert counted.pass_s(10.0, dict.fromkeys(RATES_HZ, 0.7)) == pytest.approx(0.1)


def test_in_a_silence_what_would_have_passed_the_filter_was_lost() -> None:
    """1000 frames came of 5000 sent; 2000 were sent in silences, of which the filter would have passed 400."""
    counted = Counted()
    counted.vehicle.sequence = counted.sequence(FILTERED, 2000)
    counted.loss.close_window()
    counted.pass_s(10.0, ALL)
    assert counted.loss.whole_loss == pytest.approx(400.0 / 1400.0)


def test_and_what_passed_it_and_was_lost_is_counted_too() -> None:
    """A tenth is lost behind the filter: 1111 passed, and of 2000 sent in silences 444 would have."""
    counted = Counted()
    counted.vehicle.sequence = counted.sequence(FILTERED, 2000)
    counted.loss.close_window()
    counted.pass_s(10.0, dict.fromkeys(RATES_HZ, 0.9))
    assert counted.loss.whole_loss == pytest.approx(1.0 - 1000.0 / (1000.0 / 0.9 + 2000.0 * 0.2 / 0.9))


@pytest.mark.parametrize(
    ("shares", "loss"),
    [
        ({FAST: 0.9, ALSO: 0.9, SLOW: 0.4}, 0.1),
        ({FAST: 0.9, ALSO: 0.9, SLOW: 0.0}, 0.1),
        ({FAST: 0.9, ALSO: 0.0, SLOW: 0.0}, 0.1),
        ({FAST: 0.9, ALSO: 0.9, SLOW: 2.0}, 0.1),
        ({FAST: 0.9, ALSO: 0.5, SLOW: 0.2}, FILTERED),
        ({FAST: 0.0, ALSO: 0.0, SLOW: 0.0}, FILTERED),
        (dict.fromkeys(RATES_HZ, 1.04), 0.0),
        (dict.fromkeys(RATES_HZ, 1.06), FILTERED),
    ],
    ids=[
        "slowed",
        "filtered",
        "two of them filtered",
        "quicker",
        "all different",
        "none comes",
        "nearly as asked for",
        "all quicker",
    ],
)
def test_streams_that_come_alike_tell_if_they_are_the_most_and_no_faster_than_asked_for(
    shares: dict[int, float], loss: float
) -> None:
    assert Counted().pass_s(10.0, shares) == pytest.approx(loss, abs=1e-9)


def test_a_stream_of_fewer_than_fifty_messages_tells_nothing() -> None:
    """In 10 s: 49 of one that comes half as often as it should."""
    counted = Counted({FAST: 10.0, SLOW: 4.9})
    assert counted.pass_s(10.0, {FAST: 1.0, SLOW: 0.5}) == pytest.approx(0.0)
    for slow_hz, loss in ((4.9, 0.0), (5.0, 0.5)):
        counted = Counted({FAST: 10.0, SLOW: slow_hz, ALSO: 5.1})
        found = counted.pass_s(10.0, {FAST: 1.0, SLOW: 0.5, ALSO: 0.5})
        assert found == pytest.approx(loss, abs=0.01), "with 50 they are 101 of 201, the most"


def test_of_two_streams_that_with_more_messages_tells() -> None:
    """In 10 s: half of 100, and 0.9 of 101, come."""
    assert Counted({FAST: 10.0, ALSO: 10.1}).pass_s(10.0, {FAST: 0.5, ALSO: 0.901}) == pytest.approx(10.0 / 101.0)


def test_of_two_streams_with_as_many_messages_neither_tells() -> None:
    assert Counted({FAST: 10.0, ALSO: 10.0}).pass_s(10.0, {FAST: 0.5, ALSO: 0.9}) == FILTERED


@pytest.mark.parametrize(("share", "loss"), [(0.92, 0.165), (0.94, FILTERED)])
def test_two_streams_come_alike_that_differ_by_what_chance_explains_at_the_lower(share: float, loss: float) -> None:
    """Of 100 messages 0.75 come: 4 sqrt(0.75 0.25 / 100) = 0.173, and one message."""
    found = Counted({FAST: 10.0, ALSO: 10.0}).pass_s(10.0, {FAST: 0.75, ALSO: share + 1e-6})
    assert found == pytest.approx(loss)


@pytest.mark.parametrize(("slow_hz", "loss"), [(10.05, 0.5 / 300.5), (10.15, 0.0)])
def test_a_stream_comes_alike_that_lacks_one_message_at_most(slow_hz: float, loss: float) -> None:
    """100 of 100.5 come, or of 101.5: the latter has another rate than the two that are complete."""
    found = Counted({FAST: 10.0, ALSO: 10.0, SLOW: slow_hz}).pass_s(
        10.0, {FAST: 1.0, ALSO: 1.0, SLOW: 100.01 / (10.0 * slow_hz)}
    )
    assert found == pytest.approx(loss, abs=1e-9)


@pytest.mark.parametrize("change", ["link", "rates", "restart"])
def test_a_window_with_another_link_rate_or_start_is_not_judged(change: str) -> None:
    counted = Counted()
    counted.pass_s(4.0, dict.fromkeys(RATES_HZ, 0.5))
    if change == "link":
        counted.vehicle.sequence = counted.sequence(FILTERED)
    elif change == "rates":
        counted.vehicle.rates_hz = dict(RATES_HZ)
    else:
        counted.vehicle.start_up.asked_for_telemetry = False
        counted.pass_s(2.0, ALL)
        counted.vehicle.start_up.asked_for_telemetry = True
    assert counted.pass_s(4.0, dict.fromkeys(RATES_HZ, 0.5)) == FILTERED
    assert counted.pass_s(4.9, ALL) == FILTERED
    assert counted.pass_s(0.2, ALL) == pytest.approx(0.0, abs=0.01)
