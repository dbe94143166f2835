"""What `check` says of `law.on_delay` where a registered law states its margins, or none."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gcs_formation.features.delay_margins.check_warnings import without_margins
from gcs_formation.features.delay_margins.margin_watch import MarginWatch
from tests.flights.test_stated_margins import LAW, STATED, loaded
from tests.gcs_formation.event_log import EventLog

NO_GAINS = "it does nothing: law it has no gains that could be lowered"
NO_MARGIN = "it does nothing: law it has no delay margin of its own"
OF_ONE = (
    LAW
    + """
    def delay_margins_s(self, follower):
        return {"height": 0.5} if follower.id == 2 else {}
"""
)


@pytest.mark.parametrize(
    ("code", "on_delay", "words"),
    [
        (STATED, "degrade", [f"law.on_delay: found degrade; {NO_GAINS}"]),
        (STATED, "hold", []),
        (STATED, "warn", []),
        (OF_ONE, "degrade", [f"law.on_delay: found degrade; {NO_GAINS}"]),
        (OF_ONE, "hold", []),
        (LAW, "degrade", [f"law.on_delay: found degrade; {NO_MARGIN}"]),
        (LAW, "hold", [f"law.on_delay: found hold; {NO_MARGIN}"]),
        (LAW, "warn", []),
    ],
)
def test_with_stated_margins_vehicles_can_be_held_and_gains_not_be_lowered_and_without_any_neither(
    code: str, on_delay: str, words: list[str], tmp_path: Path
) -> None:
    scenario = loaded(tmp_path, code, law={"type": "it", "on_delay": on_delay, "delay_compensation": False})
    assert list(without_margins(scenario)) == words


@pytest.mark.parametrize(("code", "max_used"), [(STATED, 0.0), (OF_ONE, 0.0), (LAW, math.nan)])
def test_the_largest_share_begins_at_nothing_where_any_margin_is_stated_and_is_unknown_else(
    code: str, max_used: float, tmp_path: Path
) -> None:
    scenario = loaded(tmp_path, code, law={"type": "it", "delay_compensation": False})
    identities = [each.vehicle_id for each in scenario.vehicles]
    vehicles: Any = {each: SimpleNamespace(identity=each, index=index) for index, each in enumerate(identities)}
    assert MarginWatch(scenario, vehicles, EventLog()).max_used == pytest.approx(max_used, nan_ok=True)
