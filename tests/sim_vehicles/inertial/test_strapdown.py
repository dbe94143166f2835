"""Strap-down navigation against the literature: the Earth's figures, and the growth of each error."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flight_model.arrays import Array
from flight_model.earth import RATE_RADPS, GeodeticOrigin, gravity_mps2, radii_m
from flight_model.spline import SplinePath
from sim_vehicles.inertial.error_model import NORTH, TILT, VELOCITY, dynamics
from sim_vehicles.inertial.experiment import Start, exact_start, navigate
from sim_vehicles.inertial.imu import Increments, InertialSensors, Trajectory, attitude, misalignment
from sim_vehicles.inertial.strapdown import Strapdown, displaced, to_matrix, to_quaternion
from tests.sim_vehicles.inertial.angles import angles

POSITION = GeodeticOrigin(math.radians(35.0), math.radians(125.0), 1.0)
MICRO_G, DEGREE_PER_HOUR = 9.797336e-6, math.radians(1.0) / 3600.0
ARCSEC, ARCMIN = math.radians(1.0 / 3600.0), math.radians(1.0 / 60.0)
BENDS = SplinePath([[0, 0, 200], [700, 0, 200], [1400, 300, 220], [2000, 900, 190], [2100, 3000, 200]])


def sensors(accel_ug: float = 0.0, gyro_deg_per_h: float = 0.0) -> InertialSensors:
    """Return sensors without noise, with biases forward (north) of the accelerometer and right (east) of the gyro."""
    return InertialSensors((0.0, accel_ug * MICRO_G, 0.0), (gyro_deg_per_h * DEGREE_PER_HOUR, 0.0, 0.0), 0.0, 0.0)


def north_errors_m(faulty: InertialSensors, tilt_rad: tuple[float, float, float], times_s: list[float]) -> Array:
    """Return the north errors of a vehicle at rest after some times; the last one is the end."""
    rest = Trajectory.at_rest(POSITION, 0.0, times_s[-1])
    start = exact_start(rest, faulty)
    off = displaced(start.state.attitude, np.array(tilt_rad))
    start = Start(start.state._replace(attitude=off), start.bias, start.covariance)
    found = navigate(rest, start, faulty, None, 20.0, np.random.default_rng(1))
    return found.errors[np.searchsorted(found.times_s, times_s), NORTH]


def test_the_earth_at_the_paper_s_position() -> None:
    lat_rad = POSITION.lat_rad
    assert gravity_mps2(lat_rad, 0.0) == pytest.approx(9.797336, abs=1e-6)
    assert radii_m(lat_rad) == pytest.approx((6356426.7, 6385172.2), abs=0.1)
    assert RATE_RADPS * math.cos(lat_rad) / DEGREE_PER_HOUR == pytest.approx(12.3209, abs=1e-4)
    assert RATE_RADPS * math.sin(lat_rad) / DEGREE_PER_HOUR == pytest.approx(8.6272, abs=1e-4)


def test_sensors_at_rest_feel_the_earth_s_rotation_and_gravity() -> None:
    angle, velocity = Trajectory.at_rest(POSITION, 0.0, 1.0).increments(0.01, 0, 1)
    assert np.linalg.norm(angle) / 0.01 / DEGREE_PER_HOUR == pytest.approx(15.0411, abs=1e-4)
    assert velocity[0] / 0.01 == pytest.approx((0.0, 0.0, 9.797333), abs=1e-6)


def test_angles_matrices_and_quaternions_are_one_another_s_inverse() -> None:
    given = np.array((2.0, -0.4, 0.7))
    matrix = attitude(*given)
    assert angles(matrix) == pytest.approx(given)
    assert to_matrix(to_quaternion(matrix)) == pytest.approx(matrix)
    assert matrix[:, 1] == pytest.approx((math.sin(2.0) * math.cos(0.4), math.cos(2.0) * math.cos(0.4), -math.sin(0.4)))
    phi = np.array((1e-5, -2e-5, 3e-5))
    assert misalignment(displaced(matrix, phi), matrix) == pytest.approx(phi, rel=1e-4)


def test_a_swing_in_step_with_a_push_gains_speed_across_both() -> None:
    """Sculling: rolled by a sin wt and pushed sideways by A sin wt, a body gains a A / 2 upwards in each second."""
    swing_rad, push_mps2, swing_radps, period_s = 0.1, 10.0, 6.0 * math.pi, 0.01
    gravity = gravity_mps2(POSITION.lat_rad, 0.0)
    times_s = np.arange(0.0, 2.0 + 1e-9, period_s)
    phase, nothing = swing_radps * times_s, np.zeros(times_s.size - 1)
    rolled = np.stack((np.diff(swing_rad * np.sin(phase)), nothing, nothing), axis=1)
    pushed = np.stack(
        (nothing, -np.diff(push_mps2 / swing_radps * np.cos(phase)), nothing + gravity * period_s), axis=1
    )
    computer = Strapdown(POSITION.lat_rad, 0.0, 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    computer.run(Increments(rolled, pushed), period_s)
    fine = np.sin(np.linspace(0.0, phase[-1], 200_001))
    upward = np.sin(swing_rad * fine) * push_mps2 * fine + (np.cos(swing_rad * fine) - 1.0) * gravity
    assert computer.velocity[2] == pytest.approx(2.0 * upward.mean(), abs=0.005)
    assert 2.0 * upward.mean() == pytest.approx(
        2.0 * (swing_rad * push_mps2 - swing_rad**2 * gravity / 2) / 2, abs=0.01
    )


def test_without_sensor_errors_only_integration_errs() -> None:
    """200 s of turns, hills and banking, 4.4 km: an error above a millimetre would mean a wrong equation."""
    ideal = sensors()
    flight = Trajectory.along(BENDS, 22.0, POSITION, 200.0)
    found = navigate(flight, exact_start(flight, ideal), ideal, None, 100.0, np.random.default_rng(1))
    assert np.abs(found.errors[:, :3]).max() < 1e-3
    assert np.abs(found.errors[:, 6:]).max() < 0.001 * ARCSEC


@pytest.mark.parametrize(
    ("faulty", "tilt_rad", "expected_m"),
    [
        pytest.param(
            *(sensors(accel_ug=100.0), (0.0, 0.0, 0.0), {60.0: 1.763, 600.0: 168.3, 1000.0: 429.9}),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            *(sensors(gyro_deg_per_h=0.01), (0.0, 0.0, 0.0), {600.0: -16.6, 1000.0: -73.2}), marks=pytest.mark.slow
        ),
        (sensors(), (20.0 * ARCSEC, 0.0, 0.0), {600.0: 163.2}),
        pytest.param(*(sensors(), (0.0, 0.0, 3.0 * ARCMIN), {600.0: -17.9}), marks=pytest.mark.slow),
    ],
)
def test_each_error_grows_as_the_single_channel_formulas_say(
    faulty: InertialSensors, tilt_rad: tuple[float, float, float], expected_m: dict[float, float]
) -> None:
    """b/ws² (1 - cos ws t) and the like; coupling of the channels is below 0.3 % by then."""
    assert north_errors_m(faulty, tilt_rad, [*expected_m]) == pytest.approx([*expected_m.values()], rel=0.005)


def test_the_error_model_swings_with_schuler_s_period_split_by_foucault_s() -> None:
    model = dynamics(
        POSITION.lat_rad, 0.0, np.zeros(3), np.array((0.0, 0.0, gravity_mps2(POSITION.lat_rad, 0.0))), np.eye(3)
    )
    level = [VELOCITY.start, VELOCITY.start + 1, *range(TILT.start, TILT.stop)]
    rates = np.abs(np.linalg.eigvals(model[np.ix_(level, level)]).imag)
    periods_min = sorted({round(math.tau / rate / 60.0, 1) for rate in rates if rate > 1e-3})
    assert periods_min == pytest.approx([81.0, 88.0], abs=0.05)


def test_height_by_inertia_alone_diverges_with_a_time_of_570_s() -> None:
    model = dynamics(POSITION.lat_rad, 0.0, np.zeros(3), np.array((0.0, 0.0, 9.797336)), np.eye(3))
    vertical = model[np.ix_([2, 5], [2, 5])]
    assert 1.0 / np.linalg.eigvals(vertical).real.max() == pytest.approx(570.0, abs=1.0)
