"""Where swings begin, the limits themselves, and which answers count after others have commanded a vehicle."""

from __future__ import annotations

import math

import pytest

from gcs_formation.features.limit_cycle.swings import Swings
from gcs_formation.features.limit_cycle.watch import _cause
from tests.gcs_formation.features.limit_cycle.test_watch import Swinging, zigzag


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_less_than_a_metre_before_the_first_swing_is_none_of_its_own(sign: float) -> None:
    """From 7 m: half a metre one way, and then 6 m from there to the other side and back."""
    swings, _ = zigzag([0.5, 6.5, 6.0, 6.0], sign=sign)
    assert swings.amplitude_m == pytest.approx(3.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_after_it_was_cleared_the_first_swing_may_go_either_way_again(sign: float) -> None:
    swings, _ = zigzag([6.0] * 4)
    swings.clear()
    for count, error_m in enumerate([0.0, 3.0, -3.0, 3.0]):
        swings.add(100.0 + 4.0 * count, sign * error_m)
    assert (swings.amplitude_m, swings.period_s) == (2.25, 8.0), "of 3 m and 6 m"


def jumping(amplitude_m: float, count: int = 14) -> Swings:
    """Return the swings of an error that jumps from one side to the other every 4 s, the last time at the end."""
    swings = Swings()
    for place in range(count):
        swings.add(4.0 * place, amplitude_m if place % 2 else -amplitude_m)
    return swings


@pytest.mark.parametrize(("amplitude_m", "begins"), [(0.99, False), (1.0, True)])
def test_an_amplitude_of_a_whole_metre_begins_it(amplitude_m: float, begins: bool) -> None:
    assert jumping(amplitude_m).steady(52.0, still=False) == begins


@pytest.mark.parametrize(
    ("errors_m", "widths_m"),
    [([0.0, 1.0, -0.5], []), ([0.0, 1.01, -0.5], [1.01]), ([0.0, 3.0, 2.0], []), ([0.0, 3.0, 1.99], [3.0])],
)
def test_what_leads_away_or_back_by_no_more_than_a_metre_is_no_swing(
    errors_m: list[float], widths_m: list[float]
) -> None:
    for sign in (1.0, -1.0):
        swings = Swings()
        for place, error_m in enumerate(errors_m):
            swings.add(float(place), sign * error_m)
        assert swings._widths_m == widths_m


def test_swings_that_differ_from_their_mean_by_a_quarter_are_alike() -> None:
    """5 m there and 3 m back."""
    swings = Swings()
    for place in range(14):
        swings.add(4.0 * place, place + 4.0 * (place % 2))
    assert swings._widths_m == [5.0, 3.0] * 5
    assert swings.steady(52.0, still=False)


def test_how_long_an_error_stays_at_its_extremum_is_part_of_the_swing_that_led_there() -> None:
    """Up in 3 s, 1 s at the top, down in 4 s: either way takes 4 s."""
    swings = Swings()
    for place, error_m in enumerate([0.0, 2.0, 4.0, 6.0, 6.0, 4.5, 3.0, 1.5] * 3):
        swings.add(float(place), error_m)
    assert swings._times_s == [4.0] * 5


def test_a_swing_that_takes_a_whole_period_is_not_overdue_yet() -> None:
    """The present one began at 48 s."""
    assert jumping(3.0).steady(56.0, still=False)
    assert not jumping(3.0).steady(56.01, still=False)


@pytest.mark.parametrize(
    ("late_s", "margin_used", "named"),
    [(0.1, 0.79, "it answers"), (0.099, 0.79, "its model"), (9.0, 0.8, "its loops"), (math.nan, math.nan, "its model")],
)
def test_a_cause_is_named_from_its_limit_on(late_s: float, margin_used: float, named: str) -> None:
    assert _cause(late_s, margin_used).startswith(named)


def test_answers_from_before_others_commanded_it_say_nothing_of_its_swings_since() -> None:
    """Since then its link's delay isn't known."""
    swinging = Swinging(0.5)
    swinging.run(38.0)
    swinging.run(0.1, yielding=[False, True])
    swinging.uplink_s = math.nan
    swinging.run(60.0)
    (named,) = swinging.logged
    assert named.details["late_s"] is None
    assert "its model seems right" in named.text
