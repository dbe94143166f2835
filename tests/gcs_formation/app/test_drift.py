"""How far vehicles that navigate by inertia drift, and what `check` says about it."""

import math
from typing import Any

import pytest

from formation_scenario import load_scenario
from formation_scenario.navigation import InertialNavigation, InertialSensorKeys
from gcs_formation.app.rehearsal.drift import DRIFT_SIGMAS, drift, drifts
from sim_vehicles.inertial.growth import growth

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
    """100 micro-g and 0.01 degrees per hour, of one channel on the ground (Titterton and Weston, 2004, 12.3).

    With ws = sqrt(g/R), an accelerometer's bias b leaves b/ws^2 (1 - cos ws t), a gyroscope's e R e (t - sin(ws t)/ws).
    """
    assert growth(keys(100), LAT_RAD, 0.0, 0.0, after_s).level_m == pytest.approx(by_accel_m, rel=0.01)
    assert growth(keys(0, 0.01), LAT_RAD, 0.0, 0.0, after_s).level_m == pytest.approx(by_gyro_m, rel=0.05, abs=0.002)


@pytest.mark.parametrize("after_s", [60.0, 300.0])
def test_noise_of_an_accelerometer_grows_as_a_random_walk_of_velocity(after_s: float) -> None:
    """N/sqrt(Hz) leaves N sqrt(t^3/3) of position while Schuler's oscillation has hardly begun."""
    noise = 100e-6 * 9.80665
    expected_m = noise * math.sqrt(after_s**3 / 3.0)
    assert growth(keys(0, 0, 100), LAT_RAD, 0.0, 0.0, after_s).level_m == pytest.approx(expected_m, rel=0.05)


def planned(**navigation: Any) -> dict[str, Any]:
    """Return a flight of 200 s, 20 m apart and 100 m high, after a run-in of 10 s."""
    return {
        "vehicles": {"count": 3, **({"navigation": {"source": "ins", **navigation}} if navigation else {})},
        "start": {"in_air": True},
        "formation": {"shape": "line", "spacing_m": 20},
        "path": {"waypoints_m": [[0, 0, 100], [6000, 0, 100]]},
        "duration_s": 200,
    }


def said(**navigation: Any) -> list[str]:
    scenario = load_scenario(planned(**navigation))
    found = drift(scenario)
    return [] if found is None else list(drifts(scenario, found))


def test_places_that_drift_apart_by_more_than_slots_leave_are_warned_of() -> None:
    """1 milli-g for 210 s is b t^2/2 = 216 m, less because of Schuler's oscillation; for two vehicles 306 m."""
    navigation = {"grade": "intermediate", "aiding": "baro", "biases": "random"}
    (text,) = said(**navigation)
    assert text.startswith("navigation: positions drift apart by 30")
    assert "(1 sigma) within 210 s by inertia without gnss, and slots leave 15 m beyond safety.separation_m" in text
    assert said(**{**navigation, "aiding": "gnss"}) == said() == []


def test_heights_by_inertia_alone_are_warned_of_that_drift_by_more_than_the_ground_leaves() -> None:
    """1 milli-g for 210 s is 216 m, and more because the height diverges."""
    _, text = said(grade="intermediate", biases="random")
    assert text.startswith("navigation: heights drift by 21")
    assert "95 m are left above ground beyond safety.clearance_m" in text
    assert not any("heights" in each for each in said(grade="navigation"))


def test_biases_that_all_have_alike_move_nobody_apart() -> None:
    """With the same biases only the noise is left, 0.7 m in 210 s."""
    alike, apart = (drift(load_scenario(planned(grade="navigation", biases=each))) for each in ("keys", "random"))
    assert alike is not None
    assert apart is not None
    assert DRIFT_SIGMAS * alike.level_m < 15.0 < DRIFT_SIGMAS * apart.level_m
    assert said(grade="navigation") == []
    assert len(said(grade="navigation", biases="random")) == 1
