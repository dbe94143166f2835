"""What answers tell: delays up and down, when the vehicle received the station, and where its stamps lie."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.system import Timesync
from formation_scenario.extensions import Origin, Registered
from gcs_formation.control.plain_values import RoundTrip
from gcs_formation.extend.station_parts import DelayEstimator
from gcs_formation.link.clock_by_command import ClockByCommand
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.gnss_clock import GnssClock
from gcs_formation.link.own_delays import OwnDelays
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.stamp_map import StampMap

BOOTED_S, UTC_AT_0_S = 500.0, 1.6e9


def at(seconds: float) -> Instant:
    return after(Instant(0), 100.0 + seconds)


def exchange(
    trips: RoundTrips, sent_s: float, up_s: float, down_s: float, booted_s: float = BOOTED_S
) -> tuple[bool, tuple[float, ...]]:
    """Have a request answered; return whether the clock has restarted, and the record of its delays."""
    request = trips.request(at(sent_s), 3)
    trips.record_answer(at(sent_s + up_s + down_s))
    assert trips.is_answer(request)
    answer = Timesync(round((booted_s + sent_s + up_s) * NANOSECONDS), request.ts1_ns)
    restarted = trips.measure(answer, at(sent_s + up_s + down_s))
    return restarted, struct.unpack("<4d", trips.delays.getvalue()[-32:])


def test_a_request_names_its_target_where_there_is_one() -> None:
    """TIMESYNC's extension fields, component 1 is the autopilot; a request's answer time is 0."""
    trips = RoundTrips(0.0)
    targets = [
        (each.tc1_ns, each.ts1_ns, each.target_system, each.target_component)
        for each in (trips.request(at(1.0), 3), trips.request(at(2.0)))
    ]
    assert targets == [(0, at(1.0), 3, 1), (0, at(2.0), 0, 0)]
    assert trips.requests == 2


@given(st.floats(0.0, 2.0), st.floats(0.0, 2.0), st.sampled_from([0.0, 0.02]))
def test_each_answer_is_recorded_with_half_of_its_round_trip_less_the_mean_wait(
    up_s: float, down_s: float, loop_s: float
) -> None:
    """How it is split isn't known; the wait for the answering loop is half of its period on average."""
    trips = RoundTrips(loop_s)
    restarted, (arrived_ns, half_s, *up_down_s) = exchange(trips, 0.0, up_s, down_s)
    assert (restarted, arrived_ns, len(trips.delays)) == (False, at(up_s + down_s), 32)
    assert half_s == pytest.approx((up_s + down_s - loop_s / 2.0) / 2.0, abs=1e-8)
    assert [math.isnan(each) for each in (*up_down_s, *trips.up_down_s)] == [True] * 4
    assert not trips.knows_asymmetry
    assert trips.down_s == trips.clock.one_way_s == pytest.approx(max(0.0, half_s), abs=1e-8)
    received_s = (trips.received_at(at(9.0)) - at(0.0)) / NANOSECONDS
    assert received_s == pytest.approx(up_s + down_s - trips.down_s, abs=1e-8)
    assert trips.unanswered_s(at(up_s + down_s + 3.0)) == pytest.approx(3.0)
    assert trips.unanswered_s(at(up_s + down_s - 3.0)) == 0.0


def test_before_the_first_answer_the_vehicle_may_receive_now() -> None:
    trips = RoundTrips(0.02)
    assert trips.received_at(at(7.0)) == at(7.0)
    assert trips.unanswered_s(at(7.0)) == 0.0
    assert math.isnan(trips.down_s)
    assert not trips.answers_commands
    trips.record_answer(at(5.0))
    assert trips.received_at(at(7.0)) == at(5.0), "the delay down isn't known"
    assert trips.answers_commands
    assert trips.unanswered_s(at(7.0)) == 2.0


