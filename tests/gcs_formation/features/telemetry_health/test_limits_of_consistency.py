"""A position against its velocity: bounds, counts and times from both of their sides; not flown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.features.telemetry_health.consistency import POSITION, VELOCITY, Consistency

STEP_S, FASTEST_MPS = 0.1, 60.0


class Straight:
    """A vehicle that flies straight on at 10 m/s, as it says unless it is altered; a height climbs at that rate."""

    def __init__(
        self, axes: int = 2, *, fastest_mps: float = FASTEST_MPS, scale: float = 1.0, mps: float = 10.0
    ) -> None:
        self.checked, self.at_s, self.mps = Consistency(axes, fastest_mps, scale), 1.0, mps
        self.axes, self.variances = axes, (0.0, 0.0)

    def fly(
        self, samples: int, *, off_m: float = 0.0, rate: float = 1.0, drift_mps: float = 0.0, witness: float = 1.0
    ) -> int | None:
        """Take some, off north by `off_m` and increasingly; return in which one a quantity is found wrong."""
        found = None
        for number in range(1, samples + 1):
            self.at_s += STEP_S
            off = off_m + drift_mps * number * STEP_S
            place = [self.mps * self.at_s + off, 0.0][: self.axes]
            reported, witnessed = [rate * self.mps, 0.0][: self.axes], [witness * self.mps, 0.0][: self.axes]
            self.differs = self.checked.take(1 + round(self.at_s * 1e9), place, reported, witnessed, self.variances)
            found = found or (number if self.checked.wrong is not None else None)
        return found

    @property
    def flown_off_m(self) -> float:
        return self.checked.axes[0].flown_m - self.mps * self.at_s


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("scale", "variance_m2", "variance_m2ps2", "within_m", "beyond_m"),
    [
        (1.0, 0.0, 0.0, 2.2, 2.25),
        (2.0, 0.0, 0.0, 4.4, 4.5),
        (1.0, 1.0, 0.0, 7.7, 7.8),
        (1.0, 0.0, 10.0, 7.7, 7.8),
    ],
)
def test_three_samples_beyond_two_metres_and_five_sigmas_make_a_jump_wrong(
    sign: float, scale: float, variance_m2: float, variance_m2ps2: float, within_m: float, beyond_m: float
) -> None:
    """Of a jump 0.95² are left in the third: 2 m there are 2.216 m, 7 m are 7.756 m.

    A velocity's noise of 10 m²/s² adds 10 * 0.1 / 2 * 2 s = 1 m²: 5 m, as 1 m² of the position's do.
    """
    for jump_m, found in ((within_m, None), (beyond_m, 3)):
        flight = Straight(scale=scale)
        flight.variances = variance_m2, variance_m2ps2
        flight.fly(30)
        assert flight.fly(10, off_m=sign * jump_m) == found
        assert flight.checked.evidence_m == pytest.approx(jump_m if found else 0.0, abs=0.2 * jump_m)


@pytest.mark.parametrize(("drift_mps", "is_found"), [(0.38, False), (0.45, True)])
def test_a_slow_drift_stays_within_the_long_sums_four_metres(drift_mps: float, is_found: bool) -> None:
    """A leak of 10 s leaves 10 times the drift: 4 m of 0.4 m/s; the short sum is at 2 times, less than a metre."""
    flight = Straight()
    flight.fly(30)
    found = flight.fly(600, drift_mps=drift_mps)
    assert (found is not None) == is_found


@given(mps=st.floats(5.0, 40.0), heading_rad=st.floats(-3.1, 3.1), jump_m=st.floats(4.0, 25.0))
@settings(max_examples=15, deadline=None)
def test_a_jump_is_flown_as_before_in_every_direction_and_is_displaced_by_itself(
    mps: float, heading_rad: float, jump_m: float
) -> None:
    """By the velocities the vehicle is where it was; an aircraft doesn't jump."""
    checked, rates = Consistency(2, FASTEST_MPS), [mps * math.cos(heading_rad), mps * math.sin(heading_rad)]
    jump = [jump_m * math.cos(2.0 * heading_rad), jump_m * math.sin(2.0 * heading_rad)]
    for number in range(1, 90):
        truth = [each * number * STEP_S for each in rates]
        place = [each + more * (number > 40) for each, more in zip(truth, jump, strict=True)]
        differs = checked.take(1 + round(number * 1e8), place, rates, rates, (0.0, 0.0))
        if number not in {41, 42}:
            assert [axis.flown_m for axis in checked.axes] == pytest.approx(truth, abs=1e-6)
            assert differs == (number >= 43)
    assert checked.wrong is None
    assert [axis.offset_m for axis in checked.axes] == pytest.approx([-each for each in jump])
    assert checked.displaced_m == pytest.approx(jump_m)


