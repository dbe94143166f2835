"""Position against velocity, heading against course, stamps against arrival: telemetry of one vehicle, not flown."""

import math

import numpy as np
import pytest

from gcs_formation.features.telemetry_health.consistency import POSITION, VELOCITY, Consistency
from gcs_formation.features.telemetry_health.heading_and_airspeed import AirspeedJumps, HeadingCheck
from gcs_formation.features.telemetry_health.timing import Timing

STEP_S, SPEED_MPS, TURN_RPS = 0.1, 22.0, 0.15
FASTEST_MPS = 60.0


class Turning:
    """An aircraft that turns steadily; what it says can be altered."""

    def __init__(self, *, sigma_m=0.0, sigma_mps=0.0, witness=True, seed=1):
        self.checked, self.random = Consistency(2, FASTEST_MPS), np.random.default_rng(seed)
        self.sigmas, self.witness, self.time_s = (sigma_m, sigma_mps), witness, 0.0
        self.variances = sigma_m**2, sigma_mps**2

    def truth(self):
        heading = TURN_RPS * self.time_s
        radius_m = SPEED_MPS / TURN_RPS
        place = [radius_m * math.sin(heading), radius_m * (1.0 - math.cos(heading))]
        return place, [SPEED_MPS * math.cos(heading), SPEED_MPS * math.sin(heading)]

    def fly(self, seconds, place_of=None, velocity_of=None):
        """Return how long it took until something was disbelieved, None if nothing was."""
        begun_s, found_s = self.time_s, None
        for _ in range(round(seconds / STEP_S)):
            self.time_s += STEP_S
            place, velocity = self.truth()
            witness = velocity if self.witness else [math.nan, math.nan]
            place = list(np.add(place, self.sigmas[0] * self.random.standard_normal(2)))
            told = list(np.add(velocity, self.sigmas[1] * self.random.standard_normal(2)))
            place = place if place_of is None else place_of(place, self.time_s - begun_s)
            told = told if velocity_of is None else velocity_of(told)
            self.checked.take(1 + round(self.time_s * 1e9), place, told, witness, self.variances)
            if found_s is None and self.checked.wrong is not None:
                found_s = self.time_s - begun_s
        return found_s

    def off_m(self):
        """Return how far what is flown is from the truth, in place and velocity."""
        place, velocity = self.truth()
        axes = self.checked.axes
        return (
            math.dist(place, [axis.flown_m for axis in axes]),
            math.dist(velocity, [axis.flown_mps for axis in axes]),
        )


@pytest.mark.parametrize(("sigma_m", "sigma_mps"), [(0.0, 0.0), (0.5, 0.1), (2.0, 0.5)])
def test_true_telemetry_is_believed_for_half_an_hour(sigma_m, sigma_mps):
    assert Turning(sigma_m=sigma_m, sigma_mps=sigma_mps).fly(1800.0) is None


@pytest.mark.parametrize("turned_rad", [0.05, -0.1, 0.2])
def test_on_an_arc_a_position_moves_by_more_than_the_mean_of_the_velocities_at_its_ends(turned_rad):
    """The chord is 2 r sin x and the mean v cos x, with x half the angle: their ratio is tan x / x."""
    checked = Consistency(2, FASTEST_MPS)
    north, east = checked.axes
    north.rate_mps, east.rate_mps = SPEED_MPS * math.cos(1.0), SPEED_MPS * math.sin(1.0)
    half = turned_rad / 2.0
    later = [SPEED_MPS * math.cos(1.0 + turned_rad), SPEED_MPS * math.sin(1.0 + turned_rad)]
    assert checked._arc(later) - 1.0 == pytest.approx(math.tan(half) / half - 1.0, rel=0.02)


