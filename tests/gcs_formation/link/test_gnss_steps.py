"""Whether a step of the midpoints is the link's or the clock's: by the round trips of just before and since."""

from __future__ import annotations

import pytest

from gcs_formation.link.gnss_clock import GnssClock
from tests.gcs_formation.link.test_gnss_clock import LOOP_S, Made


@pytest.mark.parametrize("step_s", [0.1, -0.1])
@pytest.mark.parametrize(("longer_s", "links"), [(0.0241, False), (0.0247, True), (-0.0241, False), (-0.0247, True)])
def test_a_step_is_the_links_if_round_trips_changed_by_twice_what_medians_differ_by_by_chance(
    step_s: float, longer_s: float, links: bool
) -> None:
    """12 before and 12 since, each 20 ms off by turns: a deviation of 20.9 ms with two means, of the medians 10.7 ms.

    And 3 ms besides.
    """
    clock = GnssClock(LOOP_S)
    for number in range(24):
        since = number >= 12
        clock._spans.append((0.1 + 0.02 * (-1) ** number + since * longer_s, since * step_s))
    assert clock._trips_step_with(step_s) is links


def test_a_clock_that_steps_soon_after_the_link_has_changed_is_unsteady() -> None:
    """Both ways become as much shorter each 12 s, and 2.5 s later it steps; four steps within a minute are too many."""
    made = Made(0.0, lambda at_s: (0.25, 0.25) if at_s % 12.0 < 6.0 else (0.05, 0.05))
    for number in range(4):
        assert made.clock.why_not() != "its clock doesn't run steadily"
        made.fly(12.0 * number + 8.5)
        made.gained_s += 0.1
        made.fly(12.0 * number + 12.0)
    assert made.clock.why_not() == "its clock doesn't run steadily"
