"""From where the first swing counts, and which answers count after others have commanded a vehicle."""

from __future__ import annotations

import math

import pytest

from tests.gcs_formation.features.limit_cycle.test_watch import Swinging, zigzag


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_less_than_a_metre_before_the_first_swing_is_none_of_its_own(sign: float) -> None:
    """From 7 m: half a metre one way, and then 6 m from there to the other side and back."""
    swings, _ = zigzag([0.5, 6.5, 6.0, 6.0], sign=sign)
    assert swings.amplitude_m == pytest.approx(3.0)


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
