"""Alignment: what a vehicle at rest learns about its attitude, and what it can't."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from flight_model.earth import GeodeticOrigin
from flight_model.spline import SplinePath
from sim_vehicles.inertial.alignment import STATES, TILTS, FineAlignment, align, coarse, limits
from sim_vehicles.inertial.error_model import ACCEL_BIAS, GYRO_BIAS, barometer, gnss
from sim_vehicles.inertial.experiment import exact_start, navigate
from sim_vehicles.inertial.imu import InertialSensors, Trajectory, attitude

POSITION = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 1.0)
MICRO_G, DEGREE_PER_HOUR = 9.797336e-6, math.radians(1.0) / 3600.0
UNITS = np.radians((1.0 / 3600.0, 1.0 / 3600.0, 1.0 / 60.0))
NOISE = 20.0 * MICRO_G, math.radians(0.002) / 60.0
WAYPOINTS_M = [[0, 0, 200], [700, 0, 200], [1400, 300, 220], [2000, 900, 190], [2100, 3000, 200]]


def sensors(accel_ug: float, gyro_deg_per_h: float, noise: tuple[float, float] = NOISE) -> InertialSensors:
    accel, gyro = accel_ug * MICRO_G, gyro_deg_per_h * DEGREE_PER_HOUR
    return InertialSensors((accel, accel, accel), (gyro, gyro, gyro), *noise)


def drawn(random: np.random.Generator) -> InertialSensors:
    """Return sensors with random biases of the size that the filter assumes."""
    a, b, c, d, e, f = random.standard_normal(6).tolist()
    accel, gyro = 100.0 * MICRO_G, 0.02 * DEGREE_PER_HOUR
    return InertialSensors((a * accel, b * accel, c * accel), (d * gyro, e * gyro, f * gyro), *NOISE)


AVIATION = sensors(100.0, 0.02)


def filtered(faulty: InertialSensors, end_s: int) -> FineAlignment:
    """Return a filter after some time; its covariance doesn't depend on the measurements."""
    fine = FineAlignment(POSITION, faulty)
    for _ in range(end_s):
        fine.update(np.zeros(2))
    return fine


def test_the_filter_s_sigmas_reach_what_can_not_be_aligned_away_from_above() -> None:
    """Level in a minute, heading in ten: b / g = 20.6", epsilon / (Omega cos L) = 5.58'."""
    fine, found = FineAlignment(POSITION, AVIATION), dict[int, list[float]]()
    for second in range(1, 901):
        fine.update(np.zeros(2))
        found[second] = (fine.sigma_rad / UNITS).tolist()
        assert (fine.sigma_rad > 0.999 * limits(AVIATION, POSITION)).all()
    assert found[30] == pytest.approx((49.7, 47.0, 298.5), abs=0.06)
    assert found[60] == pytest.approx((38.2, 25.7, 262.6), abs=0.06)
    assert found[120] == pytest.approx((29.3, 21.4, 93.3), abs=0.06)
    assert found[300] == pytest.approx((21.4, 20.9, 11.7), abs=0.06)
    assert found[600] == pytest.approx((20.7, 20.8, 6.09), abs=0.06)
    assert found[900] == pytest.approx((20.7, 20.7, 5.78), abs=0.06)


def test_only_the_northern_gyroscope_s_bias_becomes_known() -> None:
    sigma = np.sqrt(np.diag(filtered(AVIATION, 900).covariance(np.eye(3))))
    left = np.concatenate((sigma[ACCEL_BIAS][:2] / (100.0 * MICRO_G), sigma[GYRO_BIAS] / (0.02 * DEGREE_PER_HOUR)))
    assert left == pytest.approx((1.0, 1.0, 1.0, 0.26, 1.0), abs=0.005)


