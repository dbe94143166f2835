"""A mutant: a module with one fault, found in its file, compiled, and loaded in its place."""

import ast
import copy
import importlib.abc
import importlib.machinery
import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

from tests.mutation.faults import faults, left_alone
from tests.mutation.imports import name_of

MAX_SHOWN = 70
"""Characters of a node's text."""


@dataclass(frozen=True)
class Mutant:
    """A fault: a node of a file's syntax tree, and what stands there instead."""

    file: Path
    index: int
    """Of the node among those of `ast.walk`."""
    instead: ast.AST
    line: int
    words: str

    def __str__(self) -> str:
        """Return where it is, and what was changed to what."""
        return f"{self.file}:{self.line}  {self.words}"

    def compiled(self) -> CodeType:
        """Return the module with the fault."""
        tree = ast.parse(self.file.read_text())
        old = list(ast.walk(tree))[self.index]
        for parent in ast.walk(tree):
            for name, value in ast.iter_fields(parent):
                if value is old:
                    setattr(parent, name, self.instead)
                elif isinstance(value, list) and any(each is old for each in value):
                    setattr(parent, name, [self.instead if each is old else each for each in value])
        return compile(ast.fix_missing_locations(tree), str(self.file), "exec")


def mutants(package: Path) -> list[Mutant]:
    """Return all mutants of a package's modules, or of a file, in a fixed order."""
    found = list[Mutant]()
    for file in [package] if package.is_file() else sorted(package.rglob("*.py")):
        tree = ast.parse(file.read_text())
        without = left_alone(tree)
        for i, node in enumerate(ast.walk(tree)):
            for instead in () if node in without else faults(node):
                words = f"{_shown(node)}  ->  {_shown(instead)}"
                found.append(Mutant(file, i, instead, getattr(node, "lineno", 0), words))
    return found


def _shown(node: ast.AST) -> str:
    text = ast.unparse(ast.fix_missing_locations(copy.deepcopy(node))).split("\n")[0]
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads a mutant where its module is imported."""

    def __init__(self, mutant: Mutant) -> None:
        """Stand in `sys.meta_path` before all others."""
        self._mutant, self._name = mutant, name_of(mutant.file)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return how the mutant is loaded, None for all other modules."""
        if fullname != self._name:
            return None
        file = self._mutant.file
        inside = [str(file.parent)] if file.stem == "__init__" else None
        return importlib.util.spec_from_file_location(fullname, file, loader=self, submodule_search_locations=inside)

    def exec_module(self, module: ModuleType) -> None:
        """Run the module with its fault."""
        exec(self._mutant.compiled(), module.__dict__)