def test_noise_that_hides_what_else_is_wrong_is_said_and_an_outlier_is_no_noise():
    flown = Turning(sigma_m=2.0, sigma_mps=0.3)
    flown.fly(10.0)
    flown.fly(0.1, place_of=lambda place, _s: [place[0] + 200.0, place[1]])
    flown.fly(10.0)
    assert not flown.checked.is_noisy
    flown.sigmas = 10.0, 0.3
    flown.fly(3.0)
    assert flown.checked.is_noisy
    flown.sigmas = 1.0, 0.3
    flown.fly(10.0)
    assert not flown.checked.is_noisy


def test_a_position_that_scatters_is_flown_as_its_velocity_carries_it():
    flown = Turning()
    flown.fly(10.0)
    flown.sigmas = 10.0, 0.0
    flown.fly(3.0)
    assert flown.checked.is_noisy
    off_m = list[float]()
    for _ in range(300):
        flown.fly(STEP_S)
        off_m.append(flown.off_m()[0])
    assert max(off_m) < 4.0, "of positions that are off by 30 m"
    assert np.mean(off_m) < 1.5


@pytest.mark.parametrize("seed", [0, 6, 77, 81, 88])
def test_noise_that_was_taken_for_a_jump_first_displaces_no_vehicle_once_it_is_known(seed):
    """Flown otherwise by 14 to 18 m by these seeds, two multirotors came within 7.4 m."""
    flown = Turning(seed=seed)
    flown.fly(6.0)
    flown.sigmas = 10.0, 0.0
    assert flown.fly(40.0) is not None
    assert flown.checked.displaced_m == 0.0
    assert flown.off_m()[0] < 3.0


@pytest.mark.parametrize("rounding_m", [0.0, 1e-13])
def test_one_that_has_stopped_is_not_believed_to_be_where_its_frozen_position_was(rounding_m):
    """What was added to its position, and is taken off before it is checked, rounds the last bits."""
    axes, still = Consistency(2, FASTEST_MPS), [0.0, 0.0]
    for number in range(1, 300):
        time_s = number * STEP_S
        speed_mps = max(0.0, 5.0 - max(0.0, time_s - 6.0))  # it brakes from 6 s on
        place = [5.0 * min(time_s, 4.0) + rounding_m * (number % 3), 0.0]  # and its position is frozen from 4 s on
        axes.take(
            1 + round(time_s * 1e9), place, [speed_mps, 0.0], still if not speed_mps else [speed_mps, 0.0], (0, 0)
        )
    assert axes.wrong == POSITION
    assert axes.axes[0].flown_m == pytest.approx(5.0 * 6.0 + 12.5, abs=1.0)
    for number in range(300, 340):  # it is told again, 2 m farther on
        axes.take(1 + round(number * STEP_S * 1e9), [42.5 + 1e-3 * (number % 2), 0.0], still, still, (0, 0))
    assert axes.wrong is None
    assert axes.displaced_m == 0.0


def test_a_frozen_position_is_found_at_once_and_carried_on_by_the_velocity():
    flown = Turning()
    flown.fly(5.0)
    frozen, _ = flown.truth()
    assert flown.fly(20.0, place_of=lambda _place, _s: frozen) <= 0.4 + 1e-9
    assert flown.checked.wrong == POSITION
    assert flown.checked.lasts
    assert flown.off_m()[0] < 0.5


def climbing(height_of, rate_mps=0.7, seconds=60.0):
    """Return a height's check after a steady climb, as it is reported, and when it was first not accepted, s."""
    checked, found_s = Consistency(1, FASTEST_MPS), None
    for number in range(1, round(seconds / STEP_S)):
        time_s = number * STEP_S
        checked.take(1 + round(time_s * 1e9), [height_of(rate_mps * time_s)], [rate_mps], [rate_mps], (0.0, 0.0))
        if found_s is None and checked.wrong is not None:
            found_s = time_s
    return checked, found_s


