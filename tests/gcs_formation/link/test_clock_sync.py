"""The mapped clock and the measured delay, under seeded delays."""

import math

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.link.clock_sync import ClockSync


def probe(
    sync: ClockSync,
    rng: np.random.Generator,
    at_s: float,
    delay_s: float,
    jitter_s: float,
    clock: tuple[float, float],
) -> bool:
    """Let one probe go there and back; the vehicle's clock is offset + (1 + drift) time."""
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
