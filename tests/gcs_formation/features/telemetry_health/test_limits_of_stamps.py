"""Stamps against positions and arrivals: each limit from both of its sides, and what is said of it."""

from __future__ import annotations

import math

import pytest

from airlink.clock import after
from flight_model.slot import UNKNOWN
from gcs_formation.features.telemetry_health.timing import Timing
from gcs_formation.features.telemetry_health.vehicle_health import Commanded
from tests.gcs_formation.features.telemetry_health.test_late_positions import NOISE
from tests.gcs_formation.features.telemetry_health.test_what_is_flown_and_said import START, Flight

STEP_S, SPEED_MPS = 0.1, 22.0


class Reported:
    """Positions of a vehicle that flies north, or at another course, every 0.1 s from 10 s on; 0.05 s under way."""

    def __init__(self, speed_mps: float = SPEED_MPS, course_rad: float = 0.0) -> None:
        self.timing, self.true_s = Timing(), 10.0
        self.mps = speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)
        self.longest_s = 1.0

    def tell(
        self,
        samples: int,
        *,
        shift_s: float = 0.0,
        late_s: float = 0.0,
        off_m: tuple[float, float] = (0.0, 0.0),
        after_s: float = STEP_S,
    ) -> float:
        """Tell some with their stamps shifted, arriving late, off their places; return the last used stamp's error."""
        used_s = math.nan
        for _ in range(samples):
            self.true_s += after_s
            place_m = self.mps[0] * self.true_s + off_m[0], self.mps[1] * self.true_s + off_m[1]
            stamp_s, now_s = self.true_s + shift_s, self.true_s + 0.05 + late_s
            used = self.timing.take(
                stamp_s, round(stamp_s * 1e9), round(now_s * 1e9), place_m, self.mps, self.longest_s
            )
            used_s = used * 1e-9 - self.true_s
        return used_s


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("shift_s", "is_shifted"), [(0.19, False), (0.21, True), (0.9, True)])
@pytest.mark.parametrize("course_rad", [0.0, 2.0, -0.7])
def test_stamps_that_jump_by_more_than_a_fifth_of_a_second_are_shifted_back(
    sign: float, shift_s: float, is_shifted: bool, course_rad: float
) -> None:
    """Back in time too, where the next stamp is still later than the one before."""
    reported = Reported(course_rad=course_rad)
    reported.tell(5)
    if sign < 0.0:
        reported.tell(1, after_s=1.0, late_s=0.0)
    error_s = reported.tell(1, shift_s=sign * shift_s, after_s=1.0 if sign < 0.0 else STEP_S)
    assert error_s == pytest.approx(0.0 if is_shifted else sign * shift_s, abs=1e-6)
    assert (reported.timing.finding != "") == is_shifted


def test_a_jump_of_stamps_is_said_with_its_sign_and_over_after_the_jump_back() -> None:
    reported = Reported()
    assert reported.timing.finding == ""
    reported.tell(5)
    reported.tell(5, shift_s=0.5)
    assert reported.timing.finding == "its stamps have jumped by +0.50 s: shifted back"
    reported.tell(1, after_s=1.0)
    assert (reported.timing.shift_s, reported.timing.finding) == (0.0, "")


@pytest.mark.parametrize(
    ("late_s", "is_shifted"), [(0.0, True), (0.1, True), (-0.1, True), (0.2, False), (-0.2, False)]
)
def test_a_shift_by_the_position_is_supported_by_the_arrival_within_30_percent(late_s: float, is_shifted: bool) -> None:
    """Of 0.5 s: within 0.15 s."""
    reported = Reported()
    reported.tell(5)
    reported.tell(1, shift_s=0.5, late_s=late_s)
    assert (reported.timing.shift_s != 0.0) == is_shifted


