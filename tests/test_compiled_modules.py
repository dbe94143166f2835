"""What mypyc asks of compiled modules, read from their source: a compiled build shows it in flight, minutes later."""

from __future__ import annotations

import ast
import re
import runpy
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = "airlink", "flight_model", "formation_scenario", "gcs_formation", "sim_vehicles"
OPEN = "allow_interpreted_subclasses"
DERIVED = re.compile(r"^class \w+(\[.*\])?\(", re.MULTILINE)


@cache
def tree_of(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text("utf-8"))


def with_derived_classes() -> set[str]:
    """Return the paths of modules with a class that has a base."""
    files = (file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return {file.relative_to(ROOT).as_posix() for file in files if DERIVED.search(file.read_text("utf-8"))}


@cache
def compiled() -> frozenset[str]:
    """Return the paths of compiled modules."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"]["wheel"]
    listed = runpy.run_path(str(ROOT / "hatch_build.py"))["listed"]
    return frozenset(listed(ROOT, settings["hooks"]["custom"]["modules"]))


def imported(tree: ast.Module) -> dict[str, tuple[str, str]]:
    """Return the path of the module and the name in it of each name that a module imports from another of ours."""
    froms = [each for each in tree.body if isinstance(each, ast.ImportFrom) and each.module]
    return {
        name.asname or name.name: (f"{each.module.replace('.', '/')}.py", name.name)
        for each in froms
        if each.module is not None
        for name in each.names
    }


def classes(tree: ast.Module) -> dict[str, ast.ClassDef]:
    return {each.name: each for each in tree.body if isinstance(each, ast.ClassDef)}


def closed_bases(path: str) -> Iterator[str]:
    """Yield the classes of an interpreted module that inherit from a compiled class which isn't open to them."""
    names = imported(tree_of(path))
    for made in classes(tree_of(path)).values():
        for base in made.bases:
            where, name = names.get(base.id, ("", "")) if isinstance(base, ast.Name) else ("", "")
            found = classes(tree_of(where)).get(name) if where in compiled() else None
            if found is not None and not any(OPEN in ast.unparse(each) for each in found.decorator_list):
                plain = {ast.unparse(each) for each in found.bases} & {"NamedTuple", "Enum", "IntEnum", "Protocol"}
                if not plain and not name.endswith("Error"):
                    yield f"{path}: {made.name}({name})"


def test_no_interpreted_class_inherits_from_a_compiled_one_that_isnt_open_to_it() -> None:
    """TypeError where the first object is made: interpreted classes cannot inherit from compiled."""
    assert len(compiled()) > 100
    assert [found for path in sorted(with_derived_classes() - compiled()) for found in closed_bases(path)] == []


def test_no_constant_is_a_pair_or_more_of_floats_without_a_type() -> None:
    """NameError where it is read: value for final name was not set. `Final[tuple[float, ...]]` is set."""
    found = [
        f"{path}:{each.lineno}: {ast.unparse(each.target)}"
        for path in sorted(compiled())
        for each in tree_of(path).body
        if isinstance(each, ast.AnnAssign)
        and ast.unparse(each.annotation) == "Final"
        and isinstance(each.value, ast.Tuple)
        and any(isinstance(part, ast.Constant) and isinstance(part.value, float) for part in each.value.elts)
    ]
    assert found == []
