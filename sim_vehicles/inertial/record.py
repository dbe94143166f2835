"""The directory of a navigation experiment: scenario, summary, time series and figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from formation_scenario import dump_scenario
from formation_scenario.arrays import Array
from sim_vehicles.inertial.experiment import ANGLES, UNITS, Experiment, summary
from sim_vehicles.inertial.figures import draw

SCENARIO, SUMMARY, ALIGNMENT, FLIGHT, FIGURES = (
    "run.yaml",
    "summary.json",
    "alignment.parquet",
    "flight.parquet",
    "figures",
)
LENGTHS: Final = tuple(f"{axis}_{unit}" for unit in ("m", "mps") for axis in ("east", "north", "up"))


def write(directory: Path, done: Experiment) -> None:
    """Write all files, replacing those of an earlier experiment.

    Raises:
        OSError: the directory can't be written.
    """
    figures = directory / FIGURES
    figures.mkdir(parents=True, exist_ok=True)
    (directory / SCENARIO).write_text(dump_scenario(done.scenario), encoding="utf-8")
    text = json.dumps(summary(done), indent=2, ensure_ascii=False, allow_nan=False)
    (directory / SUMMARY).write_text(text + "\n", encoding="utf-8")
    _write_table(directory / ALIGNMENT, _alignment(done))
    _write_table(directory / FLIGHT, _flight(done))
    draw(done, figures)


def _alignment(done: Experiment) -> dict[str, Array]:
    aligned = done.alignment
    tables = {"error": aligned.error_rad / UNITS, "sigma": aligned.sigma_rad / UNITS}
    columns = {f"{what}_{name}": table[:, i] for what, table in tables.items() for i, name in enumerate(ANGLES)}
    return {"t_s": aligned.times_s} | columns


def _flight(done: Experiment) -> dict[str, Array]:
    """Return true positions, and errors and standard deviations of position, velocity and attitude."""
    flight, names = done.flight, (*LENGTHS, *ANGLES)
    lat_rad, lon_rad, height_m = flight.place.T
    place = {"true_lat_deg": np.degrees(lat_rad), "true_lon_deg": np.degrees(lon_rad), "true_height_m": height_m}
    units = np.concatenate((np.ones(len(LENGTHS)), UNITS))
    tables = {"error": flight.errors / units, "sigma": flight.sigmas / units}
    columns = {f"{what}_{name}": table[:, i] for what, table in tables.items() for i, name in enumerate(names)}
    return {"t_s": flight.times_s} | place | columns


def _write_table(path: Path, columns: Mapping[str, Array]) -> None:
    pq.write_table(pa.table(dict(columns)), path)