@pytest.mark.parametrize(("step_m", "least_m"), [(0.001, 0.5), (1.0, 1.0)])
def test_a_frozen_height_is_found_once_it_should_have_moved_by_more_than_its_steps(step_m, least_m):
    frozen_at_m = 7.0
    checked, found_s = climbing(lambda height_m: step_m * math.floor(min(height_m, frozen_at_m) / step_m), seconds=13.0)
    assert found_s == pytest.approx((frozen_at_m + least_m) / 0.7, abs=2.5 * STEP_S)
    assert checked.wrong == POSITION
    assert checked.axes[0].flown_m == pytest.approx(0.7 * 12.9, abs=0.1)


def test_heights_in_whole_metres_are_not_frozen():
    assert climbing(math.floor)[1] is None


def test_a_jump_is_taken_out_and_a_jump_back_forgets_it():
    flown = Turning()
    flown.fly(5.0)
    assert flown.fly(5.0, place_of=lambda place, _s: [place[0], place[1] + 20.0]) <= 0.3 + 1e-9
    assert flown.checked.wrong is None  # it moves by its velocity again
    assert flown.checked.displaced_m == pytest.approx(20.0, abs=0.1)
    assert flown.off_m()[0] < 0.1
    flown.fly(5.0)
    assert flown.checked.displaced_m == 0.0
    assert flown.off_m()[0] < 0.01


def test_an_outlier_is_no_fault_and_is_not_flown():
    flown = Turning()
    flown.fly(5.0)
    assert flown.fly(0.1, place_of=lambda place, _s: [place[0] + 40.0, place[1]]) is None
    assert flown.off_m()[0] < 0.1
    assert flown.fly(20.0) is None
    assert flown.off_m()[0] < 0.01


def test_positions_that_begin_to_scatter_are_found_within_a_second_mostly_and_within_one_and_a_half():
    found_s = list[float]()
    for seed in range(20):
        flown = Turning(seed=seed)
        flown.fly(6.0)
        begun_s, noise = flown.time_s, flown.random.standard_normal
        while not flown.checked.is_noisy:
            flown.fly(STEP_S, place_of=lambda place, _s, noise=noise: list(np.add(place, 10.0 * noise(2))))
        found_s.append(flown.time_s - begun_s)
    assert np.median(found_s) < 1.0
    assert max(found_s) < 1.5


def test_a_single_outlier_is_no_scatter():
    flown = Turning()
    flown.fly(6.0)
    flown.fly(0.1, place_of=lambda place, _s: [place[0] + 400.0, place[1]])
    for _ in range(20):
        flown.fly(0.1)
        assert not flown.checked.is_noisy


def test_outliers_among_samples_are_no_fault():
    flown, random = Turning(), np.random.default_rng(2)

    def outlying(place, _s):
        return list(np.add(place, 20.0 * (random.random() < 0.05) * random.choice([-1.0, 1.0], 2)))

    assert flown.fly(300.0, place_of=outlying) is None


def test_noise_that_none_declared_is_known_within_seconds():
    flown = Turning(sigma_m=3.0, sigma_mps=0.2)
    flown.variances = 0.01, 0.01
    assert flown.fly(600.0) is None


@pytest.mark.parametrize(("rate_mps", "most_s"), [(10.0, 0.6), (3.0, 1.3), (1.0, 6.0)])
def test_a_drift_is_found_the_sooner_the_faster_it_is(rate_mps, most_s):
    flown = Turning()
    flown.fly(5.0)
    assert flown.fly(8.0, place_of=lambda place, s: [place[0] + rate_mps * s, place[1]]) <= most_s
    assert flown.checked.wrong == POSITION
    assert flown.off_m()[0] < 4.5


@pytest.mark.parametrize("witness", [True, False])
@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_a_velocity_that_is_empty_or_opposite_is_replaced_by_the_positions_own(witness, factor):
    flown = Turning(witness=witness)
    flown.fly(5.0)
    assert flown.fly(10.0, velocity_of=lambda told: [factor * each for each in told]) <= 0.4 + 1e-9
    assert flown.checked.wrong == VELOCITY
    off_m, off_mps = flown.off_m()
    assert off_m < 0.5
    assert off_mps < (0.5 if witness else 2.5)


