"""Interarrival jitter: RFC 3550's figure for known delays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant, after
from gcs_formation.link.jitter import JitterMeter


def measured_s(delays_s: list[float], drift: float = 0.0, reported: float | None = None) -> float:
    """Return the jitter of samples taken 0.1 s apart, with a clock that drifts."""
    meter = JitterMeter()
    for number, delay_s in enumerate(delays_s):
        sent_s = 0.1 * number
        meter.observe(
            7.0 + sent_s * (1 + drift), after(Instant(0), sent_s + delay_s), drift if reported is None else reported
        )
    return meter.jitter_s


def test_one_sample_has_no_jitter() -> None:
    assert math.isnan(measured_s([0.1]))


@given(delay_s=st.floats(0.0, 10.0), drift=st.floats(-0.02, 0.02))
def test_a_constant_delay_has_none_whatever_the_clock_drifts(delay_s: float, drift: float) -> None:
    assert measured_s([delay_s] * 50, drift) < 1e-8


def test_the_recursion_of_appendix_a8() -> None:
    """J = 16/16, then J + (|D| - J)/16, by hand."""
    assert measured_s([0.0, 0.016]) == pytest.approx(0.001)
    assert measured_s([0.0, 0.016, 0.0]) == pytest.approx(0.001 + (0.016 - 0.001) / 16)


def test_alternating_delays_have_their_difference() -> None:
    assert measured_s([0.05, 0.09] * 100) == pytest.approx(0.04, rel=1e-4)


def test_normal_jitter_is_two_by_root_pi_of_its_deviation() -> None:
    random = np.random.default_rng(1)
    delays = 0.3 + 0.02 * random.standard_normal(20_000)
    meter, seen = JitterMeter(), list[float]()
    for number, delay_s in enumerate(delays.tolist()):
        meter.observe(0.1 * number, after(Instant(0), 0.1 * number + delay_s), 0.0)
        seen.append(meter.jitter_s)
    assert np.mean(seen[100:]) == pytest.approx(0.02 * 2 / math.sqrt(math.pi), rel=0.02)
