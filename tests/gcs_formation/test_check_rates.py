"""What `check` says of telemetry that is too old, and of ticks that are too seldom."""

from __future__ import annotations

import pytest

from formation_scenario import load_scenario
from gcs_formation.app.check import check_report
from gcs_formation.app.check_warnings import too_old

PLAIN = {"vehicles": {"count": 4}, "path": {"waypoints_m": [[0, 0, 100], [3000, 0, 100]]}}


@pytest.mark.parametrize(
    ("override", "found"),
    [
        ("law.max_age_s=0.01", "found 0.01; telemetry of vehicle 1, 2, 3, 4 gets 0.1 s old"),
        ("links.default.delay_ms=6000", "found 5; telemetry of vehicle 1, 2, 3, 4 gets 6.1 s old"),
        ("links.default.downlink.delay_ms=4901", "found 5; telemetry of vehicle 1, 2, 3, 4 gets 5.001 s old"),
        ("links.default.downlink.delay_ms=4899", ""),
        ("links.default.uplink.delay_ms=6000", ""),
        ("telemetry.rate_hz=0.5", ""),
    ],
)
def test_telemetry_that_is_too_old_for_a_flight_to_begin_is_told(override: str, found: str) -> None:
    """At 10 Hz it is a tenth of a second older than its way down took before the next comes."""
    said = too_old(load_scenario(PLAIN, [override]))
    assert (said is not None) == bool(found)
    if said is not None:
        assert said.startswith(f"law.max_age_s: {found} (the delay down its link, and 1/telemetry.rate_hz): beyond")
        assert said.endswith("that it isn't flown in the formation, which may never set out")
        assert said in check_report(load_scenario(PLAIN, [override]))["warnings"]


def test_a_delay_that_comes_later_is_told_with_whose_and_when() -> None:
    later = "links.changes=[{at_s: 40, vehicles: [3], downlink: {delay_ms: 7000}}]"
    said = str(too_old(load_scenario(PLAIN, [later])))
    assert "telemetry of vehicle 3 gets 7.1 s old" in said
    assert said.endswith(" from 40 s on: beyond that it isn't flown in the formation")
