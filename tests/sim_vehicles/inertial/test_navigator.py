"""Telemetry of an emulated vehicle that navigates by inertia, against the whole strap-down computation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from airlink import mavlink as m
from airlink.clock import NANOSECONDS, Instant
from airlink.endpoint import VehicleId
from flight_model.earth import GeodeticOrigin
from flight_model.spline import SplinePath
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from sim_vehicles.airframe.motion import Motion
from sim_vehicles.inertial.alignment import limits
from sim_vehicles.inertial.error_model import TILT
from sim_vehicles.inertial.experiment import exact_start, navigate
from sim_vehicles.inertial.imu import InertialSensors, Trajectory, attitude, inertial_sensors
from sim_vehicles.inertial.navigator import InertialNavigator
from sim_vehicles.inertial.strapdown import displaced
from tests.sim_vehicles.inertial.angles import angles
from tests.sim_vehicles.inertial.keys import inertial_keys

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
PATH, SPEED_MPS = SplinePath([[0, 0, 200], [700, 0, 200], [1400, 300, 220], [2000, 900, 190], [2100, 3000, 200]]), 22.0
BIASES = (1e-3, 5e-4, -5e-4), (2e-6, -1e-6, 1e-6)
QUIET = InertialSensors(*BIASES, 0.0, 0.0)
NOISY = InertialSensors(*BIASES, 2e-4, 6e-7)
STEP = Instant(100_000_000)
KEYS = InertialNavigation(source="ins", sensors=InertialSensorKeys(accel_bias_ug=100.0, gyro_bias_deg_per_h=0.02))
RANDOM = KEYS.model_copy(update={"biases": "random"})


def motion(time_s: float) -> Motion:
    point = PATH.at(SPEED_MPS * time_s)
    turn_rate, climb = SPEED_MPS * point.curvature_1pm, SPEED_MPS * point.slope
    north, east = SPEED_MPS * math.cos(point.course_rad), SPEED_MPS * math.sin(point.course_rad)
    position = point.north_m, point.east_m, point.height_m, climb, SPEED_MPS, point.course_rad
    return Motion(*position, north, east, -climb, 0.0, 0.0, 0.0, turn_rate, SPEED_MPS, point.course_rad, point.height_m)


def flown(keys: InertialNavigation, end_s: int, seed: int = 1) -> np.ndarray:
    """Return the errors (10 end_s, 4): east, north, up in m and heading in rad, ten times a second."""
    navigator = InertialNavigator(keys, ORIGIN, 0.0, VehicleId(1, 1), seed)
    rows = list[tuple[float, ...]]()
    for sample in range(10 * end_s):
        true = motion(sample / 10)
        sensed = navigator.sense(true, Instant(sample * STEP))
        rows.append((sensed.east_m - true.east_m, sensed.north_m - true.north_m, sensed.height_m - true.height_m))
    return np.array(rows)


def test_without_aid_it_errs_as_the_strap_down_computation_does() -> None:
    trajectory = Trajectory.along(PATH, SPEED_MPS, ORIGIN, 200.0)
    whole = navigate(trajectory, exact_start(trajectory, QUIET), QUIET, None, 20.0, np.random.default_rng(1))
    assert flown(inertial_keys(QUIET), 200)[-1] == pytest.approx(whole.errors[-1, :3], rel=0.03, abs=0.3)


def test_gnss_holds_its_position_and_every_seed_has_its_own_errors() -> None:
    aided = inertial_keys(NOISY, aiding="gnss")
    one, other = flown(aided, 100), flown(aided, 40, seed=2)
    assert np.abs(one[200:]).max() < 2.0
    assert np.abs(one[:400] - other)[200:].max() > 0.1
    assert np.array_equal(one[:400], flown(aided, 40))


@pytest.mark.slow
def test_the_filter_takes_random_biases_for_what_they_are() -> None:
    """Normalised errors squared of 20 navigators with GNSS after 30 s: chi-square, 20 times 15 degrees of freedom."""
    drawn, squares = inertial_keys(NOISY, aiding="gnss", biases="random"), list[float]()
    for seed in range(20):
        sensors = inertial_sensors(drawn, seed, VehicleId(1, 1))
        sigmas = NOISY.accel_bias_sigma, NOISY.gyro_bias_sigma
        assert (sensors.accel_bias_sigma, sensors.gyro_bias_sigma) == pytest.approx(sigmas, rel=1e-12)
        navigator = InertialNavigator(drawn, ORIGIN, 0.0, VehicleId(1, 1), seed)
        for sample in range(305):
            navigator.sense(motion(sample / 10), Instant(sample * STEP))
        errors, covariance = navigator._errors, navigator._filter.covariance
        squares.append(float(errors @ np.linalg.solve(covariance, errors)))
    low, high = (float(chi2.ppf(share, 15 * 20)) for share in (0.005, 0.995))
    assert low < sum(squares) < high


def test_random_biases_are_each_vehicle_s_own() -> None:
    first, second = (inertial_sensors(RANDOM, 1, VehicleId(1, system)) for system in (1, 2))
    assert first != second
    assert first == inertial_sensors(RANDOM, 1, VehicleId(1, 1))
    assert inertial_sensors(KEYS, 1, VehicleId(1, 1)) == inertial_sensors(KEYS, 2, VehicleId(1, 2))


def test_telemetry_shows_the_attitude_that_the_navigator_computes() -> None:
    """The computed attitude is (I - [phi x]) times the true one; all three angles are read from that matrix."""
    navigator = InertialNavigator(inertial_keys(QUIET), ORIGIN, 0.0, VehicleId(1, 1), 1)
    true = motion(60.0)
    true.turn_rate_radps = true.climb_mps = 0.0
    navigator.sense(true, Instant(0))
    navigator._errors[TILT] = (2e-3, -3e-3, 4e-3)
    level = attitude(*(np.array(angle) for angle in (true.heading_rad, 0.0, 0.0)))
    heading_rad, pitch_rad, bank_rad = angles(displaced(level, np.array((2e-3, -3e-3, 4e-3)))).tolist()
    sensed, estimate = navigator.sense(true, Instant(0)), navigator.estimate(true, Instant(0))
    assert sensed.heading_rad == pytest.approx(heading_rad, abs=1e-4)
    assert estimate.pitch_error_rad == pytest.approx(pitch_rad, abs=1e-4)
    assert estimate.bank_error_rad == pytest.approx(bank_rad, abs=1e-4)


def test_without_a_receiver_there_is_no_fix_and_a_position_that_drifts_away_is_called_unknown() -> None:
    navigator = InertialNavigator(inertial_keys(NOISY), ORIGIN, 0.0, VehicleId(1, 1), 1)
    sigmas_m = list[float]()
    for second in range(0, 401, 50):
        estimate = navigator.estimate(motion(float(second)), Instant(second * NANOSECONDS))
        assert estimate.received is None
        sigmas_m.append(math.hypot(*np.sqrt(np.diag(navigator._filter.covariance)[:2])))
        assert bool(estimate.unknown & m.EKF_POS_HORIZ_ABS) == (sigmas_m[-1] > 50.0)
    assert sigmas_m[0] < 1.0
    assert sigmas_m[-1] > 50.0


def test_a_receiver_s_fix_errs_as_the_receiver_does_and_not_as_the_navigator() -> None:
    aided = InertialNavigator(inertial_keys(NOISY, aiding="gnss"), ORIGIN, 0.0, VehicleId(1, 1), 1)
    off_m, ratios = list[float](), list[float]()
    for sample in range(1, 3000, 10):
        true = motion(sample / 10)
        estimate = aided.estimate(true, Instant(sample * STEP))
        if estimate.received is not None:
            off_m.append(estimate.received.north_m - true.north_m)
            ratios.append(estimate.ratios.horizontal)
    assert np.std(off_m) == pytest.approx(1.5, rel=0.15)
    assert 0.1 < np.median(ratios) < 0.4, "normal innovations by a gate of five standard deviations"


def test_the_measured_airspeed_has_its_own_error() -> None:
    navigator = InertialNavigator(inertial_keys(QUIET, airspeed_sigma_mps=0.2), ORIGIN, 0.0, VehicleId(1, 1), 1)
    off_mps = [
        navigator.sense(true, Instant(sample * STEP)).airspeed_mps - true.airspeed_mps
        for sample in range(1000)
        for true in (motion(sample / 10),)
    ]
    assert np.std(off_mps) == pytest.approx(0.2, rel=0.1)


def test_an_aligned_vehicle_begins_with_the_heading_error_that_alignment_leaves() -> None:
    """The errors are drawn from the filter's covariance: about epsilon / (Omega cos L)."""
    sigma = limits(NOISY, ORIGIN)[2]
    aligned = inertial_keys(NOISY, flight_start="aligned", alignment_s=300)
    navigators = [InertialNavigator(aligned, ORIGIN, 0.0, VehicleId(1, 1), seed) for seed in range(20)]
    sensed = [each.sense(motion(0.0), Instant(0)).heading_rad for each in navigators]
    assert 0.6 * sigma < np.std(sensed) < 1.5 * sigma


def test_the_errors_of_a_sample_stay_until_the_next() -> None:
    navigator = InertialNavigator(inertial_keys(NOISY), ORIGIN, 0.0, VehicleId(1, 1), 1)
    still = motion(0.0)
    instants = Instant(350_000_000), Instant(399_000_000), Instant(400_000_000)
    numbers = [each for each in dir(still) if each.endswith(("_m", "_mps", "_rad", "_radps"))]
    first, same, other = ([getattr(navigator.sense(still, at), each) for each in numbers] for at in instants)
    assert len(numbers) == 17
    assert first == same != other
