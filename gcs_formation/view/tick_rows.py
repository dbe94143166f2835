"""Ticks of a run as rows for the page: from the spool of a flight that is under way, or from its time series."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from airlink.endpoint import VehicleId
from flight_model.arrays import Array, Indices, offset_points
from formation_scenario.fields import Frame
from formation_scenario.slot_frame import axis_rad
from gcs_formation.record.timeseries import ERROR, LAW_ERROR, PHASES, TRUTH, VIRTUAL_LEADER
from gcs_formation.record.timeseries import SLOT as SLOT_FRU
from gcs_formation.view.recording import (
    COLUMN,
    COLUMNS,
    FLAGS,
    LINK,
    POSITION,
    RADIO,
    SETPOINT,
    SLOT,
    STATE,
    Rows,
    Times,
)

NUMBER_BYTES = 8
MAX_VALUES = 200e6
"""Values of a time series in memory; of a longer one every second tick is kept, and so on."""
TRUE = dict(zip((*POSITION, "airspeed_mps", "heading_rad"), TRUTH[:5], strict=True))
TIMES = ("t_s", "mission_time_s", "phase")
DIRECT = (*STATE, *SETPOINT, *LINK, *FLAGS)


def as_rows(columns: Mapping[str, Array], frame: Frame) -> Rows:
    """Return a run's columns (T, V) as rows; true values and errors where there are some, else those of the law."""
    first = next(iter(columns.values()))
    rows = np.full((*first.shape, len(COLUMNS)), np.nan, dtype=np.float32)
    for name in DIRECT:
        rows[:, :, COLUMN[name]] = columns[TRUE.get(name, name)] if TRUE.get(name) in columns else columns[name]
    for name in RADIO:
        if name in columns:
            rows[:, :, COLUMN[name]] = columns[name]
    for name, law in zip(ERROR, LAW_ERROR, strict=True):
        rows[:, :, COLUMN[name]] = columns[name] if name in columns else columns[law]
    for name, values in zip(SLOT, _slots(columns, frame), strict=True):
        rows[:, :, COLUMN[name]] = values
    return rows


def _slots(columns: Mapping[str, Array], frame: Frame) -> tuple[Array, Array, Array]:
    """Return where each slot is, north, east and height, (T, V): NaN for the leader and without one."""
    north, east, height, heading = (
        columns[TRUE[name] if TRUE[name] in columns else name] for name in (*POSITION, "heading_rad")
    )
    if VIRTUAL_LEADER[0] in columns:
        leader = [columns[name] for name in VIRTUAL_LEADER]
    else:
        leading = (columns["leads"] > 0).argmax(axis=1)[:, np.newaxis]
        leader = [np.take_along_axis(each, leading, axis=1) for each in (north, east, height, heading)]
    forward, right, up = (columns[name] for name in SLOT_FRU)
    axis = axis_rad(frame, leader[3] + 0.0 * heading, heading)
    slot_north, slot_east = offset_points(leader[0], leader[1], axis, forward, right)
    return slot_north, slot_east, leader[2] + up


class SpoolTicks:
    """The ticks of one of a run's spool files, which may still grow."""

    def __init__(self, path: Path, order: Sequence[VehicleId], frame: Frame) -> None:
        """Open the file; rows are in `order`.

        Raises:
            OSError: it can't be read.
            ValueError: it isn't a spool, or one of other vehicles.
        """
        self._frame = frame
        with path.open("rb") as file:
            line = file.readline()
            self._begin = file.tell()
        head = json.loads(line)
        self._names: list[str] = head["values"]
        own = [VehicleId(*each) for each in head["vehicles"]]
        self._columns = [own.index(each) for each in order]
        self._vehicles = len(own)
        self._table = np.empty((0, self._vehicles, len(self._names)))
        self.times = Times(np.empty(0), np.empty(0), np.empty(0))

    def poll(self, path: Path) -> bool:
        """Look for new ticks where the file is now; return whether there are some. One that is gone stays as it was."""
        size_bytes = NUMBER_BYTES * len(self._names) * self._vehicles
        try:
            count = (path.stat().st_size - self._begin) // size_bytes
        except FileNotFoundError:
            return False
        before = len(self._table)
        if count <= before:
            return False
        self._table = np.memmap(path, "<f8", "r", self._begin, (count, self._vehicles, len(self._names)))
        new = self._table[before:, 0][:, [self._names.index(name) for name in TIMES]].T
        self.times = Times(*(np.concatenate(pair) for pair in zip(self.times, new, strict=True)))
        return True

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks."""
        values = np.asarray(self._table[ticks])[:, self._columns]
        return as_rows(dict(zip(self._names, np.moveaxis(values, -1, 0), strict=True)), self._frame)


class SeriesTicks:
    """The ticks of a finished run's time series."""

    def __init__(self, path: Path, order: Sequence[VehicleId], frame: Frame) -> None:
        """Read the columns that the page shows.

        Raises:
            OSError, ValueError: it can't be read.
        """
        file = pq.ParquetFile(path)
        known = set(file.schema_arrow.names)
        wanted = {
            *DIRECT,
            *RADIO,
            *ERROR,
            *LAW_ERROR,
            *SLOT_FRU,
            *TRUE.values(),
            *VIRTUAL_LEADER,
            *TIMES,
            "network",
            "vehicle",
        }
        count, ticks, rows = len(order), list[Times](), list[Rows]()
        every = 1 + int(file.metadata.num_rows * len(COLUMNS) / MAX_VALUES)
        left: dict[str, Array] = {}
        for batch in file.iter_batches(batch_size=2**16, columns=sorted(wanted & known)):
            block = {name: _numbers(batch.column(name)) for name in batch.schema.names}
            block = {name: np.concatenate([left[name], values]) if left else values for name, values in block.items()}
            whole = block["t_s"].size // count * count
            left = {name: values[whole:] for name, values in block.items()}
            if whole:
                grid = {name: values[:whole].reshape(-1, count)[::every] for name, values in block.items()}
                own = list(zip(grid.pop("network")[0], grid.pop("vehicle")[0], strict=True))
                columns = [own.index((each.network, each.system)) for each in order]
                ticks.append(Times(*(grid[name][:, 0] for name in TIMES)))
                rows.append(as_rows({name: values[:, columns] for name, values in grid.items()}, frame))
        self.times = (
            Times(*(np.concatenate(each) for each in zip(*ticks, strict=True))) if ticks else Times(*np.empty((3, 0)))
        )
        self._rows = np.concatenate(rows) if rows else np.empty((0, count, len(COLUMNS)), dtype=np.float32)

    def poll(self, _: Path) -> bool:
        """Return False: it is finished."""
        return False

    def rows(self, ticks: Indices) -> Rows:
        """Return the rows of some ticks."""
        return self._rows[ticks]


def _numbers(column: Any) -> Array:  # noqa: ANN401 - an array of Arrow's, of whatever type
    """Return a column as numbers; phases by their index in `PHASES`."""
    array = column.dictionary_decode() if isinstance(column, pa.DictionaryArray) else column
    if pa.types.is_string(array.type):
        indices = {name: index for index, name in enumerate(PHASES)}
        return np.array([indices.get(str(name), -1) for name in array.to_pylist()], dtype=np.float64)
    return np.asarray(array.to_numpy(zero_copy_only=False), dtype=np.float64)
