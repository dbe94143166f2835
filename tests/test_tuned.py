"""A tuned number is multiplied where it is defined, and what is computed from it changes with it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from benchmarks.tuned import Finder, Loader, multiplied

SOURCE = """
from typing import Final

ROOM_M: Final = 2.0
TWICE_M = 2 * ROOM_M
COUNT, SHARES = 7, (0.25, 0.5)
"""


@pytest.mark.parametrize(
    ("value", "factor", "expected"),
    [(2.0, 0.5, 1.0), (7, 0.5, 4), (1, 0.1, 1), ((0.25, 0.5), 2.0, (0.5, 1.0)), ([1.0, 4], 3.0, [3.0, 12])],
)
def test_whole_numbers_stay_whole_and_each_of_several_is_multiplied(value, factor, expected) -> None:
    found = multiplied(value, factor)
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize(
    ("number", "expected"),
    [
        ("ROOM_M", (6.0, 12.0, 7, (0.25, 0.5))),
        ("COUNT", (2.0, 4.0, 21, (0.25, 0.5))),
        ("SHARES", (2.0, 4.0, 7, (0.75, 1.5))),
    ],
)
def test_one_number_of_a_module_is_multiplied_and_what_follows_from_it(number: str, expected, tmp_path: Path) -> None:
    file = tmp_path / "rule.py"
    file.write_text(SOURCE)
    loader = Loader("rule", str(file))
    loader.number, loader.factor = number, 3.0
    spec = importlib.util.spec_from_loader("rule", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    assert expected == (module.ROOM_M, module.TWICE_M, module.COUNT, module.SHARES)


def test_only_the_module_of_the_number_is_loaded_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rule_of_a_test.py").write_text(SOURCE)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    finder = Finder("rule_of_a_test", "ROOM_M", 2.0)
    spec = finder.find_spec("rule_of_a_test", None)
    assert spec is not None
    assert isinstance(spec.loader, Loader)
    assert finder.find_spec("json", None) is None
