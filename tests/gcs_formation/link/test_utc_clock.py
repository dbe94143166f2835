"""A vehicle's UTC: what it has gained by drift, how far it may be off, and each limit from both sides."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.clock import NANOSECONDS, Instant, after
from gcs_formation.link.gnss_clock import GnssClock

UTC_S = 1.6e9
"""UTC minus the vehicle's time since boot, as it is sent."""
UNSTEADY = "its clock doesn't run steadily"


def probed(
    drift: float = 0.0,
    boot_s: float = 0.0,
    probes: int = 40,
    up_s: float = 0.1,
    down_s: float = 0.1,
    clock: GnssClock | None = None,
    begin_s: float = 0.0,
) -> GnssClock:
    """Return a clock that was asked four times a second; `boot_s`: what it shows at our time 0."""
    clock = GnssClock(0.0) if clock is None else clock
    for number in range(probes):
        at_s = begin_s + 0.25 * number
        sent, shown_s = after(Instant(0), at_s), boot_s + (1.0 + drift) * (at_s + up_s)
        clock.probe(sent, round(shown_s * NANOSECONDS), after(sent, up_s + down_s))
    return clock


@pytest.mark.parametrize(
    ("drift", "disarmed_s", "gained_s"),
    [(40e-6, 900.0, 0.04), (40e-6, None, 0.04), (-40e-6, 900.0, -0.004), (-40e-6, None, -0.036)],
)
def test_utc_gains_by_drift_since_boot_where_it_is_fast_and_since_arming_where_it_is_slow(
    drift: float, disarmed_s: float | None, gained_s: float
) -> None:
    """To 1000 s; armed at 900 s, or somewhere in the first 200 s before it was first heard, at 100 s for all we know.

    UTC is set forwards only, while disarmed (ArduPilot's AP_RTC).
    """
    clock = probed(drift, 500.0, 400)
    clock.utc(UTC_S + 200.0, 200.0, armed=disarmed_s is None)
    if disarmed_s is not None:
        clock.utc(UTC_S + disarmed_s, disarmed_s, armed=False)
    assert clock.drift == pytest.approx(drift, abs=1e-7)
    assert clock.to_utc_s(1000.0) == pytest.approx(UTC_S + 1000.0 - gained_s, abs=2e-4)
    newest_s = 0.25 * 399 + 0.1
    shown_s = 500.0 + (1.0 + drift) * newest_s
    assert clock.station_utc_s() == pytest.approx(clock.to_utc_s(shown_s) - newest_s, abs=1e-5)


@pytest.mark.parametrize("boot_s", [1000.0, 10_000.0])
@pytest.mark.parametrize("disarmed_s", [None, 600.0])
def test_utc_is_uncertain_by_three_deviations_of_the_drift_times_how_long_it_has_drifted(
    boot_s: float, disarmed_s: float | None
) -> None:
    """A clock that may be fast has done so since boot, which is the longer time."""
    clock = probed(0.0, boot_s)
    clock.utc(UTC_S + 600.0, 600.0, armed=disarmed_s is None)
    shown_s = boot_s + 39 * 0.25 + 0.1
    bound_s = 3.0 * clock._filter.drift_deviation * shown_s
    assert clock.utc_uncertainty_s() == pytest.approx(bound_s, rel=0.05)
    assert (clock.why_not() is None) == (bound_s < 0.01)
    assert (clock.why_not(used=True) is None) == (bound_s < 0.02)


def test_an_armed_vehicle_that_has_drifted_by_ten_milliseconds_since_none_knows_when_has_no_utc() -> None:
    """-50 ppm in 190 s are 9.5 ms, in 210 s 10.5 ms; what is in use is kept up to twice as much."""
    armed = "it was armed before it was first heard, and its clock has drifted since"
    for first_s, used, why in (
        (190.0, False, None),
        (210.0, False, armed),
        (390.0, True, None),
        (410.0, True, armed),
    ):
        clock = probed(-50e-6, first_s, 200)
        clock.utc(UTC_S + first_s, first_s, armed=True)
        assert clock.why_not(used=used) == why
        clock.utc(UTC_S + first_s + 1.0, first_s + 1.0, armed=False)
        assert clock.why_not(used=used) is None
    fast = probed(50e-6, 410.0, 200)
    fast.utc(UTC_S + 410.0, 410.0, armed=True)
    assert fast.why_not() is None


@pytest.mark.parametrize(
    ("unix_s", "why"),
    [
        (0.0, "it sends no UTC"),
        (-1e9, "it sends no UTC"),
        (365.2 * 86400.0, "it sends no UTC"),
        (365.3 * 86400.0, "the UTC that it sends is of 1971, which can't be: its receiver hasn't set it yet"),
        (1.4999e9, "the UTC that it sends is of 2017, which can't be: its receiver hasn't set it yet"),
        (1.5001e9, None),
    ],
)
def test_times_before_july_2017_are_no_utc(unix_s: float, why: str | None) -> None:
    clock = probed()
    clock.utc(unix_s, 10.0, armed=False)
    assert clock.why_not() == why


@pytest.mark.parametrize("jump_s", [-0.011, -0.009, 0.009, 0.011])
def test_utc_in_flight_has_jumped_if_it_is_off_by_more_than_ten_milliseconds(jump_s: float) -> None:
    """A smaller step is a reading, of which two are averaged; on the ground each is taken."""
    clock = probed()
    clock.utc(UTC_S + 10.0, 10.0, armed=True)
    clock.utc(UTC_S + 11.0 + jump_s, 11.0, armed=True)
    jumped = abs(jump_s) > 0.01
    assert clock.jump_s == pytest.approx(jump_s if jumped else 0.0, abs=1e-6)
    assert clock.to_utc_s(11.0) == pytest.approx(UTC_S + 11.0 + (0.0 if jumped else jump_s / 2.0), abs=1e-6)
    clock.utc(UTC_S + 12.0 + jump_s, 12.0, armed=False)
    assert clock.jump_s == 0.0
    assert clock.to_utc_s(12.0) == pytest.approx(UTC_S + 12.0 + jump_s, abs=1e-6)
    clock.utc(UTC_S + 13.0, 13.0, armed=True)
    assert (clock.jump_s == 0.0) == (not jumped)


