"""From which sample on a position counts as noisy: by how many gain too much, and by how many take that back."""

from __future__ import annotations

import pytest

from gcs_formation.features.telemetry_health.consistency import Consistency
from tests.gcs_formation.features.telemetry_health.test_limits_of_consistency import FASTEST_MPS, Straight


def test_noise_is_not_judged_by_the_first_twenty_samples_that_are_compared() -> None:
    """The first of all has none before it."""
    flight, found = Straight(), list[bool]()
    for number in range(24):
        flight.fly(1, off_m=10.0 * (-1) ** number)
        found.append(flight.checked.is_noisy)
    assert found == [False] * 21 + [True] * 3


def test_alternating_noise_of_ten_metres_shows_in_its_fifth_sample() -> None:
    """The newest sample weighs 4 / 20 in the share of large gains: 1 - 0.8^5 is more than 0.6, 1 - 0.8^4 isn't.

    100 m² of four that take back, weighing 1 / 20 each, are 18.5 m²: less than the 25 m² that would do alone.
    """
    flight = Straight()
    flight.fly(40)
    found = list[bool]()
    for number in range(6):
        flight.fly(1, off_m=10.0 * (-1) ** number)
        found.append(flight.checked.is_noisy)
    assert found == [False] * 4 + [True] * 2


@pytest.mark.parametrize(("period", "is_noisy"), [(5, True), (6, False)])
def test_noise_takes_back_in_a_quarter_of_the_samples_what_the_one_before_gained(period: int, is_noisy: bool) -> None:
    """The newest weighs 3 / 20: once in five samples reaches 0.15 / (1 - 0.85^5) = 0.27, once in six 0.24.

    All gain 10 m: one in a period the opposite of the one before, the others across it.
    """
    checked, position, axis, found = Consistency(2, FASTEST_MPS), [0.0, 0.0], 0, False
    for number in range(150):
        takes_back = number % period == 1
        if number >= 40:
            axis = axis if takes_back else 1 - axis
            position[axis] += -10.0 if takes_back else 10.0
        checked.take(1 + round(number * 1e8), list(position), [0.0, 0.0], [0.0, 0.0], (0.0, 0.0))
        found = found or checked.is_noisy
    assert found == is_noisy
