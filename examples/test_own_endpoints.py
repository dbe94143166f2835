"""The same checks with vehicles that are up already: autopilots in a simulator of their own, or real ones.

Set FORMATION_SCENARIO to a scenario with their `endpoint`s; without it the test is skipped.
"""

import os

import pytest

SCENARIO = os.environ.get("FORMATION_SCENARIO")


@pytest.mark.skipif(SCENARIO is None, reason="FORMATION_SCENARIO names no scenario")
def test_own_vehicles_keep_their_slots_over_a_late_link(formation):
    flight = formation(SCENARIO).with_link(delay_ms=100, jitter_ms=10).against("real endpoints").fly(until=60)
    flight.stays_within(2.0, from_s=30).keeps_apart(15)
