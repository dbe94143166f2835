"""What is read back from a record: the first value that doesn't fit is named, with its place and what is expected."""

from __future__ import annotations

from typing import Any

import pytest

from gcs_formation.record.json_shape import (
    ANYTHING,
    INTEGER,
    MAX_LETTERS,
    NUMBER,
    NUMBER_OR_NULL,
    TEXT,
    TRUTH_OR_NULL,
    Each,
    Maybe,
    Shape,
    mismatch,
)

SHAPE: Shape = {
    "name": TEXT,
    "count": INTEGER,
    "figures": Each({"value": NUMBER_OR_NULL, "held": TRUTH_OR_NULL}),
    "note": Maybe(TEXT),
    "any": Maybe(ANYTHING),
}
FITS = {"name": "run", "count": 3, "figures": [{"value": 1, "held": None}, {"value": None, "held": True}], "more": []}


def test_keys_that_arent_named_and_optional_ones_that_are_missing_dont_matter() -> None:
    assert mismatch(FITS, SHAPE, "summary.json") is None
    assert mismatch(FITS | {"note": "", "any": [1]}, SHAPE, "summary.json") is None
    assert mismatch(FITS | {"figures": {"error": {"value": 0.5, "held": False}}}, SHAPE, "summary.json") is None


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"name": 5}, "found 5 for name in f; expected: a text"),
        ({"count": 3.0}, "found 3.0 for count in f; expected: an integer"),
        ({"count": True}, "found true for count in f; expected: an integer"),
        ({"figures": 1}, "found 1 for figures in f; expected: an object or an array"),
        ({"figures": [[]]}, "found [] for figures.0 in f; expected: an object"),
        ({"figures": [{"value": 1, "held": 0}]}, "found 0 for figures.0.held in f; expected: true, false or null"),
        ({"figures": {"x": {"value": True, "held": None}}}, "found true for figures.x.value in f; expected: a number"),
        ({"figures": {"x": {"value": 1}}}, "found no figures.x.held in f; expected: true, false or null"),
        ({"note": None}, "found null for note in f; expected: a text"),
    ],
)
def test_the_first_value_that_doesnt_fit_is_named(changed: dict[str, Any], text: str) -> None:
    assert (mismatch(FITS | changed, SHAPE, "f") or "").startswith(text)


def test_a_key_that_is_missing_is_named_after_others_that_fit() -> None:
    lacks = {name: value for name, value in FITS.items() if name != "figures"}
    assert mismatch(lacks, SHAPE, "f") == "found no figures in f; expected: an object or an array"
    assert mismatch([], SHAPE, "f") == "found [] in f; expected: an object"


def test_long_values_are_shown_by_their_beginning() -> None:
    text = mismatch("x" * 100, NUMBER, "f")
    assert text == f'found "{"x" * (MAX_LETTERS - 1)}… in f; expected: a number'
