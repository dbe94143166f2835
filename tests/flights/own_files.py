"""Extensions in files outside of the packages, and a short flight that uses them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

import gcs_formation
from gcs_formation.record.run_directory import EVENTS, TIMESERIES

EXAMPLES = Path(__file__).parents[2] / "examples" / "extensions"
HEAD = "from pydantic import BaseModel\nfrom gcs_formation.extend import *\n"


def keys(**more: Any) -> dict[str, Any]:
    """A flight of three vehicles, 14 s along a straight path."""
    return {
        "name": "own",
        "duration_s": 14,
        "vehicles": {"count": 3},
        "start": {"in_air": True, "run_in_s": 6},
        "finish": {"loiter_s": 1},
        "formation": {"shape": "arrow", "spacing_m": 30},
        "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100], [4000, 0, 100]]},
        **more,
    }


def own(directory: Path, code: str, name: str = "own.py") -> Path:
    """A file with code from outside."""
    file = directory / name
    file.write_text(code, encoding="utf-8")
    return file


def flown(directory: Path, *plugins: Path, **more: Any) -> gcs_formation.Summary:
    return gcs_formation.run(keys(**more), clock="virtual", out=directory / "run", plugins=plugins)


def events(directory: Path, kind: str) -> list[dict[str, Any]]:
    lines = (directory / "run" / EVENTS).read_text(encoding="utf-8").splitlines()
    return [each for each in map(json.loads, lines) if each["kind"] == kind]


def series(directory: Path, column: str, vehicle: str, phase: str = "flying") -> np.ndarray:
    found = pq.read_table(directory / "run" / TIMESERIES).to_pydict()
    chosen = (np.array(found["phase"]) == phase) & (np.array(found["vehicle"]).astype(str) == vehicle)
    return np.array(found[column])[chosen]
