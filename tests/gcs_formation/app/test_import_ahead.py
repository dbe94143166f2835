"""Under the real clock no tick waits for an import."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.app import fly, run
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run_options import RunOptions
from tests.flights.conftest import scenario

ROOT = Path(__file__).parents[3]
OUT_OF_FLIGHT = ("app", "cli", "identify", "report", "studies", "testing", "python_api.py")
"""Modules of the station that aren't called in its ticks."""
BEFORE_FLIGHT = (
    "formation_scenario/derived_defaults.py",
    "formation_scenario/vehicle_files.py",
    "airlink/transports/opening.py",
)
"""Modules that read the scenario and open its endpoints."""
INDENTED_IMPORT = re.compile(r"^ +(import|from) ", re.MULTILINE)


class BeforeAnybodyError(Exception):
    """Raised instead of importing."""


def sources() -> Iterator[Path]:
    for package in ("airlink", "flight_model", "formation_scenario", "gcs_formation"):
        for path in sorted((ROOT / package).rglob("*.py")):
            read_or_opened = path.relative_to(ROOT).as_posix() in BEFORE_FLIGHT
            if (
                not read_or_opened
                and "cli" not in path.parts
                and path.relative_to(ROOT / package).parts[0] not in OUT_OF_FLIGHT
            ):
                yield path


def imported_late(tree: ast.Module) -> Iterator[str]:
    """Yield what is imported inside functions; for scipy, the parts that the module uses."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    late = {
        alias.name for f in functions for node in ast.walk(f) if isinstance(node, ast.Import) for alias in node.names
    }
    late |= {str(node.module) for f in functions for node in ast.walk(f) if isinstance(node, ast.ImportFrom)}
    yield from late - {"scipy"}
    if "scipy" in late:
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "scipy":
                yield f"scipy.{node.attr}"


def test_all_that_a_tick_may_import_is_imported_ahead() -> None:
    ahead = {name for module in run.IMPORTED_AHEAD for name in (module, module.rpartition(".")[0])}
    texts = (path.read_text(encoding="utf-8") for path in sources())
    late = {name for text in texts if INDENTED_IMPORT.search(text) for name in imported_late(ast.parse(text))}
    assert late <= ahead
    assert {"scipy.optimize", "scipy.spatial"} <= late


@pytest.mark.parametrize(("module", "flown"), [(run, run.run), (fly, fly.fly)])
def test_it_is_imported_before_anything_else_is_done(
    module: ModuleType, flown: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def ahead() -> None:
        raise BeforeAnybodyError

    monkeypatch.setattr(module, "import_ahead", ahead)
    with pytest.raises(BeforeAnybodyError):
        flown(load_scenario(scenario()), RunOptions(tmp_path / "run", "real"), Progress(), Interrupts())
    assert not (tmp_path / "run").exists()
