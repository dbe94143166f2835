"""One that no longer flies as it is commanded is kept clear of by where its mode takes it."""

from __future__ import annotations

import pytest

from tests.gcs_formation.features.separation.test_resolver import column_of_copters


@pytest.mark.parametrize(("home_m", "gives"), [((-400.0, 0.0), True), ((400.0, 0.0), False), (None, False)])
@pytest.mark.parametrize("departs", [True, False])
def test_one_that_slows_down_far_ahead_in_a_mode_that_takes_it_back_is_evaded_already(
    home_m: tuple[float, float] | None, gives: bool, departs: bool
) -> None:
    """90 m ahead, and no more than 2 m/s slower, which is far enough for one that will fly on."""
    column, yielding = column_of_copters(), list[bool]()
    column.north[1], column.flies_home_m, column.commanded_mps = 90.0, home_m, 8.0
    for tick in range(30):
        column.speed[1] = max(8.0 - 0.12 * max(tick - 10, 0), 6.0) if departs else 8.0
        yielding.append(column.keep(at_s=10.0 + 0.1 * tick).yielding[0])
    assert not any(yielding[:20])
    assert yielding[-1] is (gives and departs)
