"""The way home in the wind, by hand."""

import math

import pytest

from flight_model.flight_state import FlightState
from gcs_formation.features.batteries.way_home import LANDING_S, way_home_s


def at(north_m: float, wind_north_mps: float = 0.0, wind_east_mps: float = 0.0) -> FlightState:
    return FlightState(north_m, 0.0, 100.0, 0.0, 20.0, 0.0, wind_north_mps, wind_east_mps)


@pytest.mark.parametrize(
    ("wind_mps", "seconds"),
    [((0.0, 0.0), 50.0), ((5.0, 0.0), 1000.0 / 15.0), ((-5.0, 0.0), 40.0), ((0.0, 12.0), 1000.0 / 16.0)],
)
def test_wind_along_and_across_the_way_counts(wind_mps: tuple[float, float], seconds: float) -> None:
    """1000 m south at 20 m/s; across the way 12 m/s leave 16."""
    assert way_home_s(at(1000.0, *wind_mps), (0.0, 0.0), 20.0) == pytest.approx(seconds + LANDING_S)


def test_against_too_strong_a_wind_home_is_not_reached_but_over_it_the_vehicle_is_there() -> None:
    assert math.isinf(way_home_s(at(1000.0, 19.5), (0.0, 0.0), 20.0))
    for along_mps in (0.0, -0.5, 0.5):
        assert math.isinf(way_home_s(at(1000.0, along_mps, 25.0), (0.0, 0.0), 20.0))
    assert way_home_s(at(0.0, 25.0), (0.0, 0.0), 20.0) == LANDING_S


def test_a_crosswind_stronger_than_the_airspeed_carries_it_past_its_home_whatever_wind_is_behind() -> None:
    """It used to count as reached after 143 s, by the wind behind it alone."""
    for along_mps, across_mps in ((-12.0, 25.0), (-12.0, -25.0), (-30.0, 22.1)):
        assert math.isinf(way_home_s(at(1000.0, along_mps, across_mps), (0.0, 0.0), 22.0))
    assert way_home_s(at(1000.0, -12.0, 22.0), (0.0, 0.0), 22.0) == pytest.approx(1000.0 / 12.0 + LANDING_S)


def test_a_multirotor_that_flies_at_one_metre_a_second_gets_home() -> None:
    """The slowest that is commanded of a formation that hovers, which used to be sent home at once."""
    assert way_home_s(at(90.0, 0.0), (0.0, 0.0), 1.0, hovers=True) == pytest.approx(90.0 + LANDING_S)
    assert math.isinf(way_home_s(at(90.0, 0.0), (0.0, 0.0), 0.99, hovers=True))


def test_a_multirotor_flies_home_at_its_speed_over_ground() -> None:
    assert way_home_s(at(100.0, 9.0), (0.0, 0.0), 5.0, hovers=True) == pytest.approx(20.0 + LANDING_S)
