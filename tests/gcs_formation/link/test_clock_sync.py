"""The mapped clock and the measured delay, with seeded delays."""

import math

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.link.clock_filter import ClockFilter
from gcs_formation.link.clock_sync import ClockSync


def probe(
    sync: ClockSync,
    rng: np.random.Generator,
    at_s: float,
    delay_s: float,
    jitter_s: float,
    clock: tuple[float, float],
) -> bool:
    """Exchange one probe; the vehicle's clock is offset + (1 + drift) time."""
    up, down = np.maximum(0, delay_s + jitter_s * rng.standard_normal(2))
    offset_s, drift = clock
    sent = Instant(round(at_s * NANOSECONDS))
    there_s = at_s + up
    vehicle_ns = round((offset_s + (1 + drift) * there_s) * NANOSECONDS)
    return sync.observe(sent, vehicle_ns, after(sent, float(up + down)))


@pytest.mark.parametrize("drift", [0.0, 50e-6, 0.015])
@pytest.mark.parametrize("delay_s", [0.05, 0.6])
def test_after_a_minute_jitter_is_averaged_away(drift: float, delay_s: float) -> None:
    """A straight line fitted to n samples of deviation 20 ms / sqrt(2) ends within 2 sigma / sqrt(n) of the truth."""
    probes, jitter_s, errors_s = 240, 0.02, []
    for seed in range(20):
        rng, sync, clock = np.random.default_rng(seed), ClockSync(), (-1234.5, drift)
        for k in range(probes):
            probe(sync, rng, 0.25 * k, delay_s, jitter_s, clock)
        stamp_s = 0.25 * probes - delay_s
        errors_s.append(sync.to_instant(clock[0] + (1 + drift) * stamp_s) / NANOSECONDS - stamp_s)
    best_s = 2 * jitter_s / np.sqrt(2) / np.sqrt(probes)
    assert np.sqrt(np.mean(np.square(errors_s))) < 1.5 * best_s


@pytest.mark.parametrize("jitter_s", [0.02, 0.1])
@pytest.mark.parametrize("drift", [0.0, 50e-6, -50e-6])
def test_a_clock_that_a_crystal_keeps_is_known_as_if_its_rate_were(drift: float, jitter_s: float) -> None:
    """The mean of n samples of deviation jitter / sqrt(2) is off by sigma / sqrt(n), a fitted line by twice as much."""
    probes, errors_s = 100, list[float]()
    for seed in range(20):
        rng, sync, clock = np.random.default_rng(seed), ClockSync(), (500.0, drift)
        for k in range(probes):
            probe(sync, rng, 0.25 * k, 0.5, jitter_s, clock)
        stamp_s = 0.25 * probes - 0.5
        errors_s.append(sync.to_instant(clock[0] + (1 + drift) * stamp_s) / NANOSECONDS - stamp_s)
    assert np.sqrt(np.mean(np.square(errors_s))) < 1.5 * jitter_s / np.sqrt(2) / np.sqrt(probes)


def test_a_quiet_link_is_exact() -> None:
    rng, sync, clock = np.random.default_rng(1), ClockSync(), (77.0, 50e-6)
    for k in range(100):
        probe(sync, rng, 0.25 * k, 0.1, 0.0, clock)
    mapped = sync.to_instant(clock[0] + (1 + clock[1]) * 24.0)
    assert mapped / NANOSECONDS == pytest.approx(24.0, abs=2e-5)
    assert sync.one_way_s == pytest.approx(0.1, abs=1e-6)


def test_the_answering_loop_is_not_counted_as_delay() -> None:
    sync = ClockSync(loop_s=0.02)
    for k in range(16):
        sent = Instant(k * NANOSECONDS)
        sync.observe(sent, sent, after(sent, 2 * 0.05 + 0.02 * k / 15))
    assert sync.one_way_s == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize(("delay_s", "jitter_s", "max_s"), [(0.0, 0.0, 1e-4), (0.3, 0.0, 1e-4), (0.3, 0.02, 2e-3)])
