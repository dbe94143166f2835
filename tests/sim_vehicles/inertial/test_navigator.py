"""What an emulated vehicle that navigates by inertia tells, beside the whole strap-down computation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airlink.clock import Instant
from airlink.geodesy import GeodeticOrigin
from airlink.identity import VehicleId
from formation_scenario import SplinePath
from sim_vehicles.inertial.aiding import gnss
from sim_vehicles.inertial.alignment import limits
from sim_vehicles.inertial.config import InertialConfig
from sim_vehicles.inertial.flight import exact_start, navigate
from sim_vehicles.inertial.imu import InertialSensors
from sim_vehicles.inertial.navigator import InertialNavigator
from sim_vehicles.inertial.trajectory import Trajectory
from sim_vehicles.motion import Motion

ORIGIN = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 0.0)
PATH, SPEED_MPS = SplinePath([[0, 0, 200], [700, 0, 200], [1400, 300, 220], [2000, 900, 190], [2100, 3000, 200]]), 22.0
BIASES = (1e-3, 5e-4, -5e-4), (2e-6, -1e-6, 1e-6)
QUIET = InertialSensors(*BIASES, 0.0, 0.0)
NOISY = InertialSensors(*BIASES, 2e-4, 6e-7)
STEP = Instant(100_000_000)


def motion(time_s: float) -> Motion:
    point = PATH.at(SPEED_MPS * time_s)
    turn_rate, climb = SPEED_MPS * point.curvature_1pm, SPEED_MPS * point.slope
    north, east = SPEED_MPS * math.cos(point.course_rad), SPEED_MPS * math.sin(point.course_rad)
    place = point.north_m, point.east_m, point.height_m, climb, SPEED_MPS, point.course_rad
    return Motion(*place, north, east, -climb, 0.0, 0.0, 0.0, turn_rate, SPEED_MPS, point.course_rad, point.height_m)


def flown(keys: InertialConfig, end_s: int, seed: int = 1) -> np.ndarray:
    """Return the errors (10 end_s, 4): east, north, up in m and heading in rad, ten times a second."""
    navigator = InertialNavigator(keys, ORIGIN, 0.0, VehicleId(1, 1), seed)
    rows = list[tuple[float, ...]]()
    for sample in range(10 * end_s):
        true = motion(sample / 10)
        told = navigator.sense(true, Instant(sample * STEP))
        rows.append((told.east_m - true.east_m, told.north_m - true.north_m, told.height_m - true.height_m))
    return np.array(rows)


def test_without_aid_it_errs_as_the_strap_down_computation_does() -> None:
    trajectory = Trajectory.along(PATH, SPEED_MPS, ORIGIN, 200.0)
    whole = navigate(trajectory, exact_start(trajectory, QUIET), QUIET, None, 20.0, np.random.default_rng(1))
    assert flown(InertialConfig(QUIET), 200)[-1] == pytest.approx(whole.errors[-1, :3], rel=0.03, abs=0.3)


def test_gnss_holds_its_place_and_every_seed_has_its_own_errors() -> None:
    aided = InertialConfig(NOISY, gnss(1.0, 1.5, 3.0, 0.1))
    one, other = flown(aided, 100), flown(aided, 100, seed=2)
    assert np.abs(one[200:]).max() < 2.0
    assert np.abs(one - other)[200:].max() > 0.1
    assert np.array_equal(one, flown(aided, 100))


def test_an_aligned_vehicle_begins_with_the_heading_error_that_alignment_leaves() -> None:
    """Draws of the filter's covariance: about epsilon / (Omega cos L)."""
    sigma = limits(NOISY, ORIGIN)[2]
    aligned = InertialConfig(NOISY, aligned_s=300)
    navigators = [InertialNavigator(aligned, ORIGIN, 0.0, VehicleId(1, 1), seed) for seed in range(20)]
    told = [each.sense(motion(0.0), Instant(0)).heading_rad for each in navigators]
    assert 0.6 * sigma < np.std(told) < 1.5 * sigma


def test_the_errors_of_a_sample_stay_until_the_next() -> None:
    navigator = InertialNavigator(InertialConfig(NOISY), ORIGIN, 0.0, VehicleId(1, 1), 1)
    still = motion(0.0)
    first = navigator.sense(still, Instant(350_000_000))
    assert navigator.sense(still, Instant(399_000_000)) == first
    assert navigator.sense(still, Instant(400_000_000)) != first
