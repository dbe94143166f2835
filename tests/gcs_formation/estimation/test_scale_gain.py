"""How fast the scale of an airspeed sensor and the wind are learned: the filter's gains in closed form."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import scipy

from flight_model.earth import true_by_equivalent_airspeed
from gcs_formation.estimation.airspeed import AirspeedScale

SLOWEST_MPS, FASTEST_MPS, READING_MPS = 14.0, 29.0, 22.0
PERIOD_S = 0.5
SCALE_SIGMA, SCALE_WALK, WIND_SIGMA_MPS, WIND_WALK_MPS, TRIANGLE_SIGMA_MPS = 0.08, 2e-4, 15.0, 0.1, 3.0
"""Standard deviations of the scale, the wind and a wind triangle, and their random walks, per √s."""


def learner(field_m: float = 0.0) -> AirspeedScale:
    return AirspeedScale(field_m, SLOWEST_MPS, FASTEST_MPS)


def seen(
    learner: AirspeedScale, stamp_s: float, heading_rad: float, along_mps: float, across_mps: float = 0.0
) -> AirspeedScale:
    """Take a wind triangle at sea level: the velocity over ground along the nose and to its right."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    velocity_mps = along_mps * cos - across_mps * sin, along_mps * sin + across_mps * cos, 0.0
    learner.update(stamp_s, 0.0, velocity_mps, READING_MPS, heading_rad)
    return learner


@pytest.mark.parametrize("heading_deg", [0, 50, 90, 135, 180, 230, 270, 315])
def test_straight_flight_divides_what_it_sees_between_wind_and_scale_by_their_variances(heading_deg: int) -> None:
    """Of 10 m/s more than the reading, the scale gets (0.08 * 22)² of (0.08 * 22)² + 15² + 3² / n after n triangles.

    Exactly after the first, in any direction; after 200 the random walks have changed little.
    """
    one, of_scale = learner(), SCALE_SIGMA * READING_MPS
    for number in range(200):
        seen(one, PERIOD_S * number, math.radians(heading_deg), READING_MPS + 10.0)
        share = of_scale**2 / (of_scale**2 + WIND_SIGMA_MPS**2 + TRIANGLE_SIGMA_MPS**2 / (number + 1))
        assert one.scale == pytest.approx(1.0 + 10.0 * share / READING_MPS, abs=1e-4 if number else 1e-9)
    assert one.ratio == one.scale


def circling(turns: int = 30) -> tuple[AirspeedScale, float, float]:
    """Circle at 0.1 rad/s in calm air until the gains are steady; return the next stamp and heading."""
    one, heading_rad = learner(), 0.0
    for number in range(120 * turns):
        heading_rad = 0.05 * number
        seen(one, PERIOD_S * number, heading_rad, READING_MPS)
    return one, PERIOD_S * 120 * turns, heading_rad + 0.05


def steady_gain() -> tuple[float, float]:
    """Return the gain of the scale by a triangle's components along the nose and to its right.

    In axes that turn with the aircraft the filter doesn't change with time, so the discrete algebraic Riccati equation
    gives its covariance (Gelb, 1974, chapter 4).
    """
    turn, cos, sin = np.eye(3), math.cos(0.05), math.sin(0.05)
    turn[:2, :2] = (cos, sin), (-sin, cos)
    rows = np.array(((1.0, 0.0, READING_MPS), (0.0, 1.0, 0.0)))
    walks = np.diag((WIND_WALK_MPS**2, WIND_WALK_MPS**2, SCALE_WALK**2)) * PERIOD_S
    noise = TRIANGLE_SIGMA_MPS**2 * np.eye(2)
    before = scipy.linalg.solve_discrete_are(turn.T, rows.T, walks, noise)
    gain = before @ rows.T @ np.linalg.inv(rows @ before @ rows.T + noise)
    return float(gain[2, 0]), float(gain[2, 1])


def test_circles_learn_the_scale_with_the_steady_gain_of_the_riccati_equation() -> None:
    """Rotation doesn't matter: one triangle that is off by 3 m/s along the nose, or to its right, moves the scale."""
    along, across = steady_gain()
    steady, stamp_s, heading_rad = circling()
    for off_mps in ((3.0, 0.0), (0.0, 3.0)):
        one, known = copy.deepcopy(steady), steady.scale
        assert known == pytest.approx(1.0, abs=1e-6)
        seen(one, stamp_s, heading_rad, READING_MPS + off_mps[0], off_mps[1])
        assert one.scale - known == pytest.approx(along * off_mps[0] + across * off_mps[1], rel=0.01)


