"""Who leads when the leader is lost."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from gcs_formation.features.succession.candidates import Candidate, best_successor, can_lead

SPACING_M = 30.0
GOOD = Candidate(1, 40.0, 0.06, 0.02, 0.002)


@pytest.mark.parametrize(
    "worse",
    [
        GOOD._replace(delay_s=0.24, loss=0.0, jitter_s=0.0, distance_m=30.0),  # delay has priority
        GOOD._replace(loss=0.2, jitter_s=0.0, distance_m=30.0),
        GOOD._replace(jitter_s=0.03, distance_m=30.0),
        GOOD._replace(distance_m=42.0),
        GOOD._replace(delay_s=math.nan, distance_m=30.0),
        GOOD._replace(delay_s=0.0, distance_m=71.0),  # farther than the nearest by more than a spacing
    ],
)
def test_of_those_near_enough_the_best_link_leads_by_delay_then_loss_then_jitter_then_distance(worse: Candidate):
    assert best_successor([worse._replace(vehicle_index=0), GOOD], SPACING_M) == 1
    assert best_successor([GOOD, worse._replace(vehicle_index=2)], SPACING_M) == 1


def test_random_differences_between_links_do_not_decide():
    alike = GOOD._replace(vehicle_index=0, delay_s=0.064, loss=0.024, jitter_s=0.0024)
    assert best_successor([GOOD, alike], SPACING_M) == 0


def test_without_candidates_none_leads():
    assert best_successor([], SPACING_M) is None


@pytest.mark.parametrize(
    ("received_s", "age_s", "can"),
    [(0.9, 0.9, True), (1.1, 0.1, False), (0.1, 1.1, False)],
)
def test_who_is_to_lead_receives_and_was_received_within_a_second(received_s: float, age_s: float, can: bool) -> None:
    now = after(Instant(0), 10.0)
    follower: Any = SimpleNamespace(
        round_trips=SimpleNamespace(received_at=lambda _: after(Instant(0), 10.0 - received_s))
    )
    assert can_lead(follower, age_s, now) is can
