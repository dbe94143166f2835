"""A time series as a Parquet file is read back as it was written, with phases as words and flags as truths."""

from __future__ import annotations

from pathlib import Path

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
