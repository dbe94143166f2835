"""A flight's memory doesn't grow with its length, except for the numbers that its summary needs."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import pytest

import gcs_formation
from gcs_formation.app.session import Session
from tests.flights.conftest import scenario

RATE_HZ = 10.0


@pytest.mark.slow
@pytest.mark.parametrize("delay_ms", [0, 50])
def test_no_object_is_kept_of_a_tick(delay_ms: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One object for each vehicle and tick would be three per tick."""
    kept: dict[int, int] = {}
    ends = Session.attend

    def over(session: Session) -> bool:
        flown_s = session.station.flight.mission_time_s(session.clock.now())
        for at_s in (8, 20):
            if flown_s >= at_s and at_s not in kept:
                gc.collect()
                kept[at_s] = sys.getallocatedblocks()
        return ends(session)

    monkeypatch.setattr(Session, "attend", over)
    keys = scenario(duration_s=21, links={"default": {"delay_ms": delay_ms}}, start={"in_air": True, "run_in_s": 8})
    gcs_formation.run(keys, clock="virtual", out=tmp_path / "run")
    assert (kept[20] - kept[8]) / (12 * RATE_HZ) < 2.0
