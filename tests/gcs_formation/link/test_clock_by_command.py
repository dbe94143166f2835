"""The answer to a command in place of TIMESYNC: when it is asked for, and which answer counts."""

from airlink.clock import Instant, after
from airlink.messages.system import Timesync
from gcs_formation.link.clock_by_command import PATIENCE_S, STILL_TIMESYNC, UNANSWERED, ClockByCommand
from gcs_formation.link.round_trips import RoundTrips

NOW = after(Instant(0), 10.0)


def unanswered(count: int = UNANSWERED) -> RoundTrips:
    trips = RoundTrips(0.02)
    for _ in range(count):
        trips.request(Instant(0), 3)
    trips.record_answer(Instant(0))
    return trips


def asked() -> ClockByCommand:
    clock = ClockByCommand()
    assert clock.asks(unanswered(), NOW)
    return clock


def test_it_is_asked_for_once_many_requests_are_unanswered_but_commands_are() -> None:
    silent = RoundTrips(0.02)
    for _ in range(UNANSWERED):
        silent.request(Instant(0), 3)
    assert not ClockByCommand().asks(silent, NOW)
    assert not ClockByCommand().asks(unanswered(UNANSWERED - 1), NOW)
    answered = unanswered()
    answered.answered_to = NOW
    assert not ClockByCommand().asks(answered, NOW)


def test_one_request_at_a_time_is_under_way_and_timesync_goes_on_rarely() -> None:
    clock, trips = asked(), unanswered()
    assert not clock.asks(trips, after(NOW, PATIENCE_S - 0.1))
    assert clock.asks(trips, after(NOW, PATIENCE_S))
    clock = ClockByCommand()
    asks = [clock.asks(trips, after(NOW, PATIENCE_S * number)) for number in range(2 * STILL_TIMESYNC)]
    assert asks.count(False) == 2


def test_message_and_acknowledgement_together_are_an_answer_in_either_order() -> None:
    clock = asked()
    clock.acknowledged(after(NOW, 0.3))
    assert clock.take_answer() is None
    clock.tell(5_000, after(NOW, 0.301))
    found = clock.take_answer()
    assert found is not None
    assert isinstance(found[0], Timesync)
    assert (found[0].tc1_ns, found[0].ts1_ns, found[1]) == (5_000, NOW, after(NOW, 0.301))
    assert clock.take_answer() is None
    clock = asked()
    clock.tell(5_000, after(NOW, 0.299))
    clock.acknowledged(after(NOW, 0.3))
    assert clock.take_answer() is not None


def test_one_that_comes_unasked_in_between_is_none() -> None:
    """When home is set; the answer replaces it."""
    clock = asked()
    clock.tell(1_000, after(NOW, 0.05))
    clock.acknowledged(after(NOW, 0.3))
    assert clock.take_answer() is None
    clock.tell(5_000, after(NOW, 0.301))
    found = clock.take_answer()
    assert found is not None
    assert found[0].tc1_ns == 5_000


def test_what_nobody_asked_for_is_ignored() -> None:
    clock = ClockByCommand()
    clock.acknowledged(NOW)
    clock.tell(5_000, NOW)
    assert clock.take_answer() is None