def test_the_wait_for_the_answering_loop_does_not_shift_the_clock(
    delay_s: float, jitter_s: float, max_s: float
) -> None:
    """The vehicle reads its clock at the end of the wait, so the midpoint is early by half of it: 5 ms of 20."""
    errors_s = list[float]()
    for seed in range(10):
        rng, sync = np.random.default_rng(seed), ClockSync(loop_s=0.02)
        for k in range(100):
            sent, (up, down) = Instant(k * NANOSECONDS // 4), np.maximum(0, delay_s + jitter_s * rng.standard_normal(2))
            read = after(sent, float(up + rng.uniform(0.0, 0.02)))
            sync.observe(sent, read + 77 * NANOSECONDS, after(read, float(down)))
        errors_s.append(sync.to_instant(77.0 + 24.0) / NANOSECONDS - 24.0)
    assert abs(np.mean(errors_s)) < max_s


def test_a_step_in_delay_is_followed_within_five_seconds() -> None:
    rng, sync = np.random.default_rng(5), ClockSync()
    for k in range(60):
        probe(sync, rng, 0.25 * k, 0.05 if k < 40 else 0.35, 0.0, (0.0, 0.0))
    assert sync.one_way_s == pytest.approx(0.35, abs=1e-6)


def test_a_restarted_clock_is_noticed_at_once() -> None:
    rng, sync = np.random.default_rng(7), ClockSync()
    for k in range(40):
        assert not probe(sync, rng, 0.25 * k, 0.1, 0.01, (500.0, 0.0))
    assert probe(sync, rng, 10.0, 0.1, 0.01, (-10.0, 0.0))
    assert sync.to_instant(0.5) / NANOSECONDS == pytest.approx(10.5, abs=0.05)
    assert not math.isnan(sync.offset_s)


@pytest.mark.parametrize("stalled_s", [2.0, 30.0])
def test_a_clock_that_stood_still_for_a_while_is_followed_at_once_and_has_not_restarted(stalled_s: float) -> None:
    """A simulator that was held up; its clock has run longer than the time since it was last read."""
    rng, sync, rate = np.random.default_rng(7), ClockSync(), 50e-6
    for k in range(160):
        assert not probe(sync, rng, 0.25 * k, 0.1, 0.0, (5.0, rate))
    drift = sync.drift
    assert not probe(sync, rng, 40.0 + stalled_s, 0.1, 0.0, (5.0 - stalled_s, rate))
    assert sync.drift == drift
    now_s = 40.0 + stalled_s
    assert sync.to_instant(5.0 - stalled_s + (1 + rate) * now_s) / NANOSECONDS == pytest.approx(now_s, abs=1e-3)


@pytest.mark.parametrize("ahead_s", [500.0, 2.0, -7.0, -500.0])
def test_a_clock_that_is_ahead_or_shows_less_than_it_did_is_another_vehicles(ahead_s: float) -> None:
    """After 6 s of silence, a clock that stopped is up to 6 s behind, and never ahead."""
    rng, sync = np.random.default_rng(7), ClockSync()
    for k in range(160):
        assert not probe(sync, rng, 0.25 * k, 0.1, 0.0, (1000.0, 0.015))
    assert probe(sync, rng, 45.75, 0.1, 0.0, (1000.0 + ahead_s, 0.0))
    assert sync.drift == 0.0
    assert sync.to_instant(1045.75 + ahead_s) / NANOSECONDS == pytest.approx(45.75, abs=1e-3)


@pytest.mark.parametrize("rate", [1.0, 1.015])
def test_one_that_booted_after_it_was_last_asked_has_restarted_however_late_it_is_heard(rate: float) -> None:
    """Its answer of 0.1 s arrived at 2 s; it booted at 0.2 s, and is received after 200 s without delay."""
    sync = ClockSync()
    sync.observe(Instant(0), 500 * NANOSECONDS, after(Instant(0), 2.0))
    received = after(Instant(0), 200.0)
    assert sync.observe(received, round(rate * 199.8 * NANOSECONDS), received)
    assert sync.to_instant(rate * 199.8) == pytest.approx(received, abs=2)


def test_the_jitter_of_round_trips_is_their_sample_deviation() -> None:
    sync = ClockSync(loop_s=0.02)
    for number, (trip_s, jitter_s) in enumerate(((0.10, 0.0), (0.14, 0.02 * math.sqrt(2)), (0.18, 0.04))):
        sent = after(Instant(0), 1.0 * number)
        assert not sync.observe(sent, sent, after(sent, trip_s))
        assert sync.jitter_s == pytest.approx(jitter_s)
    assert sync.last_one_way_s() == pytest.approx((0.18 - 0.01) / 2)
    assert sync.samples == 3


def test_a_clock_that_runs_fast_is_not_taken_for_a_restarted_one_after_silence() -> None:
    """1.5 % in 200 s are 3 s; a restarted clock would have begun after it was last read, here 0.2 s before."""
    rng, sync, clock = np.random.default_rng(2), ClockSync(), (10.0, 0.015)
    for k in range(100):
        assert not probe(sync, rng, 0.25 * k, 0.05, 0.0, clock)
    assert not probe(sync, rng, 225.0, 0.05, 0.0, clock)
    assert probe(sync, rng, 225.25, 0.05, 0.0, (-1.015 * 225.1, 0.015))


@pytest.mark.parametrize(("drift", "accepted", "known_after"), [(3e-5, 5e-5, 0), (0.015, 0.02, 20)])
def test_offset_and_drift_are_those_of_the_two_state_kalman_filter(
    drift: float, accepted: float, known_after: int
) -> None:
    """In matrices: x' = F x, P' = F P F^T + Q, gain P H^T / (H P H^T + R), R a quarter of the round trips' variance."""
    rng, sync, varies = np.random.default_rng(3), ClockSync(), 0.0
    walk = (1e-6, 2e-8) if accepted < 1e-3 else (1e-4, 2e-6)
    x, p, at_s, trips = np.zeros(2), np.zeros((2, 2)), 0.0, list[float]()
    sent_s = np.cumsum(rng.uniform(0.1, 0.4, 60))
    for number, (begin_s, trip_s) in enumerate(zip(sent_s, rng.uniform(0.1, 0.16, 60), strict=True)):
        sent = after(Instant(0), begin_s)
        answered = round((5.0 + (1.0 + drift) * begin_s + trip_s * 0.4) * NANOSECONDS)
        sync.observe(sent, answered, after(sent, trip_s))
        trips = [*trips, trip_s][-16:]
        known = min(max(number - 6, 0), 64)  # of eight on
        bound = 0.1**2
        if known:
            varies = float(np.var(trips, ddof=1)) if known == 1 else varies
            varies += float((trip_s - np.median(trips)) ** 2 - varies) / (known + 7)
            bound = varies * (1 + 2 / math.sqrt(known + 8))
        noise = 0.5e-3**2 + bound / 4
        middle_s = begin_s + trip_s / 2
        sample_s = answered / NANOSECONDS - middle_s
        if number == 0:
            x, p = np.array((sample_s, 0.0)), np.diag((noise, accepted**2))
        else:
            moved = np.array(((1.0, middle_s - at_s), (0.0, 1.0)))
            x, p = moved @ x, moved @ p @ moved.T + np.diag(walk) ** 2 * (middle_s - at_s)
            gain = p[:, 0] / (p[0, 0] + noise)
            x, p = x + gain * (sample_s - x[0]), p - np.outer(gain, p[0])
        at_s = middle_s
        if number >= known_after:
            assert (sync.offset_s, sync.drift) == (pytest.approx(x[0], abs=1e-8), pytest.approx(x[1], abs=1e-8))


@pytest.mark.parametrize("after_s", [0.02, 1.0])
def test_a_step_in_delay_is_the_delay_after_two_seconds_and_no_jitter_but_for_a_moment(after_s: float) -> None:
    """The round trips' standard deviation is half of the step meanwhile; jitter alone contributes 7 ms."""
    rng, sync = np.random.default_rng(1), ClockSync()
    for k in range(40):
        probe(sync, rng, 0.25 * k, 0.4, 0.005, (0.0, 0.0))
    for k in range(40, 60):
        probe(sync, rng, 0.25 * k, after_s, 0.005, (0.0, 0.0))
        assert sync.usual_jitter_s < 0.03
        if k >= 47:
            assert sync.one_way_s == pytest.approx(after_s, abs=0.01)


def exchanged(sync: ClockSync, at_s: float, up_s: float, down_s: float, offset_s: float = 5.0) -> None:
    sent = Instant(round(at_s * NANOSECONDS))
    sync.observe(sent, round((offset_s + at_s + up_s) * NANOSECONDS), after(sent, up_s + down_s))


@pytest.mark.parametrize(("up_s", "down_s"), [(0.35, 0.05), (0.05, 0.35), (0.3, 0.3), (0.75, 0.05)])
def test_a_step_of_one_way_is_distinguished_from_the_clock_and_forgotten(up_s: float, down_s: float) -> None:
    """The clock continues: its samples step by half of the ways' difference, and the mapping isn't moved."""
    sync, asymmetry_s = ClockSync(), (up_s - down_s) / 2
    for k in range(200):
        exchanged(sync, 0.25 * k, 0.05, 0.05)
    exchanged(sync, 50.0, 0.05, down_s)  # it was in transit as the link stepped
    for k in range(201, 209):
        exchanged(sync, 0.25 * k, up_s, down_s)
    assert sync.one_way_s + sync.asymmetry_s == pytest.approx(up_s, abs=0.005)
    assert sync.age_s(5.0 + 52.0, Instant(53 * NANOSECONDS)) == pytest.approx(1.0, abs=0.005)
    assert abs(sync.drift) < 1e-5
    for k in range(209, 329):
        exchanged(sync, 0.25 * k, up_s, down_s)
    assert sync.asymmetry_s == pytest.approx(asymmetry_s / math.e, abs=0.005)
    forgotten_s = asymmetry_s * (1.0 - 1.0 / math.e)
    assert sync.age_s(5.0 + 82.0, Instant(83 * NANOSECONDS)) == pytest.approx(1.0 + forgotten_s, abs=0.005)


@pytest.mark.parametrize(("before", "up_s", "down_s"), [(3, 0.4, 0.2), (200, 0.1, 0.1)])
def test_neither_the_first_slow_probes_nor_a_step_of_both_ways_shows_a_delay_asymmetry(
    before: int, up_s: float, down_s: float
) -> None:
    sync = ClockSync()
    for k in range(before + 40):
        exchanged(sync, 0.25 * k, *((up_s, down_s) if k < before else (0.3, 0.3)))
        assert sync.asymmetry_s == 0.0


def test_no_way_is_taken_to_last_less_than_nothing() -> None:
    """The uplink was slower from the beginning, which nobody could see, until it no longer was."""
    sync = ClockSync()
    for k in range(200):
        exchanged(sync, 0.25 * k, 0.35, 0.05)
    for k in range(200, 210):
        exchanged(sync, 0.25 * k, 0.05, 0.05)
    assert (sync.one_way_s, sync.asymmetry_s) == (pytest.approx(0.05), pytest.approx(-0.05, abs=0.001))


def test_jitter_that_stays_is_seen_and_moves_no_window() -> None:
    """Jitter of 40 ms each way: round trips scatter by 57 ms, and the mean is over the whole window of 4 s."""
    rng, sync, jitters_s, delays_s = np.random.default_rng(2), ClockSync(), [], []
    for k in range(400):
        probe(sync, rng, 0.25 * k, 0.4, 0.04, (0.0, 0.0))
        jitters_s.append(sync.usual_jitter_s)
        delays_s.append(sync.one_way_s)
    assert np.median(jitters_s[20:]) == pytest.approx(0.04 * math.sqrt(2), rel=0.2)
    assert np.std(delays_s[20:]) < 0.04 / math.sqrt(2) / 3.0


@pytest.mark.parametrize("drift", [0.015, -100e-6])
def test_an_answer_that_comes_late_tells_of_the_offset_then(drift: float) -> None:
    """Taken for the present offset, one that is a second old would be wrong by a second's drift: 11 ms of 15."""
    known = ClockFilter(0.02)
    known.initialise(Instant(0), 0.0, 1e-6)
    for quarter in range(1, 401):
        known.correct(after(Instant(0), quarter / 4), drift * quarter / 4, 1e-6)
    known.correct(after(Instant(0), 99.0), drift * 99.0, 1e-6)
    assert known.reference == after(Instant(0), 100.0)
    assert known.predict(after(Instant(0), 100.0)) == pytest.approx(drift * 100.0, abs=1e-6)


@pytest.mark.parametrize("starved_s", [1.2, 5.0, 30.0])
def test_a_starved_simulator_that_catches_up_has_not_restarted(starved_s: float) -> None:
    """Its clock stands still for a while, and then makes up for it within a few seconds."""
    rng, sync = np.random.default_rng(1), ClockSync()
    lost_s, restarts = 0.0, list[bool]()
    for k in range(400):
        at_s = 0.25 * k
        if 20.0 <= at_s < 20.0 + starved_s:
            lost_s = at_s - 20.0
        elif at_s >= 60.0:
            lost_s = max(0.0, lost_s - 2.0)
        restarts.append(probe(sync, rng, at_s, 0.02, 0.0, (400.0 - lost_s, 0.0)))
    assert not any(restarts)
    assert sync.age_s(500.0 - 0.3, Instant(100 * NANOSECONDS)) == pytest.approx(0.3, abs=0.1)


def test_one_that_is_ahead_of_what_it_had_lost_is_another_vehicles() -> None:
    rng, sync = np.random.default_rng(1), ClockSync()
    for k in range(80):
        probe(sync, rng, 0.25 * k, 0.02, 0.002, (400.0 - (3.0 if k > 40 else 0.0), 0.0))
    assert probe(sync, rng, 20.0, 0.02, 0.002, (402.0, 0.0))


@pytest.mark.parametrize(("trips", "wait_s"), [(7, 0.01), (8, 0.015)])
def test_the_wait_for_the_loop_is_told_by_a_round_trips_length_from_the_eighth_on(trips: int, wait_s: float) -> None:
    """By turns 5 and 15 ms of 20 ms; before that it is half of the loop's period."""
    sync = ClockSync(0.02)
    for number in range(trips):
        sent, waits_s = after(Instant(0), 0.25 * number), 0.005 + 0.01 * (number % 2)
        sync.observe(sent, after(sent, 10.05 + waits_s), after(sent, 0.1 + waits_s))
    assert sync._wait_s() == pytest.approx(wait_s)
