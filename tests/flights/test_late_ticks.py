"""Flights whose station is held up for a while, as by a busy machine, have the verdicts of those that aren't."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from airlink.clock import VirtualClock
from airlink.engine import MemoryNetwork
from formation_scenario import load_scenario
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import recorded_truth
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.record.run_directory import TRUTH
from gcs_formation.record.summary import Summary
from sim_vehicles.config import fleet_config
from sim_vehicles.fleet import Fleet
from sim_vehicles.truth import TruthWriter
from tests.flights.conftest import scenario
from tests.flights.in_memory import Sleeper

END_S = 12.0
KEYS: dict[str, Any] = {
    "duration_s": END_S,
    "finish": {"loiter_s": 1},
    "expect": [
        {"metric": "error_x_m.max", "below": 0.5},
        {"metric": "error_x_m.rms", "from_s": 2, "to_s": 8, "below": 0.5},
        {"metric": "error_y_m.max", "from_s": 9, "below": 0.5},
        {"metric": "in_slot_share", "above": 0.9},
        {"metric": "settled_at_s", "below": 1.0},
        {"metric": "min_separation_m", "above": 10.0},
        {"metric": "measured_delay_ms.p50", "below": 100.0},
        {"metric": "violations", "below": 1},
    ],
}


def flown(directory: Path, held_up: tuple[float, float] | None, **keys: Any) -> Summary:
    """Return the summary of a flight whose station is held up from a mission time on, for some seconds."""
    planned, clock = load_scenario(scenario(**{**KEYS, **keys})), VirtualClock()
    session = Session(planned, RunOptions(directory, "virtual"), clock, Progress(), Interrupts(), emulated=True)
    process, network, flight = Sleeper(session.engine), MemoryNetwork(clock), session.station.flight
    waiting = [] if held_up is None else [held_up]

    def attend() -> bool:
        if waiting and flight.mission_time_s(clock.now()) >= waiting[0][0] - 1e-6:
            process.stop(clock.now(), waiting.pop()[1])
        return session.attend()

    with TruthWriter(session.recorder.path / TRUTH, len(planned.vehicles)) as writer:
        network.attach(Fleet(fleet_config(planned), truth=writer))
        network.attach(process)
        network.run(attend)
    truth = recorded_truth(directory)
    assert truth is not None
    return session.conclude(truth.between)


@pytest.mark.parametrize(
    "held_up",
    [None, pytest.param((0.0, 1.0), marks=pytest.mark.slow), (7.5, 1.0), (END_S - 0.4, 0.5), (END_S - 0.5, 1.0)],
)
def test_no_expectation_is_broken_because_ticks_are_late(held_up: tuple[float, float] | None, tmp_path: Path) -> None:
    """At the path's beginning, across the end of a window, and across the flight's end, which comes late then."""
    summary = flown(tmp_path, held_up)
    assert [str(each) for each in summary.verdicts if each.held is not True] == []
    assert summary.breaches == ()
    assert summary.figures["duration_s"] == pytest.approx(END_S)


@pytest.mark.slow
@pytest.mark.parametrize(("at_s", "done"), [(2.9, True), (3.4, False)])
@pytest.mark.parametrize("held_up", [None, (2.8, 0.8), (3.3, 0.8), (END_S + 7.5, 1.0)])
def test_a_change_is_done_or_under_way_whether_or_not_a_tick_is_late(
    at_s: float, done: bool, held_up: tuple[float, float] | None, tmp_path: Path
) -> None:
    """It takes 16.8 s, and the flight is over at 20 s."""
    changes = {"formation": {"shape": "diamond", "spacing_m": 30, "changes": [{"at_s": at_s, "shape": "line"}]}}
    summary = flown(tmp_path, held_up, duration_s=END_S + 8.0, expect=[], **changes)
    assert (summary.figures["undone"] == []) is done
