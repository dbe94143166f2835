"""The sums that compare one coordinate with its velocity, and what is flown in place of a wrong one."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.features.telemetry_health.axis import Axis

STEP_S = 0.1
finite = st.floats(-50.0, 50.0)


def begun(position_m: float = 0.0, rate_mps: float = 0.0, witness_mps: float = 0.0) -> Axis:
    """Return one that has flown a single sample."""
    axis = Axis()
    axis.fly(STEP_S, position_m, rate_mps, witness_mps, derived=False, waits=False)
    return axis


def taken(axis: Axis, position_m: float, rate_mps: float = 0.0, witness_mps: float = 0.0, share: float = 0.5) -> float:
    """Compare a sample, fly it, and return its gain."""
    gained_m = axis.take(STEP_S, position_m, rate_mps, witness_mps, 1.0, share)
    axis.fly(STEP_S, position_m, rate_mps, witness_mps, derived=False, waits=False)
    return gained_m


@settings(max_examples=20)
@given(start_m=finite, rate_mps=finite, accel_mps2=st.floats(-5.0, 5.0))
def test_steady_acceleration_gains_nothing(start_m: float, rate_mps: float, accel_mps2: float) -> None:
    """The mean of the velocities at the ends is the mean velocity of s = v t + a t²/2, whatever the acceleration."""
    axis = begun(start_m, rate_mps, rate_mps)
    for number in range(1, 30):
        at_s = number * STEP_S
        rate = rate_mps + accel_mps2 * at_s
        taken(axis, start_m + rate_mps * at_s + accel_mps2 * at_s * at_s / 2.0, rate, rate)
    sums = axis.short_m, axis.long_m, axis.unlike_m, axis.noise_m2, axis.variance_m2
    assert sums == pytest.approx([0.0] * 5, abs=1e-9)
    assert axis.flown_m == axis.position_m
    assert axis.smooth_m == pytest.approx(axis.position_m, abs=1e-9)


@settings(max_examples=20)
@given(jump_m=st.floats(0.1, 50.0), steps=st.integers(0, 30))
def test_a_jump_leaks_out_of_both_sums_with_their_memories(jump_m: float, steps: int) -> None:
    """Euler's steps of 0.1 s keep 1 - 0.1 / 2 of the short sum, 1 - 0.1 / 10 of the long one."""
    axis = begun()
    assert taken(axis, jump_m) == jump_m
    for _ in range(steps):
        taken(axis, jump_m)
    assert axis.short_m == pytest.approx(jump_m * 0.95**steps)
    assert axis.long_m == pytest.approx(jump_m * 0.99**steps)
    assert axis.unlike_m == axis.opposed_m == axis.short_m
    axis.clear()
    assert (axis.short_m, axis.long_m, axis.unlike_m, axis.opposed_m) == (0.0, 0.0, 0.0, 0.0)


def test_each_sum_compares_the_position_with_a_velocity_of_its_own() -> None:
    """At 10 m/s, reported as 4, witnessed as 9, steps of 1 m gain 0.6 and 0.1 m, and 1.4 m on the opposite.

    The first two steps leave 1 + 0.95 of that in the short sum.
    """
    axis = begun(0.0, 4.0, 9.0)
    for number in (1, 2):
        assert taken(axis, number * 1.0, 4.0, 9.0) == pytest.approx(0.6)
    assert axis.moved_m == 1.0
    assert (axis.short_m, axis.unlike_m, axis.opposed_m) == pytest.approx((1.95 * 0.6, 1.95 * 0.1, 1.95 * 1.4))
    assert axis.long_m == pytest.approx(1.99 * 0.6)


def test_an_arcs_chord_is_farther_than_the_mean_of_its_velocities() -> None:
    axis = begun(0.0, 10.0, 10.0)
    assert axis.take(STEP_S, 1.05, 10.0, 10.0, 1.05, 0.5) == pytest.approx(0.0)
    assert (axis.unlike_m, axis.opposed_m) == pytest.approx((0.0, 2.1))


def test_a_witness_that_comes_back_begins_its_sum_again() -> None:
    axis = begun()
    taken(axis, 1.0, witness_mps=math.nan)
    assert math.isnan(axis.unlike_m)
    taken(axis, 2.0)
    assert math.isnan(axis.unlike_m), "the interval before has no witness at its start"
    taken(axis, 5.0)
    assert axis.unlike_m == pytest.approx(3.0)


def test_noise_is_what_a_sample_takes_back_of_the_one_before() -> None:
    """±a gains 2 a and -2 a, whose product is -4 a²; at a = 1 m a share of 0.5 makes 2 m², then 3 m².

    At a = 10 m, 400 m², one sample counts as 4 * 5² m² at most.
    """
    axis = begun(1.0)
    taken(axis, -1.0)
    assert axis.noise_m2 == 0.0
    taken(axis, 1.0)
    assert (axis.noise_m2, axis.variance_m2, axis.taken_back_m2) == pytest.approx((2.0, 2.0, 4.0))
    taken(axis, -1.0)
    assert (axis.noise_m2, axis.variance_m2) == pytest.approx((3.0, 3.0))
    wide = begun(10.0)
    taken(wide, -10.0)
    taken(wide, 10.0)
    assert (wide.noise_m2, wide.variance_m2, wide.taken_back_m2) == pytest.approx((200.0, 50.0, 100.0))


