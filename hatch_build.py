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
COMPILED = "# Compiled by mypyc: it runs every tick."
"""First line of those modules that are compiled of a pattern in the list."""
INSTALLED = "airlink/installed.py"
"""What finds a clone's commit, and reads it again in the wheel."""


class CompilingHook(BuildHookInterface[Any]):
    """Adds compiled modules to a wheel."""

    PLUGIN_NAME = "custom"
    _place: TemporaryDirectory[str] | None = None
    """Temporary directory of the compiled modules."""

    def dependencies(self) -> list[str]:
        """Return what compiling needs, which pip installs before it builds; nothing for a wheel left uncompiled."""
        return [] if os.environ.get(SWITCH, "") == "0" else list(self.config["compiling"])

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the modules that pyproject.toml lists, and note the commit that the wheel is of."""
        wanted = os.environ.get(SWITCH, "")
        if version == "editable":
            return
        self._place = TemporaryDirectory(prefix="gcs-formation-")
        place = Path(self._place.name)
        build_data["force_include"].update(stored_commit(Path(self.root), place))
        if wanted == "0":
            return
        try:
            built = compiled(Path(self.root), listed(Path(self.root), self.config["modules"]), place)
        except (Exception, SystemExit) as error:
            if wanted == "1":
                self._clean_up()
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


def listed(root: Path, modules: list[str]) -> list[str]:
    """Return the modules of a list in which some are patterns: of these, the files that say that they're compiled."""
    found = list[str]()
    for each in modules:
        files = sorted(root.glob(each)) if "*" in each else []
        marked = (file for file in files if file.read_text(encoding="utf-8").startswith(COMPILED))
        found += [file.relative_to(root).as_posix() for file in marked] if "*" in each else [each]
    return found


def compiled(root: Path, modules: list[str], place: Path) -> dict[str, Path]:
    """Compile modules in the directory `place`; return the files made, by their places in a wheel.

    Raises:
        RuntimeError: a module is missing among them, so that the wheel would be called compiled and not be it.
    """
    compile_modules = runpy.run_path(str(Path(__file__).with_name(COMPILING)))["compiled"]
    built: dict[str, Path] = compile_modules(root, modules, place)
    made = {name.partition(".")[0] for name in built}
    missing = [each for each in modules if each.removesuffix(".py") not in made]
    if missing or not built:
        raise RuntimeError(f"of {len(modules)} modules these weren't compiled: {', '.join(missing) or 'all'}")
    return built


def stored_commit(root: Path, place: Path) -> dict[str, str]:
    """Note the commit of a clone in a file, and return the file's place in a wheel; nothing elsewhere."""
    installed = runpy.run_path(str(root / INSTALLED)) if (root / INSTALLED).is_file() else {}
    commit: str = installed["commit_of"]((root / INSTALLED).parent) if installed else ""
    if not commit:
        return {}
    file = place / installed["COMMIT"]
    file.write_text(f"{commit}\n", encoding="ascii")
    return {str(file): f"{Path(INSTALLED).parent.as_posix()}/{file.name}"}
