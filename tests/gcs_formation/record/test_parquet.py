"""A time series as a Parquet file is read back as it was written, with phases as words and flags as truths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from gcs_formation.record.parquet import read_parquet, write_parquet
from gcs_formation.record.timeseries import FLAGS, PHASES


def test_tables_of_successive_ticks_are_one_file_of_rows(tmp_path: Path) -> None:
    """Two vehicles: columns (T, V) are written tick by tick."""
    draws, flag, file = np.random.default_rng(1), next(iter(FLAGS)), tmp_path / "series.parquet"
    tables = [
        {
            "t_s": np.repeat(np.arange(50.0)[:, None] + 50.0 * number, 2, axis=1),
            "phase": np.full((50, 2), float(number)),
            "north_m": draws.standard_normal((50, 2)),
            flag: (draws.random((50, 2)) < 0.5).astype(float),
        }
        for number in range(2)
    ]
    write_parquet(file, tables)
    found = read_parquet(file)
    for name in tables[0]:
        np.testing.assert_array_equal(found[name], np.concatenate([each[name].ravel() for each in tables]))
    phases = pq.read_table(file).column("phase").to_pylist()
    assert phases == [PHASES[0]] * 100 + [PHASES[1]] * 100
    assert pq.read_table(file).schema.field(flag).type == pa.bool_()


def test_a_phase_of_another_version_is_none_of_ours(tmp_path: Path) -> None:
    file = tmp_path / "series.parquet"
    pq.write_table(pa.table({"t_s": [0.0, 0.1], "phase": [PHASES[1], "hovering upside down"]}), file)
    assert read_parquet(file)["phase"].tolist() == [1.0, -1.0]


def compressions(file: Path) -> dict[str, str]:
    group = pq.ParquetFile(file).metadata.row_group(0)
    return {group.column(n).path_in_schema: group.column(n).compression for n in range(group.num_columns)}


def test_columns_of_noise_are_not_compressed_and_others_are(tmp_path: Path) -> None:
    """Judged by ticks at a quarter and at three quarters of the first table: what comes elsewhere doesn't matter."""
    draws, ticks, vehicles = np.random.default_rng(2), 400, 3
    shape = (ticks, vehicles)
    tick = np.arange(ticks)[:, None] * np.ones(vehicles)
    noise, at_quarter = draws.standard_normal(shape), (tick >= 100) & (tick < 116)
    at_three_quarters = (tick >= 300) & (tick < 316)
    table: dict[str, Any] = {
        "t_s": tick,
        "phase": np.zeros(shape),
        "noise": noise,
        "level": np.full(shape, 2.5),
        "elsewhere": np.where(at_quarter | at_three_quarters, 0.0, noise),
        "there": np.where(at_quarter | at_three_quarters, noise, 0.0),
        "half": np.where(at_quarter, noise, 0.0),
    }
    file = tmp_path / "series.parquet"
    write_parquet(file, [table])
    found = compressions(file)
    assert {name for name, each in found.items() if each == "UNCOMPRESSED"} == {"noise", "there"}
    assert found["level"] == found["elsewhere"] == found["half"] == found["t_s"] == "LZ4"
    for name, values in table.items():
        np.testing.assert_array_equal(read_parquet(file)[name], values.ravel(), err_msg=name)


def test_columns_have_types_of_their_own_and_nothing_that_measured_numbers_have_no_use_for(tmp_path: Path) -> None:
    """Words only of phases; flags are truths, by their names or as they are given."""
    file = tmp_path / "series.parquet"
    flags = {name: np.array([1.0, 0.0, 1.0]) for name in FLAGS}
    whole: dict[str, Any] = {
        "t_s": np.zeros(3),
        "vehicle": np.array([1, 2, 3], dtype=np.int32),
        "phase": np.array([4.0, 1.0, 2.0]),
    }
    write_parquet(file, [whole | flags | {"healthy": np.array([True, False, False])}])
    schema = pq.read_schema(file)
    kinds = {name: schema.field(name).type for name in schema.names}
    assert kinds == {"t_s": pa.float64(), "vehicle": pa.int32(), "phase": pa.string(), "healthy": pa.bool_()} | (
        dict.fromkeys(FLAGS, pa.bool_())
    )
    assert not any(schema.field(name).nullable for name in schema.names)
    table = pq.read_table(file)
    assert table.column("phase").to_pylist() == [PHASES[4], PHASES[1], PHASES[2]]
    assert table.column("healthy").to_pylist() == [True, False, False]
    assert all(table.column(name).to_pylist() == [True, False, True] for name in FLAGS)
    group = pq.ParquetFile(file).metadata.row_group(0)
    assert not any(group.column(n).is_stats_set for n in range(group.num_columns))
    worded = {
        group.column(n).path_in_schema
        for n in range(group.num_columns)
        if "RLE_DICTIONARY" in group.column(n).encodings
    }
    assert worded == {"phase"}


def test_flags_of_any_number_of_rows_are_packed_in_their_order(tmp_path: Path) -> None:
    draws, flag = np.random.default_rng(3), next(iter(FLAGS))
    for rows in (1, 7, 8, 9, 1000):
        values = (draws.random(rows) < 0.5).astype(float)
        common: dict[str, Any] = {"t_s": np.arange(rows) * 0.1, "phase": np.zeros(rows)}
        write_parquet(tmp_path / "series.parquet", [common | {flag: values}])
        np.testing.assert_array_equal(read_parquet(tmp_path / "series.parquet")[flag], values)