def test_a_velocity_of_0_is_an_outlier_twice_and_not_filled_the_third_time():
    flown = Turning()
    flown.fly(5.0)
    assert flown.fly(0.2, velocity_of=lambda _told: [0.0, 0.0]) is None
    flown = Turning()
    flown.fly(5.0)
    assert flown.fly(0.3, velocity_of=lambda _told: [0.0, 0.0]) == pytest.approx(0.3)
    assert flown.checked.wrong == VELOCITY


def test_a_velocity_at_half_its_value_is_reported_from_a_position_by_the_witness():
    flown = Turning()
    flown.fly(5.0)
    flown.fly(3.0, velocity_of=lambda told: [each / 2.0 for each in told])
    assert flown.checked.wrong == VELOCITY


def test_a_gap_or_a_restart_is_no_jump():
    flown = Turning()
    flown.fly(5.0)
    flown.time_s += 60.0
    assert flown.fly(5.0) is None
    flown.checked.forget()
    assert flown.fly(5.0, place_of=lambda place, _s: [place[0] + 500.0, place[1]]) is None


def test_a_height_that_drifts_in_level_flight_is_the_height_and_a_false_rate_is_the_rate():
    def found(height_of, climb_mps, commanded_mps):
        checked = Consistency(1, 14.0)
        for tick in range(60):
            checked.take(1 + round(tick * 1e8), [height_of(tick / 10.0)], [climb_mps], [commanded_mps], (0.0, 0.0))
        return checked.wrong

    assert found(lambda s: 100.0 - 3.0 * s, 0.0, 0.0) == POSITION  # commanded level
    assert found(lambda s: 100.0 + 2.0 * s, 0.0, 2.0) == VELOCITY  # commanded to climb, and does
    assert found(lambda s: 100.0 + 2.0 * s, -2.0, math.nan) == VELOCITY  # its sign is wrong
    assert found(lambda _s: 100.0, 2.0, 2.0) == POSITION  # frozen on a climb
    assert found(lambda _s: 100.0, 0.0, 0.0) is None


class TestHeading:
    def taken(self, told, course):
        checked = HeadingCheck(0.25)
        return checked, [
            checked.take(1 + round(i * 1e8), each, 22.0 * math.cos(way), 22.0 * math.sin(way), 0.0)
            for i, (each, way) in enumerate(zip(told, course, strict=True))
        ]

    def test_a_true_heading_is_flown_to_the_bit(self):
        course = [0.02 * i for i in range(100)]
        assert self.taken(course, course)[1] == course

    def test_a_jump_is_taken_out(self):
        course = [0.02 * i for i in range(60)]
        told = course[:30] + [each + 0.5 for each in course[30:]]
        _, flown = self.taken(told, course)
        assert flown == pytest.approx(course, abs=1e-9)

    def test_a_heading_that_is_frozen_in_a_bend_is_turned_with_the_course(self):
        course = [0.02 * i for i in range(60)]
        checked, flown = self.taken(course[:30] + [course[29]] * 30, course)
        assert checked.frozen
        assert flown[-1] == pytest.approx(course[-1], abs=1e-6)

    def test_a_gust_that_turns_the_course_of_straight_flight_is_no_fault(self):
        checked, flown = self.taken([0.0] * 60, [0.0] * 30 + [0.25] * 30)
        assert not checked.frozen
        assert flown == [0.0] * 60


def test_an_airspeed_that_jumps_is_taken_to_be_as_before_until_it_jumps_back():
    checked = AirspeedJumps(1.5)
    told = [22.0] * 30 + [13.2] * 5 + [22.5] * 5
    flown = [checked.take(1 + round(i * 1e8), each, 0.0) for i, each in enumerate(told)]
    assert flown == pytest.approx([22.0] * 35 + [22.5] * 5)


