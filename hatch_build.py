"""Compiles the modules of pyproject's list with mypyc when a wheel is built, if there is a C compiler.

Without one the wheel is pure Python: it flies the same bytes, slower. An editable installation isn't compiled, so that
edits take effect at once. `GCS_FORMATION_COMPILE=0` leaves a wheel uncompiled, and its build needs no compiler of ours
either; with `1` the build fails if it can't compile.
"""

from __future__ import annotations

import os
import runpy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SWITCH = "GCS_FORMATION_COMPILE"
COMPILING = "compile_wheel.py"
"""What compiles, beside this file: it imports what only a compiled build has installed."""


class CompilingHook(BuildHookInterface[Any]):
    """Adds compiled modules to a wheel."""

    PLUGIN_NAME = "custom"
    _place: TemporaryDirectory[str] | None = None
    """Temporary directory of the compiled modules."""

    def dependencies(self) -> list[str]:
        """Return what compiling needs, which pip installs before it builds; nothing for a wheel left uncompiled."""
        return [] if os.environ.get(SWITCH, "") == "0" else list(self.config["compiling"])

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the modules that pyproject.toml lists."""
        wanted = os.environ.get(SWITCH, "")
        if version == "editable" or wanted == "0":
            return
        self._place = TemporaryDirectory(prefix="gcs-formation-")
        try:
            built = compiled(Path(self.root), self.config["modules"], Path(self._place.name))
        except (Exception, SystemExit) as error:
            self._clean_up()
            if wanted == "1":
                raise
            self.app.display_warning(f"not compiled, so flights take longer: {error}")
            return
        build_data["force_include"].update({str(file): place for place, file in built.items()})
        build_data["pure_python"], build_data["infer_tag"] = False, True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove the temporary directory."""
        self._clean_up()

    def _clean_up(self) -> None:
        if self._place is not None:
            self._place.cleanup()
            self._place = None


def compiled(root: Path, modules: list[str], place: Path) -> dict[str, Path]:
    """Compile modules in the directory `place`; return the files made, by their places in a wheel."""
    compile_modules = runpy.run_path(str(Path(__file__).with_name(COMPILING)))["compiled"]
    built: dict[str, Path] = compile_modules(root, modules, place)
    return built
