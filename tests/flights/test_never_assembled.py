"""A formation that never comes together is a failure of its flight's purpose."""

from __future__ import annotations

import pytest

from tests.flights.conftest import Fly


@pytest.mark.slow
def test_a_flight_that_never_assembled_does_not_hold(fly: Fly) -> None:
    """Vehicle 3 is slower than its model says. It exited with 0 when nothing was expected of it."""
    vehicles = [{"id": 1, "role": "leader"}, {"id": 2}, {"id": 3, "true_model": {"speed_max_mps": 20}}]
    start = {"in_air": True, "run_in_s": 20, "timeout_s": 30}
    found = fly(vehicles=vehicles, start=start, duration_s=15)
    assert (found.figures["assembled"], found.held) == (False, False)
    why = "the path began after start.timeout_s, 30 s, and follower 3 never settled in its slot"
    assert found.breaches == (f"never assembled: {why}",)
    assert found.figures["undone"] == list(found.breaches)