@pytest.mark.parametrize(
    ("accel_ug", "gyro_deg_per_h", "expected"),
    [
        (50.0, 0.01, (10.31, 2.790)),
        (100.0, 0.02, (20.63, 5.580)),
        (300.0, 1.0, (61.88, 279.0)),
        (1000.0, 0.1, (206.3, 27.90)),
        (2000.0, 10.0, (412.5, 2790.0)),
    ],
)
def test_what_no_alignment_takes_away(accel_ug: float, gyro_deg_per_h: float, expected: tuple[float, float]) -> None:
    east, north, heading = (limits(sensors(accel_ug, gyro_deg_per_h), POSITION) / UNITS).tolist()
    assert (east, north, heading) == pytest.approx((expected[0], *expected), rel=1e-3)


@pytest.mark.parametrize("gyro_deg_per_h", [1.0, 10.0])
def test_a_bias_as_large_as_the_earth_s_rotation_does_not_look_aligned(gyro_deg_per_h: float) -> None:
    coarse_grade = sensors(1000.0, gyro_deg_per_h)
    assert filtered(coarse_grade, 900).sigma_rad[2] > 0.99 * limits(coarse_grade, POSITION)[2]


def test_gravity_and_the_earth_s_rotation_show_any_attitude() -> None:
    rest = Trajectory.at_rest(POSITION, 0.0, 1.0)
    angle, velocity = (part[0] / 0.01 for part in rest.increments(0.01, 0, 1))
    leaning = attitude(*np.array((2.1, 0.1, -0.2)))
    assert coarse(leaning.T @ angle, leaning.T @ velocity) == pytest.approx(leaning, abs=1e-9)


@pytest.mark.slow
def test_the_filter_is_honest() -> None:
    """Thirty alignments with biases drawn as the filter assumes: white innovations, errors as large as it states."""
    random, nees, innovations = np.random.default_rng(3), list[float](), list[np.ndarray]()
    for _ in range(30):
        result = align(FineAlignment(POSITION, AVIATION), 0.0, drawn(random), 300, 20.0, random)
        error, tilts = result.error_rad[-1], np.ix_(STATES[TILTS], STATES[TILTS])
        nees.append(float(error @ np.linalg.solve(result.covariance[tilts], error)))
        innovations.append(result.innovations)
    low, high = (float(chi2.ppf(share, 3 * 30)) for share in (0.005, 0.995))
    assert low < sum(nees) < high
    white = np.concatenate(innovations)
    assert white.std(axis=0) == pytest.approx(1.0, abs=0.03)
    assert np.abs(np.mean([(each[1:] * each[:-1]).mean(axis=0) for each in innovations], axis=0)).max() < 0.03


def test_gnss_holds_what_the_filter_says_and_a_barometer_the_height() -> None:
    bends = Trajectory.along(SplinePath(WAYPOINTS_M[:4]), 22.0, POSITION, 200.0)
    start = exact_start(bends, AVIATION)
    aided = navigate(bends, start, AVIATION, gnss(1.0, 1.5, 3.0, 0.1), 20.0, np.random.default_rng(4))
    ratio = aided.errors[20:, :6] / aided.sigmas[20:, :6]
    assert 0.5 < ratio.std() < 1.5
    assert np.abs(aided.errors[:, :3]).max() < 2.0
    flight = Trajectory.along(SplinePath(WAYPOINTS_M), 22.0, POSITION, 200.0)
    held = navigate(flight, start, AVIATION, barometer(1.0, 1.0), 20.0, np.random.default_rng(4))
    free = navigate(flight, start, AVIATION, None, 20.0, np.random.default_rng(4))
    assert np.abs(held.errors[:, 2]).max() < 1.0
    assert np.abs(free.errors[:, 2]).max() > 15.0


def test_a_level_bias_is_taken_for_a_tilt() -> None:
    quiet = sensors(100.0, 0.02, noise=(0.0, 0.0))
    found = align(FineAlignment(POSITION, quiet), 0.3, quiet, 120, 20.0, np.random.default_rng(1))
    level = attitude(*np.array((0.3, 0.0, 0.0)))
    along = level @ np.full(3, 100.0 * MICRO_G)
    assert found.coarse_rad[:2] == pytest.approx((-along[1] / 9.797333, along[0] / 9.797333), rel=0.01)