def test_a_request_is_overdue_from_the_usual_time_on_and_no_longer_once_a_later_one_is_answered() -> None:
    trips = RoundTrips(0.0)
    for each in (0.0, 0.1, 0.2):
        trips.request(at(each))
    assert [trips.overdue(0.4, at(now_s)) for now_s in (0.399, 0.4, 0.499, 0.5, 0.6)] == [0, 1, 1, 2, 3]
    trips.record_answer(at(0.5))
    assert [trips.overdue(0.4, at(now_s)) for now_s in (0.6, 9.0)] == [1, 1], "what was sent 0.4 s before it has passed"
    trips.forget_requests(at(1.0))
    assert trips.overdue(0.4, at(9.0)) == 0
    assert trips.unanswered_s(at(9.0)) == 8.0, "it is since then"


def test_the_unanswered_requests_of_a_minute_are_remembered() -> None:
    """256 of them, four a second: an answer that comes 63.75 s late is one, and none that comes later."""
    trips = RoundTrips(0.0)
    first = trips.request(at(0.0))
    answer = Timesync(7, first.ts1_ns)
    for number in range(1, 256):
        trips.request(at(0.25 * number))
    assert trips.awaits(answer)
    trips.request(at(64.0))
    assert not trips.awaits(answer)


@pytest.mark.parametrize(
    ("spread_s", "loop_s", "steady"),
    [(0.0029, 0.0, True), (0.0031, 0.0, False), (0.0229, 0.02, True), (0.0231, 0.02, False)],
)
def test_a_clock_is_steady_by_twelve_round_trips_that_differ_by_the_loop_and_three_milliseconds(
    spread_s: float, loop_s: float, steady: bool
) -> None:
    trips = RoundTrips(loop_s)
    for number in range(200):
        assert not trips.steady, "200 are known at least"
        exchange(trips, 0.25 * number, 0.1, 0.1 + (spread_s if number == 188 else 0.0))
    assert trips.steady == steady
    trips.request(at(51.0))
    assert trips.steady == steady
    exchange(trips, 52.0, 0.1, 0.1)
    assert trips.steady, "one is unanswered; the thirteenth round trip no longer counts"
    trips.request(at(53.0))
    assert not trips.steady


@pytest.mark.parametrize("more_s", [0.16, 0.0, -0.16])
def test_utc_tells_how_the_round_trip_is_split_and_maps_stamps(more_s: float) -> None:
    """Up 0.24 s and so much more, down as much less: the midpoint is off by it, UTC isn't."""
    trips = RoundTrips(0.0, by_utc=True)
    gnss = trips.gnss
    assert gnss is not None
    assert trips.knows_asymmetry
    for number in range(40):
        _, (_, _, *up_down_s) = exchange(trips, 0.25 * number, 0.24 + more_s, 0.24 - more_s)
        gnss.utc(UTC_AT_0_S + 0.25 * number, BOOTED_S + 0.25 * number, armed=False)
    assert [math.isnan(each) for each in up_down_s] == [True, True]
    assert trips.down_s == trips.clock.one_way_s == pytest.approx(0.24)
    before = trips.stamps.to_instant(BOOTED_S + 9.0)
    assert (before - at(9.0)) / NANOSECONDS == pytest.approx(-more_s, abs=1e-4)
    utc_minus_ours_s = UTC_AT_0_S - 100.0
    trips.stamps.use_utc(utc_minus_ours_s, at(10.0), math.inf)
    assert trips.stamps.by_utc
    assert (trips.stamps.to_instant(BOOTED_S + 9.0) - at(9.0)) / NANOSECONDS == pytest.approx(0.0, abs=1e-4)
    expected_s = pytest.approx((0.24 + more_s, 0.24 - more_s), abs=1e-4)
    assert trips.up_down_s == expected_s
    assert trips.down_s == pytest.approx(0.24 - more_s, abs=1e-4)
    assert exchange(trips, 10.0, 0.24 + more_s, 0.24 - more_s)[1][1:] == (
        pytest.approx(0.24),
        *(pytest.approx(each, abs=1e-4) for each in (0.24 + more_s, 0.24 - more_s)),
    )
    assert trips.stamps.up_down_s(0.1)[0] == pytest.approx(max(0.0, 0.1 + more_s), abs=1e-4)
    assert trips.stamps.up_down_s(0.1)[1] == pytest.approx(max(0.0, 0.1 - more_s), abs=1e-4)
    stamps = trips.stamps
    assert exchange(trips, 11.0, 0.24, 0.24, -10.0)[0]
    assert trips.stamps is not stamps, "the vehicle has restarted"
    assert not trips.stamps.by_utc
    assert trips.gnss is not gnss
    assert trips.gnss is not None


