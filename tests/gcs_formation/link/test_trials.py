"""What counts of a link that has just appeared: all that was lost since, and what isn't known yet is waited for."""

from __future__ import annotations

import pytest

from gcs_formation.link.vehicle_links import ALIKE
from tests.gcs_formation.link.test_link_choice import PORTS, at, exchange, linked


@pytest.mark.parametrize(
    ("used", "trial", "proven"), [(0, 4, None), (3, 4, None), (4, 3, None), (4, 0, None), (4, 4, True)]
)
def test_a_link_is_proven_once_the_clock_is_known_by_it_and_by_the_one_in_use(
    used: int, trial: int, proven: bool | None
) -> None:
    links = linked(0.1, answers=used)
    links.try_port(0, PORTS[2], at(1.0))
    for number in range(trial):
        exchange(links.each[-1], 1.0 + 0.01 * number, 0.05)
    for _ in range(ALIKE):
        links.each[-1].compare_position(0.0)
    assert links.judge_trial(links.each[-1], at(1.5)) is proven


def test_at_the_first_look_all_that_has_come_and_gone_counts() -> None:
    """Three frames of four; of nine requests four were answered and one is as if it were: 1 - 5 / 10 / (3 / 4)."""
    (link,) = linked(0.1, answers=4).each
    for number in (1, 2, 4):
        link.sequence.observe(number, at(0.0), at(0.0))
    for _ in range(5):
        link.round_trips.request(at(0.0))
    link.look(at(0.0))
    assert (link.loss_down, link.loss_up) == (0.25, pytest.approx(1 / 3))
