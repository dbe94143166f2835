import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gcs_formation.report.style import evenly, extremes

SERIES = hnp.arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6) | st.just(np.nan))
BUCKETS = st.integers(1, 60)


@given(SERIES, BUCKETS)
def test_every_piece_keeps_its_extremes(values, buckets):
    kept = extremes(values, buckets)
    width = -(-values.size // buckets)
    for begin in range(0, values.size, width):
        piece = values[begin : begin + width]
        mine = values[kept[(kept >= begin) & (kept < begin + width)]]
        known = piece[np.isfinite(piece)]
        if known.size:
            assert np.nanmin(mine) == known.min()
            assert np.nanmax(mine) == known.max()
        assert np.isnan(mine).any() == np.isnan(piece).any()


@given(SERIES, BUCKETS)
def test_what_is_kept_is_in_order_and_few(values, buckets):
    kept = extremes(values, buckets)
    assert (np.diff(kept) > 0).all()
    assert (kept[0], kept[-1]) == (0, values.size - 1)
    assert kept.size <= max(2 * buckets, 3 * buckets + 2)


@given(st.integers(1, 1000), st.integers(2, 100))
def test_evenly_keeps_both_ends(size, count):
    kept = evenly(size, count)
    assert (kept[0], kept[-1]) == (0, size - 1)
    assert kept.size == min(size, count)
