"""How much weight a sample has that departs, and with what a filter begins."""

from __future__ import annotations

import math

import pytest

from flight_model.flight_state import FlightState
from gcs_formation.estimation.kalman import HEADING, SPEED
from gcs_formation.estimation.noise_and_plausibility import VehicleNoise, plausible, weighed
from gcs_formation.estimation.vehicle_filter import VehicleFilter

NOISE = (0.3, 0.4, 0.1, 0.2, 0.5, 0.01)
"""Of positions, heights, velocities, climbs, airspeeds and headings."""


def a_filter(wind_radps: float, telemetry_hz: float = 10.0) -> VehicleFilter:
    return VehicleFilter(VehicleNoise(NOISE, NOISE), wind_radps, telemetry_hz, updraughts=False)


@pytest.mark.parametrize("which", range(8))
def test_a_value_that_departs_u_times_too_far_has_an_innovation_with_u_squared_times_the_variance(which: int) -> None:
    """With noise of 1, 2, … and innovations' variances of twice that; the other values keep their weights."""
    noise = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    own = (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0)
    one, two, three, four, five, six, seven, eight = (9.0 if place == which else 1.0 for place in range(8))
    excess = one, two, three, four, five, six, seven, eight
    assert not plausible(excess)
    found = weighed(noise, own, excess)
    assert found[which] + own[which] - noise[which] == 9.0 * own[which]
    assert [each for place, each in enumerate(found) if place != which] == [
        each for place, each in enumerate(noise) if place != which
    ]


def test_what_does_not_depart_keeps_its_weight() -> None:
    ones = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    assert plausible(ones)
    assert weighed(ones, (5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0), ones) == ones


@pytest.mark.parametrize(
    ("wind_radps", "variance"),
    [
        (0.0, 0.0),
        (0.1, 0.2 * (0.1**2 + 0.5**2) / 10.0),
        (0.4, 0.4 * (0.1**2 + 0.5**2) / 10.0),
        (1.0, 0.1**2 + 0.5**2 + (20.0 * 0.01) ** 2),
    ],
)
def test_a_slow_estimate_of_the_wind_begins_with_less_variance_than_one_sample_has(
    wind_radps: float, variance: float
) -> None:
    """A sample's wind has the noise of velocity and airspeed, and of the heading at 20 m/s."""
    assert a_filter(wind_radps)._first_wind_variance(20.0) == pytest.approx(variance)


def test_a_state_that_is_set_is_the_one_by_which_the_filter_is_linear() -> None:
    """Eastwards at 20 m/s, airspeed is velocity to the east, and a turn to the right is velocity to the south."""
    own = a_filter(0.1)
    own.place(FlightState(0.0, 0.0, 100.0, 0.0, 20.0, math.pi / 2, 0.0, 0.0), 7)
    assert own.stamp == 7
    level = [0.0] * 6
    level[SPEED], level[HEADING] = 1.0, 0.1
    states = level[0], level[1], level[2], level[3], level[4], level[5]
    assert own._jacobian.north_mps(states) == pytest.approx(-2.0)
    assert own._jacobian.east_mps(states) == pytest.approx(1.0)