@pytest.mark.parametrize(("scale", "known"), [(1.7, 1.35), (1.25, 1.25), (0.85, 0.85), (0.5, 0.75)])
def test_a_scale_is_limited(scale: float, known: float) -> None:
    one = learner()
    for number in range(500):
        seen(one, PERIOD_S * number, 0.05 * number, scale * READING_MPS)
    assert one.scale == pytest.approx(known, abs=0.01)
    assert 0.75 <= one.scale <= 1.35


@pytest.mark.parametrize(
    ("later_s", "used"), [(0.25, False), (0.49, False), (0.5, True), (10.0, True), (-1.0, True), (100.0, True)]
)
def test_triangles_are_half_a_second_apart(later_s: float, used: bool) -> None:
    """One that follows earlier isn't used; one that steps back in time is."""
    one = seen(learner(), 50.0, 0.0, READING_MPS)
    known = one.scale
    seen(one, 50.0 + later_s, math.pi, READING_MPS + 20.0)
    assert (one.scale != known) == used


@pytest.mark.parametrize(
    ("gap_s", "forgotten"), [(9.9, False), (10.0, False), (10.1, True), (15.0, True), (-1.0, True)]
)
def test_the_wind_is_unknown_after_ten_seconds(gap_s: float, forgotten: bool) -> None:
    """Then a wind of 8 m/s counts as wind; before, the scale takes a share of it, as 0.08 * 22 is near 3 m/s."""
    one = learner()
    for number in range(40):
        seen(one, PERIOD_S * number, 0.0, READING_MPS)
    change = seen(one, PERIOD_S * 39 + gap_s, math.pi, READING_MPS + 8.0).scale - 1.0
    assert (change < 0.01) == forgotten
    assert (change > 0.02) != forgotten


@pytest.mark.parametrize(("reading_mps", "used"), [(4.9, False), (5.0, True)])
def test_readings_below_5_mps_are_not_used(reading_mps: float, used: bool) -> None:
    one = seen(learner(), 0.0, 0.0, READING_MPS)
    known = one.scale
    one.update(1.0, 0.0, (-READING_MPS, 30.0, 0.0), reading_mps, math.pi)
    assert (one.scale != known) == used


def test_the_climb_is_part_of_the_airspeed() -> None:
    """20 m/s that climb 12 are 16 m/s over ground (a triangle of 3, 4 and 5); one that climbs faster stays finite."""
    one = learner()
    for number in range(200):
        heading_rad = 0.05 * number
        velocity_mps = 16.0 * math.cos(heading_rad), 16.0 * math.sin(heading_rad), 12.0
        one.update(PERIOD_S * number, 0.0, velocity_mps, 20.0, heading_rad)
    assert one.scale == pytest.approx(1.0, abs=1e-9)
    one.update(200.0, 0.0, (0.0, 0.0, 21.0), 20.0, 0.0)
    assert one.scale == pytest.approx(1.0, abs=1e-9)


def test_the_ratio_follows_the_height_and_the_limits_follow_by_steps_of_half_a_percent() -> None:
    """True airspeed is 1.05 times the reading at 1000 m; half a percent more takes 96 m of climb."""
    one = learner(1000.0)
    ratio = math.sqrt(1.2250 / 1.1117)
    assert one.ratio == pytest.approx(ratio, abs=1e-4)
    assert one.speeds_mps == pytest.approx((SLOWEST_MPS * ratio, FASTEST_MPS), rel=1e-4)
    assert one.true(20.0) == pytest.approx(20.0 * ratio, rel=1e-4)
    assert one.indicated(20.0 * ratio) == pytest.approx(20.0, rel=1e-4)
    for above_sea_m, followed_m in ((1095.0, 1000.0), (1110.0, 1110.0), (1015.0, 1110.0), (1005.0, 1005.0)):
        one.update(math.nan, above_sea_m, (0.0, 0.0, 0.0), 0.0, 0.0)
        assert one.ratio == true_by_equivalent_airspeed(above_sea_m)
        assert one.speeds_mps == pytest.approx((SLOWEST_MPS * true_by_equivalent_airspeed(followed_m), FASTEST_MPS))


def test_below_sea_level_the_reading_is_the_larger_one() -> None:
    """In air of 1.285 kg/m³, 500 m below, true airspeed is 0.976 times the reading."""
    one = learner(-500.0)
    assert one.ratio == pytest.approx(math.sqrt(1.2250 / 1.2849), abs=1e-4)
    assert one.speeds_mps == pytest.approx((SLOWEST_MPS, FASTEST_MPS * one.ratio))


def test_what_a_vehicle_reports_narrows_its_limits_and_never_widens_them() -> None:
    one = learner()
    one.bound(15.0, 25.0)
    assert one.speeds_mps == (15.0, 25.0)
    assert (one.indicated(1.0), one.indicated(99.0)) == (15.0, 25.0)
    one.bound(10.0, 40.0)
    assert one.speeds_mps == (15.0, 25.0)
