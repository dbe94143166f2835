import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import Instant, RealClock, VirtualClock, after, rounded, seconds_between

instants = st.integers(-(10**18), 10**18).map(Instant)


@given(instants, st.integers(-(10**14), 10**14))
def test_a_duration_taken_back_gives_the_instant_again(start, nanoseconds):
    later = Instant(start + nanoseconds)
    assert abs(after(start, seconds_between(start, later)) - later) <= abs(nanoseconds) * 2**-52 + 0.5


@given(instants, st.floats(-1e5, 1e5))
def test_the_seconds_between_are_those_that_were_added(start, seconds):
    assert seconds_between(start, after(start, seconds)) == pytest.approx(seconds, abs=0.51e-9)


@given(st.floats(-1e17, 1e17) | st.integers(-(2**52), 2**52).map(lambda halves: halves / 2))
def test_rounding_is_python_s(value):
    assert rounded(value) == round(value)


def test_a_virtual_clock_never_goes_back():
    clock = VirtualClock()
    clock.move_to(Instant(9))
    clock.move_to(Instant(7))
    assert clock.now() == 9


@pytest.fixture
def monotonic(monkeypatch):
    """Return a list whose only element is the time of the machine's clock."""
    shown = [1_000_000_000]
    monkeypatch.setattr(time, "monotonic_ns", lambda: shown[0])
    return shown


def test_clocks_that_share_an_origin_and_a_speed_share_their_instants(monotonic):
    first = RealClock(4.0)
    monotonic[0] += 250_000_000
    second = RealClock(4.0, first.origin_ns)
    assert first.now() == second.now() == 1_000_000_000


@pytest.mark.parametrize("speedup", [1.0, 3.0, 4.0])
def test_a_clock_may_begin_at_any_instant(monotonic, speedup):
    clock = RealClock.at(Instant(10_000_000_001), speedup)
    assert 0 <= clock.now() - 10_000_000_001 < speedup
    began = clock.now()
    monotonic[0] += 1_000_000_000
    assert clock.now() - began == pytest.approx(speedup * 1e9, abs=1)


def test_a_faster_clock_waits_less(monotonic):
    clock = RealClock(4.0)
    assert clock.wall_seconds_until(after(clock.now(), 2.0)) == pytest.approx(0.5)
    monotonic[0] += 1_000_000_000
    assert clock.wall_seconds_until(Instant(2_000_000_000)) == 0.0
