"""The smallest delays, and how far from them shares of the others lie, without sorting all."""

from hypothesis import given
from hypothesis import strategies as st
from librt.vecs import vec

from gcs_formation.link.delay_edges import ranked


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=80), st.data())
def test_a_value_of_a_rank_is_that_of_the_sorted_list_and_smaller_ones_move_to_its_left(
    delays_s: list[float], data: st.DataObject
) -> None:
    count = data.draw(st.integers(1, len(delays_s)))
    rank = data.draw(st.integers(0, count - 1))
    values = vec[float](delays_s)
    assert ranked(values, count, rank) == sorted(delays_s[:count])[rank]
    assert sorted(list(values)[:count]) == sorted(delays_s[:count])
    assert list(values)[count:] == delays_s[count:]
    assert all(each <= values[rank] for each in list(values)[:rank])
