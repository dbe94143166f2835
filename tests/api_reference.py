"""Writes docs/api.md, the reference of what is public in Python, from signatures and docstrings in the sources.

python -m tests.api_reference > docs/api.md
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from inspect import cleandoc
from pathlib import Path

ROOT = Path(__file__).parents[1]
MODULES = (
    "gcs_formation",
    "gcs_formation.library",
    "gcs_formation.extend",
    "gcs_formation.stability",
    "gcs_formation.control",
    "formation_scenario",
)
"""Modules whose `__all__` is public."""
HEAD = """# Python reference

Written from docstrings by `python -m tests.api_reference > docs/api.md`; a test compares it. What is listed here is
public: it is changed with a line in the changelog. Everything else may change at any time. How to use it:
[from Python](from-python.md), [extensions](extensions.md), [own law](own-law.md); the fixtures of pytest are in
[testing](testing.md). SI units and radians throughout.
"""
KEYS_ELSEWHERE = ("Scenario", "Vehicle")
"""Classes whose members are a scenario's keys, which docs/scenario.md lists."""
LATER = re.compile(r"Later\[([^\]]*)\]")
"""A type whose schema is built late, which is the type itself to readers."""
SECTIONS = ("Args:", "Returns:", "Raises:", "Yields:")


def source_of(module: str) -> Path:
    """Return the file of a module."""
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def tree_of(module: str) -> ast.Module:
    """Return a module's source, parsed."""
    return ast.parse(source_of(module).read_text(encoding="utf-8"))


def public(module: str) -> list[str]:
    """Return the names in a module's `__all__`."""
    for node in tree_of(module).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return names
    raise ValueError(f"{module} has no __all__")


def definition(module: str, name: str) -> tuple[str, ast.stmt, str | None]:
    """Return the module in which a public name is defined, its definition, and the text below an assignment."""
    body = tree_of(module).body
    imports = [node for node in ast.walk(tree_of(module)) if isinstance(node, ast.ImportFrom)]
    for node, following in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return module, node, None
        if isinstance(node, ast.Assign | ast.AnnAssign) and name in _targets(node):
            return module, node, _text(following)
    for node in imports:
        for alias in node.names:
            if (alias.asname or alias.name) == name and node.module is not None:
                return definition(node.module, alias.name)
    raise ValueError(f"{name} of {module} isn't defined")


def _targets(node: ast.Assign | ast.AnnAssign) -> list[str]:
    return [ast.unparse(each) for each in (node.targets if isinstance(node, ast.Assign) else [node.target])]


def _text(node: ast.stmt | None) -> str | None:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return cleandoc(node.value.value)
    return None


def signature(node: ast.FunctionDef, *, method: bool = False) -> str:
    """Return a function's arguments and what it returns, without `self`."""
    arguments = node.args
    if method:
        arguments.args = arguments.args[1:]
    returned = f" -> {ast.unparse(node.returns)}" if node.returns is not None and node.name != "__init__" else ""
    return f"({ast.unparse(arguments)}){returned}"


def markdown(docstring: str) -> Iterator[str]:
    """Yield a docstring's lines with its sections as lists."""
    section = ""
    for line in docstring.splitlines():
        if line in SECTIONS:
            section = line
            yield from ([f"**{line.removesuffix(':')}**", ""] if line != "Returns:" else [])
        elif not section or not line.strip():
            section = section if line.strip() else ""
            yield line
        elif line.startswith("        "):
            yield f"  {line.strip()}"
        elif section == "Returns:":
            yield f"Returns: {line.strip()}"
        else:
            name, _, said = line.strip().partition(": ")
            yield f"- `{name}`: {said}"


def entry(name: str, node: ast.stmt, text: str | None, home: str) -> Iterator[str]:
    """Yield the lines of a public name."""
    if isinstance(node, ast.FunctionDef):
        yield from (f"### {name}", "", "```python", f"{name}{signature(node)}", "```", "")
        yield from markdown(ast.get_docstring(node) or "")
    elif isinstance(node, ast.ClassDef):
        yield from _class(name, node, home)
    else:
        yield from (f"### {name}", "", "```python", ast.unparse(node), "```", "", *(text or "").splitlines())
    yield ""


def _class(name: str, node: ast.ClassDef, home: str) -> Iterator[str]:
    bases = ", ".join(ast.unparse(each) for each in node.bases)
    made = next((each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__"), None)
    called = f"{name}{signature(made, method=True)}" if made else f"class {name}({bases})" if bases else f"class {name}"
    yield from (f"### {name}", "", "```python", called, "```", "")
    yield from markdown(ast.get_docstring(node) or "")
    if made is not None and (own := ast.get_docstring(made)):
        yield from ("", *markdown(own))
    members = list(_members(node, home))
    if name in KEYS_ELSEWHERE and "Keys" in bases:
        yield from ("", "Its members are the [scenario's keys](scenario.md).")
    elif members:
        yield from ("", "| member | meaning |", "| --- | --- |", *members)


def _members(node: ast.ClassDef, home: str) -> Iterator[str]:
    for each, following in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(each, ast.AnnAssign) and not ast.unparse(each.target).startswith("_"):
            said = _text(following) or _described(each.value, home, node.name, ast.unparse(each.target))
            kind = LATER.sub(r"\1", ast.unparse(each.annotation))
            yield _row(f"{ast.unparse(each.target)}: {kind}", said)
        elif isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
            attribute = any("property" in ast.unparse(decorator) for decorator in each.decorator_list)
            returned = f": {ast.unparse(each.returns)}" if each.returns is not None else ""
            static = any("static" in ast.unparse(decorator) for decorator in each.decorator_list)
            called = f"{each.name}{signature(each, method=not static)}"
            first = (ast.get_docstring(each) or "").partition("\n\n")[0]
            yield _row(f"{each.name}{returned}" if attribute else called, first)


def _described(value: ast.expr | None, home: str, owner: str, name: str) -> str:
    """Return what a scenario's key is described by: `key(default, description, …)`."""
    if not (isinstance(value, ast.Call) and ast.unparse(value.func) == "key" and len(value.args) > 1):
        return ""
    said = value.args[1]
    if isinstance(said, ast.Constant):
        return str(said.value)
    return str(getattr(import_module(home), owner).model_fields[name].description)


def _row(member: str, said: str) -> str:
    cells = [" ".join(each.split()).replace("|", "\\|") for each in (member, said)]
    return f"| `{cells[0]}` | {cells[1]} |"


def reference() -> str:
    """Return docs/api.md."""
    lines, seen = [HEAD], dict[tuple[str, str], str]()
    for module in MODULES:
        lines += [f"## {module}", "", *(ast.get_docstring(tree_of(module)) or "").splitlines(), ""]
        for name in public(module):
            home, node, text = definition(module, name)
            if (where := seen.setdefault((home, name), module)) != module:
                lines += [f"### {module}.{name}", "", f"The same as `{where}.{name}`.", ""]
            else:
                lines += entry(name, node, text, home)
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    sys.stdout.write(reference())
