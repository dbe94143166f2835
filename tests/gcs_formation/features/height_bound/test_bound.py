"""Heights stay near path and slot, whatever a vehicle says."""

from __future__ import annotations

from gcs_formation.features.height_bound.height_bound import BOUND_M
from tests.gcs_formation.features.sinking import sunk


def test_a_leader_that_sinks_takes_its_followers_no_lower_than_the_bound_below_their_path() -> None:
    _, min_m = sunk(60.0)
    assert 60.0 - BOUND_M - 0.1 <= min_m < 60.0
