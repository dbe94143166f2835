"""Flights over radios that carry less than full rates, and what a flight puts on its links."""

from __future__ import annotations

from pathlib import Path

import pytest

import gcs_formation
from benchmarks.traffic import traffic

CONFIGS = Path(__file__).parents[2] / "configs"
TODAY_UP, TODAY_DOWN = 547_600, 1_543_377
"""Bytes of the quickstart when every change was sent, and every message came as often as positions."""


@pytest.mark.slow
def test_the_quickstart_takes_half_of_the_bytes_up_and_two_thirds_down(tmp_path: Path) -> None:
    gcs_formation.run(CONFIGS / "quickstart.yaml", clock="virtual", out=tmp_path / "run")
    _, octets, _ = traffic(tmp_path / "run" / "flight.tlog", 255)
    assert sum(count for (up, _), count in octets.items() if up) <= TODAY_UP / 2
    assert sum(count for (up, _), count in octets.items() if not up) <= TODAY_DOWN * 2 / 3


@pytest.mark.slow
@pytest.mark.parametrize(("count", "rate_kbps", "loss"), [(4, 57.6, 0.05), (2, 19.2, 0.0)])
def test_a_radio_that_carries_less_than_full_rates_assembles_and_flies(
    count: int, rate_kbps: float, loss: float
) -> None:
    """The scenario names nothing but the radio."""
    channel = {"vehicles": "all", "rate_kbps": rate_kbps, "duplex": "half", "loss": loss}
    ids = [{"id": 1, "role": "leader"}, *({"id": each, "role": "follower"} for each in range(2, count + 1))]
    formation = {"shape": "diamond" if count == 4 else "follower", "spacing_m": 30, "frame": "leader_heading"}
    given = {"vehicles": ids, "formation": formation, "links": {"channels": [channel]}, "expect": []}
    summary = gcs_formation.run(CONFIGS / "quickstart.yaml", clock="virtual", overrides=given).to_dict()
    for follower in summary["followers"].values():
        assert max(follower[axis]["rms"] for axis in ("error_x_m", "error_y_m", "error_z_m")) <= 0.05
    assert all(link["heard_to_s"] is None for link in summary["links"].values())


@pytest.mark.slow
def test_a_link_of_which_the_station_is_given_nothing_is_found_to_be_full_and_emptied(tmp_path: Path) -> None:
    """A line of 9.6 kbit/s each way for each vehicle takes a fifth less than full rates."""
    link = {"rate_kbps": 9.6, "queue_ms": 1000}
    given = {
        "links.default": link,
        "duration_s": 60,
        "vehicles": [{"id": 1, "role": "leader"}, {"id": 2, "role": "follower"}],
    }
    given |= {"formation": {"shape": "follower", "spacing_m": 30}, "expect": []}
    summary = gcs_formation.run(CONFIGS / "quickstart.yaml", clock="virtual", overrides=given, out=tmp_path / "run")
    said = (tmp_path / "run" / "events.jsonl").read_text()
    assert " is full (messages wait for " in said
    assert summary.to_dict()["followers"]["2"]["error_x_m"]["rms"] < 0.2
