"""The margins by which airspeed readings are rejected and accepted again, from both sides, and the wind known."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_formation.estimation.airspeed import AirspeedCheck

SLOWEST_MPS, FASTEST_MPS, FLOWN_MPS = 16.0, 28.0, 22.0
"""Readings fly from 0.7 times the slowest to 1.2 times the fastest: 11.2 to 33.6 m/s; with half the margins 13.6 to
30.8. A quarter of the slowest is 4 m/s, half of that 2."""
PERIOD_S = 0.5

headings = st.floats(-math.pi, math.pi)
winds = st.floats(-12.0, 12.0)


def begun(flown_mps: float = FLOWN_MPS) -> AirspeedCheck:
    """Return what is known of an aircraft that flies north in calm air."""
    check = AirspeedCheck(SLOWEST_MPS, FASTEST_MPS)
    assert check.accepts(0.0, flown_mps, 0.0, 0.0, flown_mps, 1.0)
    return check


def rejecting(flown_mps: float) -> AirspeedCheck:
    """Return the same after a reading of 0, at 0 s."""
    check = begun()
    assert not check.accepts(0.0, FLOWN_MPS, 0.0, 0.0, 0.0, 1.0)
    assert not check.accepts(0.0, flown_mps, 0.0, 0.0, 0.0, 1.0)
    return check


@given(winds, winds, headings, headings, st.floats(16.0, 28.0), st.floats(1.0, 1.3))
@settings(max_examples=20)
def test_velocity_over_ground_less_the_wind_is_the_airspeed_in_all_quadrants(
    north_mps: float, east_mps: float, before_rad: float, after_rad: float, flown_mps: float, ratio: float
) -> None:
    """At density altitude too, where the sensor reads less; the first sample shows the wind."""
    check = AirspeedCheck(SLOWEST_MPS, FASTEST_MPS)
    for stamp_s, heading_rad in ((0.0, before_rad), (PERIOD_S, after_rad)):
        over_ground_mps = north_mps + flown_mps * math.cos(heading_rad), east_mps + flown_mps * math.sin(heading_rad)
        assert check.accepts(stamp_s, *over_ground_mps, heading_rad, flown_mps / ratio, ratio)
    assert check.synthetic_mps == pytest.approx(flown_mps)


@pytest.mark.parametrize(
    ("flown_mps", "ias_mps", "accepted"),
    [
        (FLOWN_MPS, 11.3, True),
        (FLOWN_MPS, 11.1, False),
        (FLOWN_MPS, 33.5, True),
        (FLOWN_MPS, 33.7, False),
        (14.0, 10.1, True),
        (14.0, 10.0, False),
        (32.0, 35.9, True),
        (32.0, 36.0, False),
        (11.1, 0.0, True),
        (11.3, 0.0, False),
        (33.5, 60.0, False),
        (33.7, 60.0, True),
    ],
)
def test_a_reading_is_rejected_outside_the_envelope_if_it_is_unexpected_and_the_expected_one_is_inside(
    flown_mps: float, ias_mps: float, accepted: bool
) -> None:
    assert begun(flown_mps).accepts(PERIOD_S, flown_mps, 0.0, 0.0, ias_mps, 1.0) == accepted


@pytest.mark.parametrize(
    ("flown_mps", "ias_mps", "returns"),
    [
        (FLOWN_MPS, 13.7, True),
        (FLOWN_MPS, 13.5, False),
        (FLOWN_MPS, 30.7, True),
        (FLOWN_MPS, 30.9, False),
        (12.0, 10.1, True),
        (12.0, 10.0, False),
    ],
)
def test_a_rejected_one_returns_after_two_seconds_within_half_of_these_margins(
    flown_mps: float, ias_mps: float, returns: bool
) -> None:
    check = rejecting(flown_mps)
    found = [check.accepts(PERIOD_S * number, flown_mps, 0.0, 0.0, ias_mps, 1.0) for number in (1, 2, 3, 4)]
    assert found == [False, False, False, returns]


def test_it_has_to_return_for_two_seconds_each_time_it_was_rejected() -> None:
    check, found = rejecting(FLOWN_MPS), list[bool]()
    readings = [FLOWN_MPS] * 6 + [0.0] + [FLOWN_MPS] * 6
    for number, ias_mps in enumerate(readings, start=1):
        found.append(check.accepts(PERIOD_S * number, FLOWN_MPS, 0.0, 0.0, ias_mps, 1.0))
    assert found == [False, False, False, True, True, True, False, False, False, False, True, True, True]


@pytest.mark.parametrize(("flown_mps", "ratio"), [(13.125, 1.25), (8.4, 0.8)])
def test_what_is_expected_is_the_indicated_airspeed(flown_mps: float, ratio: float) -> None:
    """A stall at 10.5 m/s indicated; 13.1 m/s of true airspeed where the air is thin."""
    check = begun()
    assert check.accepts(PERIOD_S, flown_mps, 0.0, 0.0, flown_mps / ratio, ratio)


def test_the_wind_is_averaged_over_half_a_minute() -> None:
    """After a step to 6 m/s from the west an aircraft that flies north knows 1 - 1/e of it; then it turns east."""
    check = begun()
    for number in range(1, 61):
        assert check.accepts(PERIOD_S * number, FLOWN_MPS, 6.0, 0.0, FLOWN_MPS, 1.0)
    check.accepts(30.0, 0.0, FLOWN_MPS + 6.0, math.pi / 2, FLOWN_MPS, 1.0)
    assert check.synthetic_mps == pytest.approx(FLOWN_MPS + 6.0 / math.e)


def test_a_rejected_reading_leaves_the_wind_along_the_nose_and_not_across() -> None:
    """The air speeds up by 5 m/s along the nose and 6 across: the one counts as airspeed, the other as wind."""
    check = rejecting(FLOWN_MPS)
    for number in range(1, 61):
        assert not check.accepts(PERIOD_S * number, FLOWN_MPS + 5.0, 6.0, 0.0, 0.0, 1.0)
        assert check.synthetic_mps == pytest.approx(FLOWN_MPS + 5.0)
    assert not check.accepts(30.0, 0.0, FLOWN_MPS + 6.0, math.pi / 2, 0.0, 1.0)
    assert check.synthetic_mps == pytest.approx(FLOWN_MPS + 6.0 / math.e)
