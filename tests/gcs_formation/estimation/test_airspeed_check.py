"""Which measured airspeeds are trusted, and what replaces those that aren't."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.estimation.airspeed import RETURN_S, AirspeedCheck

SLOWEST_MPS, FASTEST_MPS, FLOWN_MPS = 16.0, 28.0, 22.0
PERIOD_S = 0.1
NORTH_RAD, EAST_RAD = 0.0, math.pi / 2

speeds = st.floats(SLOWEST_MPS, FASTEST_MPS)
headings = st.floats(-math.pi, math.pi)


@dataclass
class Aircraft:
    """An aircraft that flies in a wind; its sensor reads relative to its true airspeed."""

    wind_mps: tuple[float, float] = (0.0, 0.0)
    heading_rad: float = NORTH_RAD
    flown_mps: float = FLOWN_MPS
    ratio: float = 1.0
    check: AirspeedCheck = field(default_factory=lambda: AirspeedCheck(SLOWEST_MPS, FASTEST_MPS))
    now_s: float = 0.0

    def fly(self, seconds: float, reads: Callable[[float], float] | None = None) -> list[bool]:
        """Fly for a while; return which readings are trusted. `reads`: reading by time from now, m/s."""
        accepted: list[bool] = []
        for tick in range(round(seconds / PERIOD_S)):
            north_mps = self.wind_mps[0] + self.flown_mps * math.cos(self.heading_rad)
            east_mps = self.wind_mps[1] + self.flown_mps * math.sin(self.heading_rad)
            ias_mps = reads(tick * PERIOD_S) if reads else self.flown_mps / self.ratio
            reported = north_mps, east_mps, self.heading_rad, ias_mps, self.ratio
            accepted.append(self.check.accepts(self.now_s, *reported))
            self.now_s += PERIOD_S
        return accepted


@pytest.mark.parametrize("ias_mps", [0.0, 5.0, 11.0, 34.0, 60.0, 400.0])
def test_a_sensor_that_fails_is_rejected_and_the_airspeed_follows_from_the_wind_known(ias_mps: float) -> None:
    """The aircraft accelerates to 25 m/s while its sensor sticks."""
    plane = Aircraft(wind_mps=(-6.0, 3.0))
    assert all(plane.fly(10.0))
    plane.flown_mps = 25.0
    assert not any(plane.fly(60.0, lambda _: ias_mps))
    assert plane.check.synthetic_mps == pytest.approx(25.0, abs=0.01)


def test_after_a_turn_too_as_the_wind_across_is_still_followed() -> None:
    """The wind has changed by 4 m/s to the east since the sensor failed; that was sideways first, then ahead."""
    plane = Aircraft(wind_mps=(-6.0, 3.0))
    plane.fly(10.0)
    plane.wind_mps = (-6.0, 7.0)
    plane.fly(120.0, lambda _: 0.0)
    plane.heading_rad = EAST_RAD
    plane.fly(1.0, lambda _: 0.0)
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS, abs=0.15)


def test_one_that_never_worked_stands_for_calm_air() -> None:
    plane = Aircraft(wind_mps=(-3.0, 0.0))
    assert not any(plane.fly(5.0, lambda _: 0.0))
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS - 3.0)


@given(st.lists(st.tuples(st.floats(-15.0, 15.0), st.floats(-15.0, 15.0), speeds, headings), min_size=1, max_size=8))
@settings(max_examples=60, deadline=None)
def test_gusts_and_turns_of_any_size_are_accepted_within_what_is_flown(
    legs: list[tuple[float, float, float, float]],
) -> None:
    plane = Aircraft()
    for north_mps, east_mps, flown_mps, heading_rad in legs:
        plane.wind_mps, plane.flown_mps, plane.heading_rad = (north_mps, east_mps), flown_mps, heading_rad
        assert all(plane.fly(2.0))


@given(st.floats(0.7, 1.3), st.floats(1.0, 1.25), speeds, headings)
@settings(max_examples=60, deadline=None)
def test_sensors_with_a_scale_of_their_own_at_density_altitude_are_accepted(
    scale: float, thin: float, ias_mps: float, heading_rad: float
) -> None:
    """Before anything is known about scale and density, and straight on after a turn."""
    plane = Aircraft(flown_mps=scale * thin * ias_mps)
    for plane.heading_rad in (NORTH_RAD, heading_rad):
        assert all(plane.fly(5.0, lambda _: ias_mps))


@pytest.mark.parametrize("wind_mps", [-10.0, 0.0, 6.0, 10.0])
def test_a_take_off_is_accepted_against_and_with_the_wind(wind_mps: float) -> None:
    plane = Aircraft(wind_mps=(wind_mps, 0.0))
    for tick in range(100):
        plane.flown_mps = max(0.0, -wind_mps) + 0.2 * tick
        assert all(plane.fly(PERIOD_S))


@pytest.mark.parametrize("flown_mps", [10.0, 36.0])
def test_what_velocity_over_ground_shows_as_well_is_accepted_beyond_all_limits(flown_mps: float) -> None:
    """As in a dive or a stall."""
    plane = Aircraft(wind_mps=(5.0, 5.0))
    plane.fly(10.0)
    plane.flown_mps = flown_mps
    assert all(plane.fly(10.0))


def test_it_is_accepted_again_once_it_has_read_what_is_flown_for_a_while() -> None:
    plane = Aircraft()
    plane.fly(10.0)
    assert not any(plane.fly(5.0, lambda _: 0.0))
    back = plane.fly(5.0)
    assert back == sorted(back)
    assert PERIOD_S * back.count(False) == pytest.approx(RETURN_S, abs=PERIOD_S)


def test_a_loose_contact_is_rejected_in_between() -> None:
    plane = Aircraft()
    plane.fly(10.0)
    assert not any(plane.fly(20.0, lambda since_s: 0.0 if since_s % 1.0 < 0.5 else FLOWN_MPS))


def test_what_a_sensor_shows_that_ices_up_makes_little_of_the_wind() -> None:
    """1 m/s less each second counts as wind until the reading is 11 m/s too low."""
    plane = Aircraft()
    plane.fly(60.0)
    accepted = plane.fly(40.0, lambda since_s: max(0.0, FLOWN_MPS - since_s))
    assert PERIOD_S * accepted.count(True) == pytest.approx(FLOWN_MPS - 0.7 * SLOWEST_MPS, abs=2 * PERIOD_S)
    assert not any(accepted[accepted.count(True) :])
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS, abs=2.0)


def test_a_restart_leaves_the_wind_as_it_is() -> None:
    plane = Aircraft(wind_mps=(-6.0, 3.0), now_s=500.0)
    plane.fly(10.0)
    plane.now_s = 1.0
    assert not any(plane.fly(5.0, lambda _: 0.0))
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS)


def test_stamps_that_begin_again_do_not_delay_that_a_sensor_which_works_is_accepted() -> None:
    plane = Aircraft(now_s=500.0)
    plane.fly(10.0)
    assert not any(plane.fly(5.0, lambda _: 0.0))
    plane.now_s = 1.0
    back = plane.fly(5.0)
    assert back == sorted(back)
    assert PERIOD_S * back.count(False) == pytest.approx(RETURN_S, abs=2 * PERIOD_S)


def test_after_a_restart_that_is_known_a_sensor_which_works_is_accepted_at_once() -> None:
    plane = Aircraft(wind_mps=(-6.0, 3.0), now_s=500.0)
    plane.fly(10.0)
    plane.fly(5.0, lambda _: 0.0)
    plane.check.restart()
    plane.now_s = 1.0
    assert all(plane.fly(5.0))
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS)


def test_after_a_restart_that_is_known_one_which_still_fails_is_replaced_by_the_wind_known_before() -> None:
    plane = Aircraft(wind_mps=(-6.0, 3.0), now_s=500.0)
    plane.fly(10.0)
    plane.fly(5.0, lambda _: 0.0)
    plane.check.restart()
    plane.now_s = 1.0
    assert not any(plane.fly(5.0, lambda _: 0.0))
    assert plane.check.synthetic_mps == pytest.approx(FLOWN_MPS)