@pytest.mark.parametrize("drift", [0.0, 1e-4, -1e-4])
def test_by_utc_stamps_lie_on_a_straight_line_with_the_rate_of_the_clock(drift: float) -> None:
    """And a change of it comes by so much a call, either way, from where the mapping was."""
    round_trips, gnss = ClockSync(), GnssClock(0.0)
    for number in range(400):
        sent = at(0.25 * number)
        shown_ns = round((BOOTED_S + (1.0 + drift) * (0.25 * number + 0.1)) * NANOSECONDS)
        round_trips.observe(sent, shown_ns, after(sent, 0.2))
        gnss.probe(sent, shown_ns, after(sent, 0.2))
    gnss.utc(UTC_AT_0_S, BOOTED_S, armed=False)
    stamps, now = StampMap(round_trips, gnss), at(100.0)
    known = [stamps.to_instant(BOOTED_S + (1.0 + drift) * each) for each in (60.0, 100.0)]
    assert known == [pytest.approx(at(each), abs=1e5) for each in (60.0, 100.0)]
    gained_s = 100.0 * drift if drift < 0.0 else (BOOTED_S + 100.0) * drift
    utc_s = gnss.station_utc_s()
    for off_s in (0.0, 0.05, -0.05):
        stamps = StampMap(round_trips, gnss)
        stamps.use_utc(None, now, 0.001)
        assert not stamps.by_utc
        for call in range(1, 4):
            stamps.use_utc(utc_s - off_s, now, 0.001)
            moved_s = (stamps.to_instant(BOOTED_S + (1.0 + drift) * 100.0) - at(100.0)) / NANOSECONDS
            assert moved_s == pytest.approx(math.copysign(0.001 * call, off_s) if off_s else 0.0, abs=1e-4)
        for _ in range(60):
            stamps.use_utc(utc_s - off_s, now, 0.001)
        for each in (60.0, 100.0, 200.0):
            moved_s = (stamps.to_instant(BOOTED_S + (1.0 + drift) * each) - at(each)) / NANOSECONDS
            assert moved_s == pytest.approx(off_s, abs=1e-4)
        for call in range(1, 4):
            stamps.use_utc(None, now, 0.001)
            assert not stamps.by_utc
            moved_s = (stamps.to_instant(BOOTED_S + (1.0 + drift) * 100.0) - at(100.0)) / NANOSECONDS
            left_s = off_s - math.copysign(0.001 * call, off_s) if off_s else 0.0
            assert moved_s == pytest.approx(left_s, abs=1e-4)
    assert abs(gained_s) < 0.07


def test_a_drift_that_gets_better_known_moves_stamps_of_now_by_so_much_a_call() -> None:
    """100 ppm, of a clock that is 500 s ahead of ours: at first it isn't known from 10 s."""
    round_trips, gnss, moved_s = ClockSync(), GnssClock(0.0), list[float]()
    gnss.utc(UTC_AT_0_S, BOOTED_S, armed=False)
    stamps = StampMap(round_trips, gnss)
    for number in range(60):
        sent, shown_s = at(0.25 * number), BOOTED_S + 1.0001 * (0.25 * number + 0.1)
        for probe in (round_trips.observe, gnss.probe):
            probe(sent, round(shown_s * NANOSECONDS), after(sent, 0.2))
        if number >= 10:
            before = stamps.to_instant(shown_s)
            stamps.use_utc(UTC_AT_0_S - 100.0, after(sent, 0.1), 0.001 if stamps.by_utc else math.inf)
            moved_s.append((stamps.to_instant(shown_s) - before) / NANOSECONDS)
    assert max(abs(each_s) for each_s in moved_s[1:]) < 1.05e-3
    assert abs(sum(moved_s[1:])) > 0.01


