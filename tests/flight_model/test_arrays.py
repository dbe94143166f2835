"""Columns from rows, independent of how rows are split into blocks; and positions alongside others."""

from __future__ import annotations

import numpy as np
import pytest

from flight_model.arrays import BLOCK_BYTES, columns_of, offset_points


@pytest.mark.parametrize("width", [1, 12, 45, BLOCK_BYTES])
@pytest.mark.parametrize("over", [-1, 0, 1])
def test_columns_hold_the_rows_numbers_each_in_one_piece(width, over):
    block = max(1, BLOCK_BYTES // (8 * width))
    rows = np.arange((2 * block + over) * width, dtype=np.float64).reshape(-1, width)
    columns = columns_of(rows)
    assert (columns == rows.T).all()
    assert all(column.flags.c_contiguous for column in columns)


def test_columns_of_several_vehicles_keep_a_row_for_each_moment():
    rows = np.arange(30.0).reshape(5, 2, 3)
    assert (columns_of(rows) == [rows[..., number] for number in range(3)]).all()


def test_no_rows_are_columns_without_numbers():
    assert columns_of(np.empty((0, 3))).shape == (3, 0)


def test_right_of_who_heads_east_is_south():
    north_m, east_m = offset_points(100.0, 200.0, np.array([0.0, np.pi / 2]), 10.0, 5.0)
    assert north_m == pytest.approx([110.0, 95.0])
    assert east_m == pytest.approx([205.0, 210.0])
