"""What `check` says about telemetry that is too old, and about ticks that are too rare."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from formation_scenario import load_scenario
from gcs_formation.app.check import check_report
from gcs_formation.app.check_links import too_old

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
def test_telemetry_that_is_too_old_for_a_flight_to_begin_is_reported(override: str, found: str) -> None:
    """At 10 Hz it gets a tenth of a second older than the downlink's delay before the next message comes."""
    said = too_old(load_scenario(PLAIN, [override]))
    assert (said is not None) == bool(found)
    if said is not None:
        assert said.startswith(f"law.max_age_s: {found} (the delay down its link, and 1/telemetry.rate_hz): beyond")
        assert said.endswith("that it isn't flown in the formation, which may never set out")
        assert said in check_report(load_scenario(PLAIN, [override]))["warnings"]


def test_a_delay_that_comes_later_is_reported_with_whose_and_when() -> None:
    later = "links.changes=[{at_s: 40, vehicles: [3], downlink: {delay_ms: 7000}}]"
    said = str(too_old(load_scenario(PLAIN, [later])))
    assert "telemetry of vehicle 3 gets 7.1 s old" in said
    assert said.endswith(" from 40 s on: beyond that it isn't flown in the formation")


@pytest.mark.parametrize(
    ("rate_hz", "delay_ms", "loss", "least"),
    [
        ("0.5", 0, 0.02, ""),
        ("0.5", 200, 0.02, "0.6"),
        ("0.6", 200, 0.02, ""),
        ("0.5", 200, 0.0, ""),
        ("1", 2600, 0.1, "1.1"),
    ],
)
def test_telemetry_of_which_a_single_loss_has_vehicles_loiter_is_reported(
    rate_hz: str, delay_ms: float, loss: float, least: str
) -> None:
    """Five in a square at 0.5 Hz with 2 % loss loitered eight times in 80 s among each other, and came within 3.1 m."""
    links = f"links.default={{delay_ms: {delay_ms}, loss: {loss}}}"
    planned = load_scenario(PLAIN, [f"telemetry.rate_hz={rate_hz}", links])
    told = [text for text in check_report(planned)["warnings"] if "commanded to loiter, among the others" in text]
    if not least:
        assert told == []
    else:
        (text,) = told
        assert text.startswith(f"telemetry.rate_hz: found {rate_hz}; once a message is lost, as up to {loss:.1%} are")
        assert text.endswith(f"; {least} Hz or more")


@pytest.mark.parametrize(
    ("law", "rate_hz", "loops"),
    [("pid", 0.5, "xy"), ("pid", 0.7, "x"), ("pid", 0.85, ""), ("consensus", 0.85, ["consensus"])]
    + [(law, rate_hz, "") for law in ("pid", "fuzzy_pid", "consensus") for rate_hz in (1.0, 2.0)],
)
def test_ticks_too_seldom_for_the_law_are_reported(law: str, rate_hz: float, loops: Sequence[str]) -> None:
    """In flight, PID swings by 10 m at 0.5 Hz and 0.2 m at 0.85 Hz, consensus by 11 m at 0.85 Hz and 0.8 m at 1 Hz."""
    planned = load_scenario(PLAIN, [f"law.type={law}", f"law.rate_hz={rate_hz}"])
    told = [text for text in check_report(planned)["warnings"] if "no prediction makes up for that" in text]
    assert [text.split()[1] for text in told] == [f"{loop}:" for loop in loops]


def test_the_least_rate_that_is_reported_is_one_that_is_not_reported_of() -> None:
    """The margin along the path is 0.863 s: a tick with 1 s of mean hold uses 116 % of it."""
    (told,) = [
        text for text in _warnings("0.7") if text.startswith("loop x: setpoints are held for 0.714 s on average")
    ]
    assert "83% of its margin 0.863 s" in told
    least = told.rpartition(" or more")[0].rpartition(" ")[2]
    assert not any(text.startswith("loop x: setpoints") for text in _warnings(least))


def _warnings(rate_hz: str) -> list[str]:
    return check_report(load_scenario(PLAIN, ["law.type=pid", f"law.rate_hz={rate_hz}"]))["warnings"]
