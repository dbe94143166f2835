"""Steps of setpoints from tick to tick, and the formation's errors meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import gcs_formation
from gcs_formation.record.figures_of_merit import setpoint_steps
from gcs_formation.record.parquet import read_parquet
from gcs_formation.record.run_directory import TIMESERIES
from tests.processes import events_of

CONFIGS = Path(__file__).parents[2] / "configs"
STEADY_S = 30.0


class Steps(NamedTuple):
    """Steps of the follower with the largest ones: 95th percentile in steady flight, and maximum."""

    speed_mps: tuple[float, float]
    heading_deg: tuple[float, float]
    settled_s: float


def fly(out: Path, config: str, delay_ms: float, largest_from_s: float) -> Steps:
    """Fly 80 s without disturbance, beginning (8, 6, 4) m from the slots."""
    summary = gcs_formation.run(
        CONFIGS / config,
        clock="virtual",
        out=out / "run",
        duration_s=80.0,
        links={"default": {"delay_ms": delay_ms}},
        disturbances=[],
        expect=[],
    )
    series = read_parquet(out / "run" / TIMESERIES)
    each = [_steps({name: column[series["vehicle"] == v] for name, column in series.items()}) for v in (2, 3, 4)]

    def largest(channel: int) -> tuple[float, float]:
        begun = [(time_s, steps[channel]) for time_s, steps in each]
        usual = max(float(np.nanpercentile(size[time_s >= STEADY_S], 95)) for time_s, size in begun)
        return usual, max(float(np.nanmax(size[time_s >= largest_from_s])) for time_s, size in begun)

    settled = [follower["settled_at_s"] for follower in summary.to_dict()["followers"].values()]
    return Steps(largest(0), largest(1), max(settled))


def _steps(columns: dict[str, np.ndarray]) -> tuple[np.ndarray, Sequence[np.ndarray]]:
    """Return mission time, s, and steps of speed, m/s, and heading, degrees."""
    return columns["mission_time_s"], (setpoint_steps(columns, "speed"), np.degrees(setpoint_steps(columns, "heading")))


@pytest.mark.slow
def test_setpoints_over_perfect_links_are_quiet(tmp_path: Path) -> None:
    steps = fly(tmp_path, "paper.yaml", 0.0, largest_from_s=STEADY_S)
    assert steps.speed_mps[0] <= 0.05
    assert steps.speed_mps[1] <= 5 * 0.05
    assert steps.heading_deg[0] <= 0.3
    assert steps.heading_deg[1] <= 5 * 0.3
    assert steps.settled_s <= 25.0


@pytest.mark.slow
def test_setpoints_from_noisy_telemetry_are_quiet_from_the_start_of_the_path_on(tmp_path: Path) -> None:
    steps = fly(tmp_path, "noise.yaml", 300.0, largest_from_s=0.0)
    assert steps.speed_mps[0] <= 0.15
    assert steps.speed_mps[1] <= 5 * 0.15
    assert steps.heading_deg[0] <= 0.5
    assert steps.heading_deg[1] <= 5 * 0.5
    assert steps.settled_s <= 25.0


@pytest.mark.parametrize("config", ["quickstart.yaml", pytest.param("arduplane.yaml", marks=pytest.mark.slow)])
def test_of_a_quiet_flight_there_is_nothing_to_say_but_what_it_does(config: str, tmp_path: Path) -> None:
    """Until 12 s after all have been told to loiter, when no setpoints are sent any more."""
    summary = gcs_formation.run(
        CONFIGS / config,
        clock="virtual",
        out=tmp_path / "run",
        until=10.0,
        finish={"loiter_s": 12.0},
        disturbances=[],
        expect=[],
    )
    assert summary.breaches == ()
    kinds = {event["kind"] for event in events_of(tmp_path / "run")}
    assert kinds <= {"recording", "emulation", "link", "mode", "statustext", "ready", "member", "phase"}