@pytest.mark.parametrize(("jump_m", "waits"), [(4.9, False), (5.1, True)])
def test_a_position_that_moved_faster_than_the_aircraft_can_is_flown_as_before_at_once(
    jump_m: float, waits: bool
) -> None:
    """10 m/s and the jump: 60 m/s are 6 m in 0.1 s, 5 m more than its own."""
    flight = Straight()
    flight.fly(30)
    flight.fly(1, off_m=jump_m)
    assert flight.differs == waits
    assert flight.flown_off_m == pytest.approx(0.0 if waits else jump_m)
    flight.fly(1)
    assert not flight.differs


def test_a_velocity_is_replaced_and_is_right_again_after_three_seconds() -> None:
    flight = Straight()
    flight.fly(30)
    assert flight.fly(20, rate=-1.0) is not None
    assert flight.checked.wrong == VELOCITY
    assert flight.checked.axes[0].flown_mps == pytest.approx(10.0, abs=0.5)
    right = 0
    while flight.checked.wrong is not None:
        flight.fly(1)
        right += 1
    assert 30 <= right <= 32
    assert flight.checked.displaced_m == 0.0
    assert not flight.differs


def test_a_jump_back_to_within_two_metres_is_forgotten() -> None:
    for rest_m, displaced_m in ((1.9, 0.0), (2.1, 2.1)):
        flight = Straight()
        flight.fly(30)
        flight.fly(60, off_m=20.0)
        flight.fly(60, off_m=rest_m)
        assert flight.checked.displaced_m == pytest.approx(displaced_m)
        assert flight.differs == (displaced_m > 0.0)


@pytest.mark.parametrize("samples", [9, 10, 11, 12])
def test_ten_samples_begin_the_sums(samples: int) -> None:
    """The first has none before it; the sample that begins them is cleared, and three more are wrong."""
    flight = Straight()
    flight.fly(samples)
    found = flight.fly(30, off_m=3.0)
    assert found == (3 if samples >= 11 else None)


def test_what_gains_too_much_from_the_beginning_is_judged_from_the_twentieth_sample_on() -> None:
    """The first has none before it; a fourth of 40 m/s reported gains 3 m each; of the 21st on three are beyond."""
    assert Straight(mps=40.0).fly(40, rate=0.25) == 23


def test_a_gap_of_half_a_second_or_three_usual_intervals_leaves_nothing_to_compare() -> None:
    for gap_s, found in ((0.49, 3), (0.51, None)):
        flight = Straight()
        flight.fly(60)
        flight.at_s += gap_s - STEP_S
        assert flight.fly(20, off_m=15.0) == found


def test_samples_a_second_apart_are_compared_once_that_is_usual() -> None:
    """Three of the usual intervals are 3 s; of 4 s nothing is known."""
    for gap_s, is_found in ((2.9, True), (3.5, False)):
        checked, at_s = Consistency(2, FASTEST_MPS), 0.0
        for number in range(100):
            at_s += gap_s if number == 90 else 1.0
            off_m = 100.0 * (number >= 90)
            checked.take(1 + round(at_s * 1e9), [10.0 * at_s + off_m, 0.0], [10.0, 0.0], [10.0, 0.0], (0.0, 0.0))
        assert (checked.displaced_m > 50.0 or checked.wrong is not None) == is_found


def test_a_clock_that_wraps_round_begins_again_and_a_sample_out_of_order_is_passed_over() -> None:
    flight = Straight()
    flight.fly(30)
    before_m = flight.checked.axes[0].flown_m
    flight.at_s -= 0.5
    flight.fly(1, off_m=500.0)
    assert flight.checked.axes[0].flown_m == before_m
    flight.at_s = 0.0
    flight.fly(1, off_m=500.0)
    assert flight.flown_off_m == pytest.approx(500.0)


@pytest.mark.parametrize(("opposed", "found"), [(-1.0, VELOCITY), (-0.5, POSITION), (0.3, POSITION)])
def test_without_a_witness_a_velocity_is_wrong_whose_opposite_agrees(opposed: float, found: int) -> None:
    """At -0.5 the opposite leaves 0.5 of the velocity, the velocity itself 1.5: a third, not less than a quarter."""
    flight = Straight()
    flight.fly(30, witness=math.nan)
    flight.fly(8, rate=opposed, witness=math.nan)
    assert flight.checked.wrong == found


@pytest.mark.parametrize(("witness", "found"), [(1.0, VELOCITY), (0.65, VELOCITY), (0.45, POSITION), (0.1, POSITION)])
def test_what_agrees_less_with_the_witness_is_wrong(witness: float, found: int) -> None:
    """It moves at 1, is reported to at 0.1: a witness nearer to the first than to the second accuses the velocity."""
    flight = Straight()
    flight.fly(30)
    flight.fly(8, rate=0.1, witness=witness)
    assert flight.checked.wrong == found


