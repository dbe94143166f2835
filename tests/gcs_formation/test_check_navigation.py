"""How far vehicles that navigate by inertia drift, and what `check` says about it."""

import math
from typing import Any

import numpy as np
import pytest

from airlink.endpoint import VehicleId
from flight_model.earth import gravity_mps2
from formation_scenario import load_scenario
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from gcs_formation.app.check_room import DRIFT_SIGMAS, drifts, height_drift, level_drift
from sim_vehicles.inertial.error_model import (
    ACCEL_BIAS,
    GYRO_BIAS,
    PLACE,
    SIZE,
    ErrorFilter,
    dynamics,
    noise_density,
)
from sim_vehicles.inertial.imu import inertial_sensors

LAT_RAD = math.radians(35.0)


def keys(accel_ug: float = 0.0, gyro_dph: float = 0.0, accel_noise: float = 0.0, gyro_noise: float = 0.0):
    """Return navigation keys with sensors of these biases and noise."""
    sensors = InertialSensorKeys(
        accel_bias_ug=accel_ug,
        gyro_bias_deg_per_h=gyro_dph,
        accel_noise_ug_per_rthz=accel_noise,
        gyro_noise_deg_per_rth=gyro_noise,
    )
    return InertialNavigation(source="ins", sensors=sensors)


@pytest.mark.parametrize(
    ("after_s", "by_accel_m", "by_gyro_m"), [(60, 1.763, 0.017), (600, 168.3, 16.6), (1000, 429.9, 73.2)]
)
def test_biases_drift_as_single_errors_grow(after_s: float, by_accel_m: float, by_gyro_m: float) -> None:
    """100 micro-g and 0.01 degrees per hour, of one channel on the ground (the model's own figures)."""
    assert level_drift(keys(100), LAT_RAD, after_s)[0] == pytest.approx(by_accel_m, rel=0.005)
    assert level_drift(keys(0, 0.01), LAT_RAD, after_s)[0] == pytest.approx(by_gyro_m, rel=0.03)


def test_a_bias_of_an_accelerometer_drifts_to_its_peak_and_no_farther() -> None:
    """At half of Schuler's period: 2 b/ws^2, 1271 m for 100 micro-g."""
    assert level_drift(keys(100), LAT_RAD, 2532)[0] == pytest.approx(1271, rel=0.005)
    assert level_drift(keys(100), LAT_RAD, 5064)[0] == pytest.approx(1271, rel=0.005)


@pytest.mark.parametrize(
    "of", [keys(1000, 0.1, 50, 0.01), keys(2000, 10, 100, 0.1), keys(0, 0, 100, 0), keys(0, 0, 0, 0.1)]
)
def test_drifts_are_the_covariance_of_the_error_model(of: InertialNavigation) -> None:
    sensors = inertial_sensors(of, 1, VehicleId(1, 1))
    sigmas, ahead_mps2 = np.zeros(SIZE), np.array((0.0, 0.0, gravity_mps2(LAT_RAD, 0.0)))
    sigmas[ACCEL_BIAS], sigmas[GYRO_BIAS] = sensors.accel_bias_sigma, sensors.gyro_bias_sigma
    covariance = ErrorFilter(np.diag(sigmas**2))
    model = dynamics(LAT_RAD, 0.0, np.zeros(3), ahead_mps2, np.eye(3))
    for _ in range(3000):
        covariance.predict(model, noise_density(sensors), 0.1)
    east_m, north_m, up_m = np.sqrt(np.diag(covariance.covariance)[PLACE])
    assert (east_m, north_m) == (pytest.approx(math.hypot(*level_drift(of, LAT_RAD, 300)), rel=0.02),) * 2
    assert up_m == pytest.approx(math.hypot(*height_drift(of, LAT_RAD, 300)), rel=0.02, abs=1.1)  # 1 m from horizontal


def planned(**navigation: Any) -> dict[str, Any]:
    """Return a flight of 200 s, 20 m apart and 100 m high, after a run-in of 10 s."""
    return {
        "vehicles": {"count": 3, **({"navigation": {"source": "ins", **navigation}} if navigation else {})},
        "start": {"in_air": True},
        "formation": {"shape": "line", "spacing_m": 20},
        "path": {"waypoints_m": [[0, 0, 100], [6000, 0, 100]]},
        "duration_s": 200,
    }


def test_places_that_drift_apart_by_more_than_slots_leave_are_warned_of() -> None:
    """1 milli-g for 210 s is b t^2/2 = 216 m, less because of Schuler's oscillation; for two vehicles 306 m."""
    navigation = {"grade": "intermediate", "aiding": "baro", "biases": "random"}
    (said,) = drifts(load_scenario(planned(**navigation)))
    assert said.startswith("navigation: places drift apart by 304.3 m")
    assert "(1 sigma) within 210 s by inertia without gnss, and slots leave 15 m beyond safety.separation_m" in said
    assert list(drifts(load_scenario(planned(**{**navigation, "aiding": "gnss"})))) == []
    assert list(drifts(load_scenario(planned()))) == []


def test_heights_by_inertia_alone_are_warned_of_that_drift_by_more_than_the_ground_leaves() -> None:
    """1 milli-g for 210 s is 216 m, and more because the height diverges."""
    _, said = drifts(load_scenario(planned(grade="intermediate", biases="random")))
    assert said.startswith("navigation: heights drift by 218.7 m")
    assert "95 m are left above ground beyond safety.clearance_m" in said
    assert not any("heights" in each for each in drifts(load_scenario(planned(grade="navigation"))))


def test_biases_that_all_have_alike_move_none_apart() -> None:
    """With the same biases only the noise is left, 0.7 m in 210 s."""
    of = load_scenario(planned(grade="navigation")).vehicles[0].navigation
    assert isinstance(of, InertialNavigation)
    bias_m, noise_m = level_drift(of, LAT_RAD, 210)
    assert DRIFT_SIGMAS * math.sqrt(2) * noise_m < 15.0 < DRIFT_SIGMAS * math.sqrt(2) * math.hypot(bias_m, noise_m)
    assert list(drifts(load_scenario(planned(grade="navigation")))) == []
    assert len(list(drifts(load_scenario(planned(grade="navigation", biases="random"))))) == 1
