"""Short flights under the virtual clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import gcs_formation
from flight_model.arrays import Array
from gcs_formation import Summary
from gcs_formation.app import run as app_run
from sim_vehicles.truth import TruthRecord

Fly = Callable[..., Summary]
STRAIGHT = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]}


def scenario(**keys: Any) -> dict[str, Any]:
    """Return a leader and two followers in the air on a straight path, with the given keys changed."""
    plain: dict[str, Any] = {
        "schema": 1,
        "name": "short",
        "duration_s": 30,
        "vehicles": {"count": 3},
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 2},
        "formation": {"shape": "arrow", "spacing_m": 30},
        "path": STRAIGHT,
    }
    return plain | keys


@pytest.fixture
def fly(tmp_path: Path) -> Fly:
    """Fly a scenario with the given keys; the record is in `tmp_path / "run"`."""

    def run(**keys: Any) -> Summary:
        return gcs_formation.run(scenario(**keys), clock="virtual", out=tmp_path / "run", overwrite=True)

    return run


@pytest.fixture
def kept_truth(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Array]]:
    """Keep the rows of each flight's truth, which `run` deletes."""
    found = list[dict[str, Array]]()

    def read(directory: Path) -> TruthRecord | None:
        record = original(directory)
        if record is not None:
            found.append(record.between(-math.inf, math.inf))
        return record

    original = app_run.recorded_truth
    monkeypatch.setattr(app_run, "recorded_truth", read)
    return found
