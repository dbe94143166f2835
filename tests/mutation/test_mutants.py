"""Mutants have one fault each, where it decides something, and are loaded in their module's place."""

import ast
import sys
from importlib import import_module
from pathlib import Path

import pytest

import flight_model
from flight_model import earth
from tests.mutation.imports import Imports, name_of
from tests.mutation.mutant import Finder, mutants

SOURCE = '''
"""A module."""
from typing import Final

LIMIT: Final[int] = 3


def near(a: float, b: float) -> bool:
    """Return whether they are near each other."""
    if a is b:
        raise ValueError(f"found {a + 1}")
    return abs(a - b) < LIMIT and a > -b
'''


def changed(tmp_path: Path) -> list[str]:
    file = tmp_path / "module.py"
    file.write_text(SOURCE)
    found = mutants(file)
    before = ast.unparse(ast.parse(SOURCE)).split("\n")
    lines = [ast.unparse(ast.parse(_after(each.instead, each.index))).split("\n") for each in found]
    return [" | ".join(new for old, new in zip(before, after, strict=True) if old != new).strip() for after in lines]


def _after(instead: ast.AST, index: int) -> str:
    tree = ast.parse(SOURCE)
    old = list(ast.walk(tree))[index]

    class Replacing(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return instead if node is old else self.generic_visit(node)

    return ast.unparse(ast.fix_missing_locations(Replacing().visit(tree)))


def test_a_fault_is_made_wherever_the_module_decides_something_and_nowhere_else(tmp_path: Path) -> None:
    assert sorted(changed(tmp_path)) == sorted(
        [
            "LIMIT: Final[int] = 4",
            "LIMIT: Final[int] = 6",
            "if a is not b:",
            "if not a is b:",
            "return None",
            "return abs(a - b) < LIMIT or a > -b",
            "return a > -b",
            "return abs(a - b) < LIMIT",
            "return abs(a - b) <= LIMIT and a > -b",
            "return abs(a - b) >= LIMIT and a > -b",
            "return abs(a - b) < LIMIT and a >= -b",
            "return abs(a - b) < LIMIT and a <= -b",
            "return abs(a + b) < LIMIT and a > -b",
            "return abs(a - b) < LIMIT and a > b",
        ]
    )


def test_a_mutant_is_loaded_in_its_modules_place(monkeypatch: pytest.MonkeyPatch) -> None:
    file = Path(earth.__file__)
    from_line = earth.air_density_kgm3.__code__.co_firstlineno
    mutant = next(each for each in mutants(file) if each.words.endswith("return None") and each.line > from_line)
    monkeypatch.delitem(sys.modules, earth.__name__)
    monkeypatch.setattr(flight_model, "earth", earth)  # and so again after the test
    monkeypatch.setattr(sys, "meta_path", [Finder(mutant), *sys.meta_path])
    changed = import_module(earth.__name__)
    assert name_of(file) == earth.__name__ == changed.__name__
    assert earth.air_density_kgm3(0.0) == pytest.approx(1.225)
    assert changed.air_density_kgm3(0.0) is None


def test_what_needs_a_module_is_loaded_again_with_it_and_nothing_else() -> None:
    imports = Imports(["gcs_formation/control", "gcs_formation/estimation"])
    need = imports.that_need("gcs_formation.control.fuzzy_pid")
    assert {"gcs_formation.control.fuzzy_pid", "gcs_formation.control.follower"} <= need
    assert not need & {"gcs_formation.estimation.airspeed", "gcs_formation.estimation.kalman"}