@given(st.floats(-500.0, 500.0), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_utc_minus_our_clock_is_off_by_half_of_what_the_delays_differ_and_half_the_round_trip_at_most(
    boot_s: float, up_s: float, down_s: float
) -> None:
    clock = probed(0.0, 1000.0 + boot_s, 9, up_s, down_s)
    assert math.isnan(clock.station_utc_s())
    clock.utc(UTC_S + 1.0, 1.0, armed=False)
    ours_s = UTC_S + 1000.0 + boot_s
    assert clock.station_utc_s() - ours_s == pytest.approx((up_s - down_s) / 2.0, abs=1e-5)
    assert clock.half_round_trip_s == pytest.approx((up_s + down_s) / 2.0, abs=1e-5)
    assert abs(clock.station_utc_s() - ours_s) <= clock.half_round_trip_s + 1e-5


def test_the_bound_is_of_the_last_twelve_round_trips() -> None:
    assert math.isnan(GnssClock(0.0).half_round_trip_s)
    clock = probed(probes=1, up_s=0.05, down_s=0.05)
    assert clock.half_round_trip_s == pytest.approx(0.05)
    probed(probes=11, clock=clock, begin_s=0.25)
    assert clock.half_round_trip_s == pytest.approx(0.05)
    probed(probes=1, clock=clock, begin_s=3.0)
    assert clock.half_round_trip_s == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("step_s", "longer_s", "followed", "unsteady"),
    [(0.05, 0.0, True, True), (0.05, 0.1, True, False), (-0.05, 0.0, True, True), (0.002, 0.0, False, False)],
)
def test_four_steps_within_a_minute_that_round_trips_do_not_share_are_the_clocks(
    step_s: float, longer_s: float, followed: bool, unsteady: bool
) -> None:
    """3 ms are no step; a step of the link changes round trips as well: 50 ms at the midpoint, 100 ms of the trip."""
    clock = probed(0.0, 1000.0, 24)
    clock.utc(UTC_S + 1.0, 1.0, armed=False)
    for number in range(1, 5):
        assert clock.why_not() != UNSTEADY
        uneven = number % 2 * longer_s
        shift_s = 0.0 if longer_s else step_s * number
        probed(0.0, 1000.0 + shift_s, 48, 0.1 + uneven, 0.1, clock, 12.0 * number)
        off_s = clock.station_utc_s() - UTC_S - 1000.0
        if followed:
            assert off_s == pytest.approx(shift_s + uneven / 2.0, abs=0.01 if longer_s else 5e-4)
    assert (clock.why_not() == UNSTEADY) == unsteady
    probed(0.0, 1000.0 + shift_s, 220, 0.1 + uneven, 0.1, clock, 60.0)
    assert clock.why_not() != UNSTEADY, "the first one is a minute ago"


@pytest.mark.parametrize(("longer_s", "clocks"), [(0.0, True), (0.0028, True), (0.0032, False), (-0.0032, False)])
def test_a_step_is_the_links_if_the_round_trip_changes_with_it_by_three_milliseconds(
    longer_s: float, clocks: bool
) -> None:
    """By turns longer and as before; their medians are compared, and without jitter chance explains nothing."""
    clock = probed(0.0, 1000.0, 24)
    clock.utc(UTC_S + 1.0, 1.0, armed=False)
    for number in range(1, 5):
        more_s = number % 2 * longer_s
        probed(0.0, 1000.0 + 0.05 * number, 48, 0.1 + more_s, 0.1, clock, 12.0 * number)
    assert (clock.why_not() == UNSTEADY) == clocks


@pytest.mark.parametrize(("off_s", "taken"), [(0.0065, True), (0.0085, False), (-0.0065, True), (-0.0085, False)])
def test_a_sample_that_is_off_by_four_deviations_and_five_milliseconds_is_not_taken(off_s: float, taken: bool) -> None:
    """A sample of a round trip as long as the others has 0.5 ms, the estimate 0.1 ms: together the limit is 7.04 ms."""
    clock = probed(0.0, 1000.0, 60)
    clock.utc(UTC_S + 1.0, 1.0, armed=False)
    before_s = clock.station_utc_s()
    probed(0.0, 1000.0, 1, 0.1 + off_s, 0.1 - off_s, clock, 15.0)
    assert (abs(clock.station_utc_s() - before_s) > 1e-5) == taken


def test_a_step_of_the_clock_is_reported_seven_seconds_after_one_of_the_link() -> None:
    """Round trips of before the link's step, of more than 24 ago, say nothing of the clock's: four in 45 s."""
    clock = probed(0.0, 1000.0, 24)
    clock.utc(UTC_S + 1.0, 1.0, armed=False)
    for number in range(1, 5):
        assert clock.why_not() != UNSTEADY
        up_s, begin_s, shown_s = 0.1 + number % 2 * 0.2, 15.0 * number, 1000.0 + 0.05 * number
        probed(0.0, shown_s - 0.05, 30, up_s, 0.1, clock, begin_s)
        probed(0.0, shown_s, 30, up_s, 0.1, clock, begin_s + 7.5)
    assert clock.why_not() == UNSTEADY
