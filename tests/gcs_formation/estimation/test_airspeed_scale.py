"""The scale of an airspeed sensor, separated from wind by how the velocity over ground turns."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_model.earth import true_by_equivalent_airspeed
from gcs_formation.estimation.airspeed import AirspeedScale

FIELD_M, SLOWEST_MPS, FASTEST_MPS = 1500.0, 14.0, 29.0
READING_MPS = 22.0


def flown(
    learner: AirspeedScale,
    turns_rad: float,
    *,
    scale: float = 1.0,
    wind_mps: tuple[float, float] = (0.0, 0.0),
    begin_rad: float = 0.0,
    from_s: float = 0.0,
    gusts_mps: float = 0.0,
    climb_mps: float = 0.0,
) -> AirspeedScale:
    """Fly 20 s straight and then turn at 5 degrees per second, 100 m above the field, with ten samples per second."""
    above_sea_m, random, gust = FIELD_M + 100.0, np.random.default_rng(1), np.zeros(2)
    level_mps = math.sqrt((scale * true_by_equivalent_airspeed(above_sea_m) * READING_MPS) ** 2 - climb_mps**2)
    for tick in range(round(10 * (20.0 + abs(turns_rad) / 0.087))):
        gust += -0.01 * gust + gusts_mps * math.sqrt(0.02) * random.standard_normal(2)  # lasting for 10 s
        heading_rad = begin_rad + math.copysign(max(0.0, 0.1 * tick - 20.0) * 0.087, turns_rad)
        north_mps = wind_mps[0] + gust[0] + level_mps * math.cos(heading_rad)
        east_mps = wind_mps[1] + gust[1] + level_mps * math.sin(heading_rad)
        velocity_mps = float(north_mps), float(east_mps), climb_mps
        learner.update(from_s + 0.1 * tick, above_sea_m, velocity_mps, READING_MPS, heading_rad)
    return learner


@pytest.mark.parametrize(
    ("above_sea_m", "density_kgpm3"), [(-500.0, 1.2849), (0.0, 1.2250), (1000.0, 1.1117), (5000.0, 0.73612)]
)
def test_the_standard_atmosphere_s_densities(above_sea_m: float, density_kgpm3: float) -> None:
    """ICAO Doc 7488, by geopotential height."""
    expected = math.sqrt(1.2250 / density_kgpm3)
    assert true_by_equivalent_airspeed(above_sea_m) == pytest.approx(expected, rel=1e-4)


def test_a_sensor_is_taken_as_calibrated_until_a_turn_shows_more() -> None:
    learner = flown(AirspeedScale(FIELD_M, SLOWEST_MPS, FASTEST_MPS), 0.0, scale=1.1, wind_mps=(3.0, -4.0))
    assert learner.scale == pytest.approx(1.0, abs=0.01)
    assert learner.true(READING_MPS) == pytest.approx(READING_MPS * true_by_equivalent_airspeed(1600.0), rel=0.01)


@given(
    st.floats(0.85, 1.2),
    st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0)),
    st.floats(-math.pi, math.pi),
    st.sampled_from([-math.pi, math.pi]),
    st.floats(-3.0, 3.0),
)
@settings(max_examples=30, deadline=None)
def test_half_a_turn_tells_the_scale_from_any_wind(
    scale: float, wind_mps: tuple[float, float], begin_rad: float, turns_rad: float, climb_mps: float
) -> None:
    learner = AirspeedScale(FIELD_M, SLOWEST_MPS, FASTEST_MPS)
    flown(learner, turns_rad, scale=scale, wind_mps=wind_mps, begin_rad=begin_rad, climb_mps=climb_mps)
    assert learner.scale == pytest.approx(scale, abs=0.012)
    assert learner.true(READING_MPS) == pytest.approx(
        scale * true_by_equivalent_airspeed(FIELD_M + 100.0) * READING_MPS, rel=0.012
    )


def test_gusts_that_last_are_not_taken_for_a_scale_beyond_what_they_leave_unknown() -> None:
    learner = flown(AirspeedScale(FIELD_M, SLOWEST_MPS, FASTEST_MPS), 2 * math.pi, gusts_mps=1.0)
    assert abs(learner.scale - 1.0) < 0.036  # three standard deviations of what gusts leave


def test_what_is_commanded_is_read_where_it_flies_so_fast_and_lies_within_the_limits() -> None:
    learner = flown(AirspeedScale(FIELD_M, SLOWEST_MPS, FASTEST_MPS), math.pi, scale=1.1)
    for true_mps in (20.0, 22.0, 30.0):
        assert learner.true(learner.indicated(true_mps)) == pytest.approx(true_mps)
    assert learner.indicated(5.0) == SLOWEST_MPS
    assert learner.indicated(60.0) == FASTEST_MPS
    slowest_mps, fastest_mps = learner.speeds_mps
    assert learner.indicated(slowest_mps) == pytest.approx(SLOWEST_MPS, rel=0.006)
    assert fastest_mps == FASTEST_MPS


def test_a_clock_that_goes_back_and_a_gap_leave_the_scale_and_forget_the_wind() -> None:
    learner = flown(AirspeedScale(FIELD_M, SLOWEST_MPS, FASTEST_MPS), math.pi, scale=1.1, wind_mps=(5.0, 0.0))
    known = learner.scale
    flown(learner, 0.0, scale=1.1, wind_mps=(-5.0, 3.0), begin_rad=math.pi)  # from stamp 0 again
    assert learner.scale == pytest.approx(known, abs=0.003)
    flown(learner, 0.0, scale=1.1, wind_mps=(0.0, 8.0), from_s=500.0)
    assert learner.scale == pytest.approx(known, abs=0.003)
