"""Whose delay a vehicle's loop has, and whose shares are known."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gcs_formation.features.delay_margins.margin_watch import LASTING_LOOKS
from tests.gcs_formation.features.delay_margins.test_margin_watch import Formation


@pytest.mark.parametrize(
    ("law", "counts"),
    [
        ({"type": "fuzzy_pid"}, False),
        ({"type": "pid"}, False),
        ({"type": "pid", "delay_compensation": True}, False),
        ({"type": "consensus"}, True),
        ({"type": "consensus", "delay_compensation": True}, False),
    ],
)
def test_anothers_delay_is_waited_for_by_consensus_without_prediction_only(law: dict[str, Any], counts: bool) -> None:
    """All links are of 0.1 s and scatter by 0.02 s; then the third's are of 0.4 s."""
    formation, used = Formation(3, **law), list[float]()
    for third_s in (0.1, 0.4):
        for vehicle, one_way_s in zip(formation.vehicles.values(), (0.1, 0.1, third_s), strict=True):
            formation.delay(vehicle, one_way_s, sigma_s=0.02)
        used.append([formation.look() for _ in range(LASTING_LOOKS)][-1])
    assert used[0] > 0.0
    assert (used[1] > 1.001 * used[0]) == counts
    assert counts or used[1] == pytest.approx(used[0])


@pytest.mark.parametrize("count", [2, 4])
def test_each_vehicle_has_one_share_and_three_bandwidths(count: int) -> None:
    formation = Formation(count)
    formation.look()
    assert len(formation.watch.used) == count
    assert formation.watch.bandwidth == [[1.0] * 3] * count


def test_one_that_has_led_has_a_loop_like_the_others_while_another_leads() -> None:
    formation = Formation(3)
    for vehicle in formation.vehicles.values():
        formation.delay(vehicle, 0.15)
    formation.look(formation.follower)
    former, leads, other = formation.watch.used
    assert math.isnan(leads)
    assert former == pytest.approx(other)
    assert other > 0.1
