import pytest

from gcs_formation.stability.gust import allowed_gust_error_m, least_gust_error_m


def test_a_vehicle_is_carried_for_the_round_trip_and_then_brakes():
    """0.6 m/s for 0.7 s are 0.42 m, and 0.36 / 3 = 0.12 m more until 1.5 m/s^2 have stopped it."""
    assert least_gust_error_m([0.6, -0.6], 0.7, [1.5, 5.5]) == pytest.approx([0.54, 0.42 + 0.36 / 11])
    assert allowed_gust_error_m(0.6, 0.7, 1.5) == pytest.approx(0.86)


def test_the_papers_error_along_x_is_out_of_reach_beyond_a_sixth_of_a_second():
    assert least_gust_error_m(0.6, 1 / 6, 1.5) == pytest.approx(0.22)