def test_a_drift_takes_nothing_back_and_counts_against_noise_as_much() -> None:
    axis = begun()
    taken(axis, 20.0)
    taken(axis, 40.0)
    assert (axis.noise_m2, axis.variance_m2, axis.taken_back_m2) == pytest.approx((-200.0, -50.0, -100.0))


def test_a_sum_is_lost_whole_after_its_memory_and_never_turns_over() -> None:
    axis = begun()
    taken(axis, 8.0)
    axis.take(3.0, 8.0, 0.0, 0.0, 1.0, 0.5)
    assert (axis.short_m, axis.unlike_m, axis.opposed_m) == (0.0, 0.0, 0.0)
    assert axis.long_m == pytest.approx(0.7 * 8.0)


def test_what_is_smoothed_moves_a_hundredth_of_the_way_in_a_hundredth_of_its_time_constant() -> None:
    """0.1 s of 10 s; carried on by the mean velocity, 5 m/s, it is expected at 0.5 m, and reported at 10.5 m."""
    axis = begun(0.0, 4.0)
    axis.fly(STEP_S, 10.5, 6.0, 0.0, derived=False, waits=False)
    assert axis.smooth_m == pytest.approx(0.6)
    assert axis.flown_m == 10.5


@pytest.mark.parametrize(("gap_s", "smooth_m"), [(0.49, 0.49), (0.5, 10.0), (0.6, 10.0)])
def test_what_is_smoothed_begins_again_after_half_a_second(gap_s: float, smooth_m: float) -> None:
    axis = begun()
    axis.fly(gap_s, 10.0, 0.0, 0.0, derived=False, waits=False)
    assert axis.smooth_m == pytest.approx(smooth_m)


def test_a_displacement_is_added_and_what_waits_is_flown_without_its_excess() -> None:
    axis = begun(5.0)
    axis.offset_m, axis.excess_m = -2.0, 7.0
    axis.fly(STEP_S, 12.0, 3.0, 0.0, derived=False, waits=True)
    assert (axis.flown_m, axis.flown_mps) == (12.0 - 2.0 - 7.0, 3.0)
    axis.fly(STEP_S, 12.0, 3.0, 0.0, derived=False, waits=False)
    assert axis.flown_m == 10.0
    assert (axis.position_m, axis.rate_mps, axis.witness_mps) == (12.0, 3.0, 0.0)


@pytest.mark.parametrize(("witness_mps", "begins_mps"), [(math.nan, 20.0), (15.0, 15.0)])
def test_a_derived_velocity_begins_as_the_witness_or_the_difference_of_positions(
    witness_mps: float, begins_mps: float
) -> None:
    """Then the alpha-beta filter takes 0.4 of what it is off, and 0.1 of that over the interval into its velocity."""
    axis = begun(0.0, 0.0, witness_mps)
    axis.flown_m = math.nan
    axis.fly(STEP_S, 2.0, 0.0, witness_mps, derived=True, waits=False)
    assert (axis.flown_m, axis.flown_mps) == pytest.approx((2.0, begins_mps))
    expected_m = 2.0 + begins_mps * STEP_S
    axis.fly(STEP_S, expected_m + 1.0, 0.0, witness_mps, derived=True, waits=False)
    assert (axis.flown_m, axis.flown_mps) == pytest.approx((expected_m + 0.4, begins_mps + 1.0))


@settings(max_examples=20)
@given(rate_mps=finite, accel_mps2=st.floats(-5.0, 5.0))
def test_a_derived_velocity_follows_a_witness_that_is_off_by_a_constant(rate_mps: float, accel_mps2: float) -> None:
    """Only the witness's changes lead it: a wind that isn't known adds nothing.

    Its velocity settles at the mean of the step's, half a step's change behind.
    """
    axis = begun(0.0, 0.0, rate_mps + 3.0)
    axis.flown_m, axis.flown_mps = 0.0, rate_mps
    for number in range(1, 40):
        at_s = number * STEP_S
        velocity_mps = rate_mps + accel_mps2 * at_s
        position_m = rate_mps * at_s + accel_mps2 * at_s * at_s / 2.0
        axis.fly(STEP_S, position_m, 0.0, velocity_mps + 3.0, derived=True, waits=False)
    assert axis.flown_mps == pytest.approx(velocity_mps - accel_mps2 * STEP_S / 2.0, abs=0.02)
    assert axis.flown_m == pytest.approx(position_m, abs=0.02)
