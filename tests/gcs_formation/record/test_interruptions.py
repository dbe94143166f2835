"""What is flown at the end of an unfinished record: how far along the path, and by which order or planned change."""

from __future__ import annotations

from pathlib import Path

import pytest

from formation_scenario import load_scenario
from gcs_formation.record.unfinished import formation_of
from tests.gcs_formation.record.test_unfinished import BEGINS, HOVERS, past, tick, ticks_to


@pytest.mark.parametrize(("flown_m", "found_m"), [(0.0, 0.0), (60.0, 60.0), (119.0, 119.0), (130.0, 120.0)])
def test_after_an_interruption_a_leader_is_found_up_to_twice_as_far_as_planned(
    flown_m: float, found_m: float, tmp_path: Path
) -> None:
    """It was 100 m along the path 12 s before, which is flown at 5 m/s."""
    back = tick(52.0)
    back.state[0].north_m = 100.0 + flown_m
    assert past(tmp_path, [BEGINS], [*ticks_to(40.0), back]).distance_m == pytest.approx(100.0 + found_m, abs=0.5)


@pytest.mark.parametrize(("ordered_s", "shape"), [(35.4, "echelon"), (35.6, "arrow")])
def test_of_an_order_and_a_planned_change_the_later_one_counts(ordered_s: float, shape: str) -> None:
    """The path began at 20 s of the run's clock, and the change was due 15.5 s later."""
    changes = [{"at_s": 15.5, "shape": "echelon"}]
    keys = HOVERS | {"duration_s": 90, "formation": {"shape": "line", "spacing_m": 20, "changes": changes}}
    events = [
        {"kind": "phase", "text": "flying", "t_s": 20.0},
        {"kind": "order", "text": "shape arrow: accepted", "t_s": ordered_s, "accepted": True},
    ]
    assert formation_of(load_scenario(keys, flown=True), events, 40.0)[0].shape == shape
