from hypothesis import given
from hypothesis import strategies as st

from gcs_formation.app.result_text import ColumnGroup, line, table, wrapped

PARTS = (("t 12 of 120 s", "t 12 s"), ("worst error 0.01 / 0.02 / 0.00 m", "error 0.02 m"), ("4 links",))
GROUPS = (
    ColumnGroup(("vehicle", "max x"), [("2", "0.01"), ("1:254", "1234.56")], keep=3),
    ColumnGroup(("rms x",), [("0.00",), ("–",)], keep=1),
    ColumnGroup(("settled s",), [("3.1",), ("–",)], keep=2),
)


def test_a_line_leaves_out_the_last_parts_first_and_never_half_a_word():
    assert line(PARTS, 80) == "t 12 of 120 s  worst error 0.01 / 0.02 / 0.00 m  4 links"
    assert line(PARTS, 40) == "t 12 of 120 s  error 0.02 m  4 links"
    assert line(PARTS, 30) == "t 12 s  error 0.02 m  4 links"
    assert line(PARTS, 20) == "t 12 s  error 0.02 m"
    assert line(PARTS, 10) == "t 12 s"


def test_a_table_leaves_out_the_groups_that_matter_least():
    assert table(GROUPS, 80) == [
        "vehicle    max x  rms x  settled s",
        "2           0.01   0.00        3.1",
        "1:254    1234.56      –          –",
    ]
    assert table(GROUPS, 30)[0] == "vehicle    max x  settled s"
    assert table(GROUPS, 5)[0] == "vehicle    max x"


@given(st.integers(1, 120))
def test_nothing_is_wider_than_the_terminal_but_for_single_words(width: int):
    text = "expect vehicle 2: error_x_m.max from 60 s to 120 s: found 0.0213; expected: below 2: held"
    lines = wrapped(text, width)
    assert " ".join(" ".join(lines).split()) == text
    assert all(len(each) <= width or " " not in each.strip() for each in lines)
    assert len(line(PARTS, width)) <= width
