"""The status page of a running flight, and the result."""

from __future__ import annotations

from pathlib import Path

import pytest

import gcs_formation
from gcs_formation.app.progress import progress_parts
from gcs_formation.app.result_text import _settled, status_page, summary_text
from tests.flights.conftest import scenario
from tests.flights.in_memory import World


def test_a_page_tells_phase_time_and_each_vehicle_and_fits() -> None:
    world = World(duration_s=30)
    assert status_page(world.station, world.clock.now()).startswith("short: connecting, 0.0 s after the start")
    world.fly_to(2.0)
    page = status_page(world.station, world.clock.now()).splitlines()
    assert page[0].startswith("short: flying, t = 2.0 of 30 s, ")
    assert [row.split()[0] for row in page[1:]] == ["vehicle", "1", "2", "3"]
    assert page[2].endswith("leads")
    assert page[3].endswith("in formation")
    narrow = status_page(world.station, world.clock.now(), 40).splitlines()
    assert max(map(len, narrow)) <= 40
    assert narrow[-1].split()[0] == "3"
    assert progress_parts(world.station)[0][0] == "t 2 of 30 s"


def test_the_result_says_what_was_flown_and_what_came_before_and_fits(tmp_path: Path) -> None:
    summary = gcs_formation.run(scenario(), clock="virtual", until=1.0, out=tmp_path / "run")
    figures = summary.to_dict()
    headline = summary_text(summary, tmp_path).splitlines()[0]
    assert headline.startswith(
        f"short flew 1.0 s of its path after {figures['begun_s']:.1f} s of take-off and assembly; "
    )
    simulated_s = figures["real_time_factor"] * figures["wall_s"]
    assert f"; {simulated_s:.1f} s in all, in {figures['wall_s']:.1f} s: " in headline
    assert simulated_s > figures["begun_s"] + figures["duration_s"]
    for width in (40, 60, 80):
        lines = summary_text(summary, Path("run"), width).splitlines()
        assert max(map(len, lines)) <= width
        assert any(line.split()[:2] == ["vehicle", "max"] for line in lines)


@pytest.mark.parametrize(("left_s", "reported"), [(None, "0.1"), (53.14, "0.1, left 53.1")])
def test_the_result_says_when_one_that_had_settled_left_its_slot(left_s: float | None, reported: str) -> None:
    assert _settled({"settled_at_s": 0.1, "left_at_s": left_s}) == reported