class TestStamps:
    def taken(self, shifts_s, *, arrivals_s=None, course_rad=0.0):
        """Return the error of each stamp used, s, of positions sent every 0.1 s with these shifts of their stamps."""
        timing, errors = Timing(), list[float]()
        north_mps, east_mps = 22.0 * math.cos(course_rad), 22.0 * math.sin(course_rad)
        for i, shift_s in enumerate(shifts_s):
            true_s = 10.0 + i * STEP_S
            arrival_s = true_s + 0.05 + (0.0 if arrivals_s is None else arrivals_s[i])
            commanded_ns = round((true_s + shift_s) * 1e9)
            place_m, arrived_ns = (north_mps * true_s, east_mps * true_s), round(arrival_s * 1e9)
            used = timing.take(commanded_ns * 1e-9, commanded_ns, arrived_ns, place_m, (north_mps, east_mps), 1.0)
            errors.append(used * 1e-9 - true_s)
        return timing, errors

    @pytest.mark.parametrize(("shift_s", "course_rad"), [(0.5, 0.0), (3.0, 0.0), (0.5, 1.6), (0.5, -2.5)])
    def test_stamps_that_jump_ahead_are_shifted_back(self, shift_s, course_rad):
        timing, errors = self.taken([0.0] * 10 + [shift_s] * 10, course_rad=course_rad)
        assert max(map(abs, errors)) < 0.01
        assert timing.shift_s == pytest.approx(-shift_s)

    @pytest.mark.parametrize("rate", [0.3, 0.15, -0.3])
    def test_stamps_that_run_at_another_rate_are_timed_by_arrival_until_they_run_rightly(self, rate):
        drift_s = [rate * STEP_S * max(0, min(i - 50, 50)) for i in range(200)]
        timing, errors = self.taken(drift_s)
        assert max(map(abs, errors)) < 0.35
        assert max(map(abs, errors[80:100])) < 0.1, "while they drift by up to 1.5 s"
        assert not timing.by_arrival
        assert max(map(abs, errors[150:])) < 0.1

    def test_positions_that_drift_ahead_and_links_that_slow_down_dont_alter_stamps_rates(self):
        timing, errors = self.taken([0.0] * 100, arrivals_s=[0.02 * i for i in range(100)])
        assert not timing.by_arrival
        assert max(map(abs, errors)) < 1e-6

    def test_a_link_that_slows_down_moves_no_stamp(self):
        timing, errors = self.taken([0.0] * 20, arrivals_s=[0.0] * 10 + [0.4] * 10)
        assert max(map(abs, errors)) < 1e-6
        assert timing.late_s == 0.0

    def test_positions_that_are_seconds_old_for_long_are_late(self):
        timing, _ = self.taken([0.0] * 40, arrivals_s=[2.0] * 40)
        assert timing.late_s == pytest.approx(2.05)
        briefly, _ = self.taken([0.0] * 19, arrivals_s=[2.0] * 19)
        assert briefly.late_s == 0.0, "the link's measured delay may follow"

    @pytest.mark.parametrize(("noise_m2", "shift_s"), [(0.0, 0.22), (1.0, 0.0)])
    def test_a_noisy_position_that_comes_late_is_no_jump_of_its_stamp(self, noise_m2, shift_s):
        timing = Timing()
        timing.noise_m2 = noise_m2
        for i in range(10):
            late_s = 0.22 if i == 9 else 0.0
            place_m = 22.0 * (i * STEP_S + late_s), 0.0
            arrived_ns = round((i * STEP_S + late_s) * 1e9) + 1
            timing.take(i * STEP_S, 1 + round(i * STEP_S * 1e9), arrived_ns, place_m, (22.0, 0.0), 1.0)
        assert timing.shift_s == pytest.approx(shift_s)