@pytest.mark.parametrize(("late_s", "is_shifted"), [(0.09, True), (0.11, False)])
def test_a_small_shift_is_supported_within_half_of_it(late_s: float, is_shifted: bool) -> None:
    """Of 0.21 s: within 0.105 s, which is less than 0.12 s."""
    reported = Reported()
    reported.tell(5)
    reported.tell(1, shift_s=0.21, late_s=late_s)
    assert (reported.timing.shift_s != 0.0) == is_shifted


@pytest.mark.parametrize(("across_m", "is_shifted"), [(3.0, True), (-3.0, True), (3.6, False), (-3.6, False)])
@pytest.mark.parametrize("course_rad", [0.0, 1.1])
def test_what_a_shift_of_stamps_displaces_lies_along_the_velocity(
    across_m: float, is_shifted: bool, course_rad: float
) -> None:
    """0.5 s at 22 m/s are 11 m along it: 3.3 m across are 30 %."""
    reported = Reported(course_rad=course_rad)
    reported.tell(5)
    aside_m = -across_m * math.sin(course_rad), across_m * math.cos(course_rad)
    reported.tell(1, shift_s=0.5, off_m=aside_m)
    assert (reported.timing.shift_s != 0.0) == is_shifted


@pytest.mark.parametrize(("speed_mps", "is_shifted"), [(1.9, False), (2.1, True)])
def test_one_that_hardly_moves_tells_no_time_by_its_positions(speed_mps: float, is_shifted: bool) -> None:
    """At 2 m/s and more a stamp that is 1.1 s ahead is off by the 2 m that are suspected."""
    reported = Reported(speed_mps)
    reported.tell(5)
    reported.tell(1, shift_s=1.1)
    assert (reported.timing.shift_s != 0.0) == is_shifted


@pytest.mark.parametrize(("noise_m2", "is_shifted"), [(-4.0, True), (2.3, True), (2.6, False)])
def test_a_shift_stands_out_of_the_noise_of_two_positions_by_five_standard_deviations(
    noise_m2: float, is_shifted: bool
) -> None:
    """0.5 s are 11 m: 5 sqrt(2 v) is less up to v = 2.42 m²."""
    reported = Reported()
    reported.timing.noise_m2 = noise_m2
    reported.tell(5)
    reported.tell(1, shift_s=0.5)
    assert (reported.timing.shift_s != 0.0) == is_shifted


def test_stamps_that_repeat_while_positions_move_stand_still_from_the_third_on() -> None:
    reported = Reported()
    reported.tell(5)
    stamp_s = reported.true_s
    for number in range(1, 6):
        reported.true_s = stamp_s + number * STEP_S
        place_m, now_ns = (SPEED_MPS * reported.true_s, 0.0), round(reported.true_s * 1e9)
        reported.timing.take(stamp_s, round(stamp_s * 1e9), now_ns, place_m, reported.mps, 1.0)
        assert reported.timing.frozen == (number >= 3)
    assert reported.timing.finding == "the stamps of its positions stand still"
    reported.timing.take(stamp_s, round(stamp_s * 1e9), now_ns, place_m, reported.mps, 1.0)
    assert reported.timing.frozen, "the same position, and still the same stamp"
    reported.tell(1)
    assert not reported.timing.frozen


def test_samples_whose_stamps_stand_still_or_are_not_known_are_passed_on() -> None:
    flight, nothing = Flight(), Commanded(math.nan, UNKNOWN, stops=False)
    flight.fly(30)
    for frozen in (True, False):
        sample = flight.sample(off_m=(500.0, 0.0, 0.0))
        if frozen:
            flight.health._timing.frozen = True
            flight.vehicle.telemetry.motion.stamp_s = flight.at_s - 0.1
        else:
            flight.vehicle.telemetry.motion = None
        assert flight.health.examine(sample, NOISE, nothing, after(START, flight.at_s), leads=False) is sample


def test_one_position_taken_again_and_again_has_one_stamp() -> None:
    reported = Reported()
    reported.tell(5)
    for _ in range(9):
        reported.tell(1, after_s=0.0)
    assert not reported.timing.frozen