def test_a_velocity_doubted_by_other_axes_is_the_wrong_one() -> None:
    flight = Straight(1)
    flight.checked.doubts_velocity = True
    flight.fly(30, witness=math.nan)
    flight.fly(8, rate=0.3, witness=math.nan)
    assert flight.checked.wrong == VELOCITY


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("variance", "passes_m"), [(0.0, 1.0), (2.0, 5.0)])
def test_a_height_in_whole_metres_is_frozen_once_it_should_have_moved_by_more(
    sign: float, variance: float, passes_m: float
) -> None:
    """At 1 m/s a metre passes in ten samples; with 2 m²/s² of noise 1 + 5 sqrt(0.1 t) = t at t = 4.19 s."""
    flight = Straight(1, mps=sign)
    flight.variances = 0.0, variance
    for number in range(1, 60):
        flight.checked.take(1 + round(number * 1e8), [sign * number], [sign * 10.0], [math.nan], flight.variances)
    checked, frozen = flight.checked, 0
    while checked.wrong is None and frozen < 80:
        frozen += 1
        checked.take(1 + round((59 + frozen) * 1e8), [sign * 59.0], [sign * 1.0], [math.nan], flight.variances)
    assert checked.wrong == POSITION
    assert frozen <= 10.0 * passes_m + 4


def test_scatter_is_smoothed_with_its_deviation_and_over_at_half_of_five_metres() -> None:
    """Alternating by a, samples gain 2 a and take back 4 a²: 5 m of that measure are a = 2.5 m, over at a = 1.25 m."""
    for size_m, is_noisy in ((2.4, False), (2.6, True)):
        flight = Straight()
        flight.variances = 400.0, 0.0
        flight.fly(40)
        for number in range(200):
            flight.fly(1, off_m=size_m * (-1) ** number)
        assert flight.checked.is_noisy == is_noisy
    assert flight.checked.sigma_m == pytest.approx(5.0, abs=0.3)
    assert flight.differs
    for size_m, is_noisy in ((1.3, True), (1.2, False)):
        for number in range(200):
            flight.fly(1, off_m=size_m * (-1) ** number)
        assert flight.checked.is_noisy == is_noisy


def test_what_is_forgotten_begins_as_new() -> None:
    flight, new = Straight(), Straight()
    flight.fly(30)
    flight.fly(40, off_m=20.0)
    flight.checked.forget()
    assert flight.checked.displaced_m == 0.0
    new.at_s = flight.at_s
    for number in range(40):
        off_m = 10.0 * (number > 20)
        flight.fly(1, off_m=off_m)
        new.fly(1, off_m=off_m)
        assert flight.checked.wrong == new.checked.wrong
        assert flight.flown_off_m == pytest.approx(new.flown_off_m)
    assert flight.checked.wrong == POSITION


def test_an_arcs_ratio_grows_with_the_square_of_its_angle() -> None:
    """tan x / x is 1 + x² / 3 and some, with x half the angle; on a straight line it is 1."""
    checked = Consistency(2, FASTEST_MPS)
    checked.axes[0].rate_mps, checked.axes[1].rate_mps = 20.0, 0.0
    ratio = checked._arc([20.0 * math.cos(0.3), 20.0 * math.sin(0.3)])
    assert ratio == pytest.approx(1.0 + math.sin(0.3) ** 2 / 12.0)
    assert checked._arc([50.0, 0.0]) == 1.0
    checked.axes[0].rate_mps = 0.1
    assert checked._arc([0.0, 0.1]) == pytest.approx(1.0 + 1e-4 / 12.0)
    assert Consistency(1, FASTEST_MPS)._arc([5.0]) == 1.0
    assert np.isnan(Consistency(1, FASTEST_MPS).axes[0].flown_m)


def test_a_second_jump_right_after_the_first_is_confirmed_by_three_samples_too() -> None:
    flight = Straight()
    flight.fly(30)
    assert flight.fly(3, off_m=20.0) == 3
    lasts = list[bool]()
    for _ in range(3):
        flight.fly(1, off_m=41.0)
        lasts.append(flight.checked.lasts)
    assert lasts == [False, False, True]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_height_too_has_jumped_in_its_third_sample_and_an_outlier_is_none(sign: float) -> None:
    outlying, jumping = Straight(1, mps=1.5), Straight(1, mps=1.5)
    outlying.fly(30)
    jumping.fly(30)
    assert outlying.fly(1, off_m=sign * 8.0) is None
    assert outlying.fly(40) is None
    assert jumping.fly(40, off_m=sign * 8.0) == 3