class Measured(DelayEstimator):
    """Takes a tenth of the round trip for the delay up."""

    def __init__(self, keys: object) -> None:
        self.usual_s, self.resets = list[tuple[float, float]](), 0

    def measure(self, trip: RoundTrip) -> tuple[float, float]:
        self.usual_s.append(trip.usual_s)
        whole_s = trip.received_s - trip.sent_s
        return 0.1 * whole_s, 0.9 * whole_s

    def reset(self) -> None:
        self.resets += 1


def test_delays_from_outside_replace_our_own_and_split_what_stamps_are_mapped_by() -> None:
    """Of 0.4 s 0.04 s up and 0.36 s down: one way 0.2 s, 0.16 s less up than half of it; that decays within 30 s."""
    trips = RoundTrips(0.02)
    trips.own = OwnDelays(Registered("delay estimator", "it", Measured, 1, Origin("it.py", "")), {}, VehicleId(0, 3))
    inner = trips.own._own
    assert trips.knows_asymmetry
    for number in range(3):
        restarted, (_, half_s, up_s, down_s) = exchange(trips, 0.25 * number, 0.21, 0.19)
        assert (restarted, half_s) == (False, pytest.approx(0.195))
        assert (up_s, down_s) == trips.up_down_s == pytest.approx((0.04, 0.36))
        assert (trips.clock.one_way_s, trips.clock.asymmetry_s) == (pytest.approx(0.2), pytest.approx(-0.16))
        assert trips.down_s == pytest.approx(0.36)
    assert inner.usual_s[0] == (pytest.approx(0.195), pytest.approx(0.195))
    left_s = 0.16 * math.exp(-0.25 / 30.0)
    assert inner.usual_s[-1] == (pytest.approx(0.195 - left_s), pytest.approx(0.195 + left_s))
    age_s = trips.clock.age_s(BOOTED_S + 1.0, at(1.0))
    assert age_s == pytest.approx(0.005 + 0.16, abs=0.006)
    assert inner.resets == 0
    assert exchange(trips, 20.0, 0.2, 0.2, -19.0)[0]
    assert inner.resets == 1


def test_a_command_is_asked_again_only_once_its_answer_has_come_or_is_given_up() -> None:
    """After 3 s; acknowledgement and message come within 0.1 s of each other; every eighth request is TIMESYNC."""
    trips, clock = RoundTrips(0.0), ClockByCommand()
    for _ in range(40):
        trips.request(at(0.0))
    assert not clock.asks(trips, at(0.0)), "nothing has been answered, not even a command"
    trips.record_answer(at(0.0))
    assert clock.asks(trips, at(0.0))
    assert [clock.asks(trips, at(each)) for each in (0.1, 2.999, 3.0)] == [False, False, True]
    for apart_s, complete in ((0.0999, True), (0.1001, False)):
        clock = ClockByCommand()
        assert clock.asks(trips, at(0.0))
        clock.tell(7_000, at(0.5))
        clock.acknowledged(at(0.5 + apart_s))
        assert (clock.take_answer() is not None) == complete
        assert clock.asks(trips, at(0.7)) == complete
    asked = [ClockByCommand().asks(trips, at(0.0)), *([clock.asks(trips, at(10.0 * each)) for each in range(1, 17)])]
    assert asked.count(False) == 2
    assert asked.index(False, asked.index(False) + 1) - asked.index(False) == 8