@pytest.mark.parametrize("rate", [0.2, -0.2])
def test_stamps_of_another_rate_are_found_once_they_have_gained_a_quarter_of_a_second(rate: float) -> None:
    """0.02 s each 0.1 s, with 1 - 0.1 / 3 of the sum kept: 0.6 (1 - 0.9667^n) is more than 0.25 from n = 16 on."""
    reported = Reported()
    reported.tell(10)
    found_at = 0
    for number in range(1, 40):
        reported.tell(1, shift_s=rate * STEP_S * number)
        found_at = found_at or (number if reported.timing.by_arrival else 0)
    assert found_at == 16
    assert (
        reported.timing.finding == "its stamps run at another rate than its positions come and move: timed by arrival"
    )
    assert reported.tell(1, shift_s=7.0) == pytest.approx(0.0, abs=0.02), "by arrival, less the usual age"


@pytest.mark.parametrize("course_rad", [0.9, 2.4, -0.6, -2.0])
def test_stamps_of_another_rate_are_found_on_every_course(course_rad: float) -> None:
    reported = Reported(course_rad=course_rad)
    for number in range(40):
        reported.tell(1, shift_s=0.2 * STEP_S * number)
    assert reported.timing.by_arrival


@pytest.mark.parametrize(("speed_mps", "is_found"), [(2.9, False), (3.1, True)])
def test_rates_are_reported_by_positions_from_3_mps_on(speed_mps: float, is_found: bool) -> None:
    reported = Reported(speed_mps)
    for number in range(60):
        reported.tell(1, shift_s=0.2 * STEP_S * number)
    assert reported.timing.by_arrival == is_found


def test_stamps_that_run_rightly_for_three_seconds_are_believed_again_with_the_shift_that_is_left() -> None:
    """Late by arrival within 0.1 s: 0.25 s of drift leak below that in 3 s * ln 2.5 and some, then 3 s follow."""
    reported = Reported()
    reported.tell(10)
    for number in range(1, 21):
        reported.tell(1, shift_s=0.3 * STEP_S * number)
    assert reported.timing.by_arrival
    right = 0
    while reported.timing.by_arrival:
        reported.tell(1, shift_s=0.6)
        right += 1
    sum_s = 0.9 * (1.0 - (1.0 - STEP_S / 3.0) ** 20)
    leaks = math.ceil(math.log(0.1 / sum_s) / math.log(1.0 - STEP_S / 3.0))
    assert right == pytest.approx(leaks + 30, abs=1.0)
    assert reported.timing.shift_s == pytest.approx(-0.6, abs=0.01)
    assert reported.tell(5, shift_s=0.6) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("late_s", "lasts_s", "is_late"), [(0.94, 4.0, False), (0.96, 2.0, False), (0.96, 2.1, True)])
def test_a_position_is_late_when_it_has_been_older_than_expected_for_two_seconds(
    late_s: float, lasts_s: float, is_late: bool
) -> None:
    """1 s is expected at most; 0.05 s are under way. The first late one begins the time."""
    reported = Reported()
    reported.tell(round(lasts_s / STEP_S), late_s=late_s)
    assert reported.timing.late_s == pytest.approx(late_s + 0.05 if is_late else 0.0)
    reported.tell(1)
    assert reported.timing.late_s == 0.0
    reported.tell(19, late_s=late_s)
    assert reported.timing.late_s == 0.0, "the time begins again"


def test_a_gap_of_four_seconds_tells_no_time() -> None:
    """A position may have turned meanwhile: 3.9 s after another a stamp's jump is found, 4.5 s after it isn't."""
    for gap_s, is_shifted in ((2.9, True), (3.9, False)):
        reported = Reported()
        reported.tell(5)
        reported.tell(1, shift_s=1.0, after_s=gap_s)
        assert (reported.timing.shift_s != 0.0) == is_shifted
