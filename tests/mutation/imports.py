"""What the project's modules import, read from their texts; not what functions import when they are called."""

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from tests.mutation.faults import is_type_checking

ROOT = Path(__file__).parents[2]


def name_of(file: Path) -> str:
    """Return the name of a file's module."""
    parts = file.resolve().relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


class Imports:
    """Which module imports which."""

    def __init__(self, folders: Sequence[str] = ("[!.]*",)) -> None:
        """Read the modules of folders, by default of all."""
        files = [file for folder in folders for file in ROOT.glob(f"{folder}/**/*.py")]
        known = {name_of(file): file for file in files}
        self._of = {name: _read(name, file, known) for name, file in known.items()}

    def needed_by(self, names: Iterable[str]) -> set[str]:
        """Return these modules and all that they import, directly or not."""
        return _closed(set(names), lambda name: self._of.get(name, set()))

    def that_need(self, name: str) -> set[str]:
        """Return a module and all that import it, directly or not."""
        return _closed({name}, lambda one: {other for other, imported in self._of.items() if one in imported})


def _read(name: str, file: Path, known: Mapping[str, Path]) -> set[str]:
    found = {name.rpartition(".")[0]}
    for node in _run_on_import(ast.parse(file.read_text())):
        match node:
            case ast.Import(names=names):
                found |= {each.name for each in names}
            case ast.ImportFrom(module=str(module), names=names):
                found |= {module, *(f"{module}.{each.name}" for each in names)}
    return found & known.keys()


def _run_on_import(node: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.Lambda) and not (
            isinstance(child, ast.If) and is_type_checking(child.test)
        ):
            yield child
            yield from _run_on_import(child)


def _closed(names: set[str], after: Callable[[str], set[str]]) -> set[str]:
    new = names
    while new:
        new = {found for name in new for found in after(name)} - names
        names = names | new
    return names
