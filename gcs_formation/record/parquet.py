"""The time series as a Parquet file: one row per vehicle and control tick (docs/timeseries.md).

Apart from the rows as they are recorded, because importing pyarrow takes longer than many a flight.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from flight_model.arrays import Array
from gcs_formation.record.timeseries import FLAGS, PHASES, ROWS_AT_ONCE

SAMPLED_TICKS = 16
NOISE_SHARE = 0.85
"""Sampled at a quarter and three quarters of the ticks; a column that stays larger than this share isn't compressed."""


def write_parquet(path: Path, tables: Iterable[Mapping[str, Array]]) -> None:
    """Write a time series from tables of a spool's columns, of successive ticks, at least one; phases become words.

    Columns are (N,), or (T, V) with the vehicles of a tick beside each other. Dictionaries and statistics are omitted:
    for measured numbers they cost time and space without use.
    """
    words: Any = ["phase"]  # pyarrow's stubs know no list here
    phases = pa.array(PHASES, pa.string())
    with ExitStack() as stack:
        writer: pq.ParquetWriter | None = None
        for each in tables:
            columns = {name: column.ravel() for name, column in each.items()}
            arrays: dict[str, Any] = {
                name: _arrow(column, flag=_is_flag(name, column)) for name, column in columns.items()
            }
            arrays["phase"] = pa.DictionaryArray.from_arrays(_arrow(columns["phase"].astype(np.int8)), phases)
            schema = pa.schema([pa.field(name, array.type, nullable=False) for name, array in arrays.items()])
            if writer is None:
                packed: Any = _compression(columns)
                opened = pq.ParquetWriter(
                    path,
                    schema,
                    use_dictionary=words,
                    write_statistics=False,
                    compression=packed,
                    store_schema=False,  # phases are then read back as text, not as Arrow's dictionary type
                    write_batch_size=ROWS_AT_ONCE,
                )
                writer = stack.enter_context(opened)
            writer.write_table(pa.table(arrays, schema=schema))


def _compression(columns: Mapping[str, Array]) -> dict[str, str]:
    """Return each column's compression: none for those whose sample hardly shrinks, because it is noise."""
    t_s = columns["t_s"]
    rows = int(np.count_nonzero(t_s == t_s[:1]))
    ticks = t_s.size // max(1, rows)
    slices = [slice(begin * rows, (begin + SAMPLED_TICKS) * rows) for begin in (ticks // 4, 3 * ticks // 4)]
    found: dict[str, str] = {}
    for name, column in columns.items():
        some = b"".join([column[part].tobytes() for part in slices])
        noise = some and len(pa.compress(some, "lz4_raw", asbytes=True)) > NOISE_SHARE * len(some)
        found[name] = "none" if noise else "lz4"
    return found


def _is_flag(name: str, column: npt.NDArray[Any]) -> bool:
    return name in FLAGS or column.dtype == np.bool_


def _arrow(column: npt.NDArray[Any], *, flag: bool = False) -> pa.Array[Any]:
    """Return an Arrow array of numbers or flags; `pa.array` would import numpy.ma."""
    data = np.packbits(column > 0, bitorder="little") if flag else np.ascontiguousarray(column)
    kind: Any = pa.bool_() if flag else pa.from_numpy_dtype(column.dtype)
    return pa.Array.from_buffers(kind, column.size, [None, pa.py_buffer(data.data)])


def read_parquet(path: Path) -> dict[str, Array]:
    """Return the columns of a time series, with phases as indices into `PHASES`."""
    table = pq.read_table(path)
    columns = {name: table.column(name).to_numpy() for name in table.column_names}
    if "phase" in columns:
        numbers = {name: number for number, name in enumerate(PHASES)}
        columns["phase"] = np.array([numbers.get(str(name), -1) for name in columns["phase"]], dtype=np.float64)
    return columns
