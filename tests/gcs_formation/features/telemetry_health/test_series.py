"""Whether telemetry was believed, in the time series at each tick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gcs_formation.core.feature import derived
from gcs_formation.features.telemetry_health.series import health_columns, spells
from gcs_formation.record.parquet import read_parquet, write_parquet


def health(t_s: float, vehicle: str, quantity: str, *, healthy: bool) -> dict[str, Any]:
    return {"t_s": t_s, "kind": "health", "vehicle": vehicle, "quantity": quantity, "healthy": healthy, "text": ""}


EVENTS = [
    health(1.0, "2", "height", healthy=False),
    {"t_s": 1.5, "kind": "member", "vehicle": "2", "text": ""},
    health(2.0, "2", "height", healthy=False),  # the same, in other words
    health(3.0, "2", "height", healthy=True),
    health(4.0, "2", "height", healthy=False),
    health(4.0, "1", "position", healthy=False),
]


def test_a_quantity_is_not_believed_from_its_event_to_the_one_that_says_so() -> None:
    assert spells(EVENTS) == {("2", "height"): [(1.0, 3.0), (4.0, np.inf)], ("1", "position"): [(4.0, np.inf)]}


def test_each_tick_says_which_quantities_of_each_vehicle_are_believed() -> None:
    block = health_columns(EVENTS, ["1", "2"])(np.array([0.5, 1.0, 2.9, 3.0, 4.5]))
    np.testing.assert_array_equal(block["healthy_height"][:, 1], [1, 0, 0, 1, 0])
    np.testing.assert_array_equal(block["healthy_position"][:, 0], [1, 1, 1, 1, 0])
    assert block["healthy_height"][:, 0].all()
    assert block["healthy_velocity"].all()
    assert block["healthy_velocity"].dtype == np.bool_, "written as a flag"


def test_without_an_alarm_the_series_stays_as_it_is() -> None:
    assert health_columns(EVENTS[1:2], ["1", "2"])(np.zeros(3)) == {}


def test_columns_of_features_are_written_as_flags_beside_those_of_the_spool(tmp_path: Path) -> None:
    time_s = np.repeat([[0.5], [1.0], [2.9], [3.0], [4.5]], 2, axis=1)
    block = {"t_s": time_s, "phase": np.zeros(time_s.shape)}
    write_parquet(tmp_path / "series.parquet", derived(iter([block]), EVENTS, ["1", "2"]))
    flown = read_parquet(tmp_path / "series.parquet")
    assert flown["healthy_height"].dtype == np.bool_
    np.testing.assert_array_equal(flown["healthy_height"].reshape(5, 2)[:, 1], [True, False, False, True, False])
    np.testing.assert_array_equal(flown["t_s"], time_s.ravel())
