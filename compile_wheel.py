"""Compiles modules with mypyc for a wheel, on all cores; hatch_build.py runs it."""

from __future__ import annotations

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from sysconfig import get_path
from typing import Any

from mypyc.build import mypycify
from setuptools import Distribution, Extension
from setuptools.command.build_ext import build_ext

GROUP = "gcs_formation"
LEFT_OUT = (
    *("tree-pre", "gcse", "tree-vrp", "code-hoisting", "schedule-insns2"),
    *("align-functions", "align-jumps", "align-labels", "align-loops"),
)
"""Optimisations to disable: they take a fifth of gcc's time; without them flights are as fast and code is smaller."""
MYPY = """[mypy]
python_version = {}.{}
ignore_missing_imports = True
follow_imports = silent

[mypy-click.*,distributed.*,matplotlib.*,pyarrow.*,pydantic.*,pymavlink.*,rich.*,scipy.*,yaml.*]
follow_imports = skip
follow_imports_for_stubs = True
"""
"""Types of imported modules that aren't compiled are trusted here: the checks of a push check them by pyproject.toml.

Packages that no tick uses aren't followed, so that the wheel is the same whether they are installed or not.
"""


class ParallelBuild(build_ext):
    """Compiles C files in parallel on all cores, both the files of an extension and the extensions.

    setuptools compiles the files of one extension one after the other.
    """

    def build_extensions(self) -> None:
        """Build all extensions."""
        one_after_another, self.parallel = self.compiler.compile, os.cpu_count() or 1
        if sys.platform == "linux":
            self._read_headers_once()

        def compile_all(sources: list[str], **options: Any) -> list[str]:
            with ThreadPoolExecutor(self.parallel) as cores:
                objects = cores.map(lambda source: one_after_another([source], **options), sources)
                return [each for built in objects for each in built]

        self.compiler.compile = compile_all
        super().build_extensions()

    def _read_headers_once(self) -> None:
        """Precompile what C files include: to read it is a tenth of mypyc's time, and most of the other modules'.

        Those only name their module of the shared library; all they include is Python's header.
        """
        (shared, *naming), header = self.extensions, f"__native_internal_{GROUP}.h"
        path = next((each for each in shared.depends if each.endswith(header)), None)
        if path is None:
            return  # another mypyc than this was written for: slower to compile, nothing else
        self._precompile(shared, path, f"{path}.gch")
        python, made = Path(get_path("include"), "Python.h"), Path(path).parent / "python"
        made.mkdir()
        self._precompile(shared, str(python), str(made / "Python.h.gch"))
        for each in naming:
            each.include_dirs = [str(made), *each.include_dirs]
        shared.extra_compile_args = [*shared.extra_compile_args, "-include", header]

    def _precompile(self, like: Extension, header: str, made: str) -> None:
        """Precompile a header with the options of an extension's C files."""
        places = [f"-I{each}" for each in (*self.compiler.include_dirs, *like.include_dirs)]
        options = [*like.extra_compile_args, "-x", "c-header", header, "-o", made]
        self.compiler.spawn([*self.compiler.compiler_so, *places, *options])


def compiled(root: Path, modules: list[str], place: Path) -> dict[str, Path]:
    """Compile modules in the directory `place`; return them and the libraries they share, by their places in a wheel.

    `a * b + c` is rounded twice, as in Python, also on processors with a fused operation. On Linux, modules call each
    other directly: otherwise any function could be replaced from outside, and none would be inlined.
    """
    settings = place / "mypy.ini"
    settings.write_text(MYPY.format(*sys.version_info))
    with chdir(root):
        options = ["--config-file", str(settings), "--cache-dir", str(place / "cache"), *modules]
        extensions = mypycify(
            options, opt_level="2", debug_level="0", multi_file=True, group_name=GROUP, target_dir=str(place)
        )
        compiling = ["-ffp-contract=off"] if sys.platform != "win32" else []
        linking = ["-Wl,-Bsymbolic"] if sys.platform == "linux" else []
        if sys.platform == "linux":
            compiling += ["-fvisibility=hidden", "-fno-semantic-interposition", *(f"-fno-{each}" for each in LEFT_OUT)]
        for each in extensions:  # they all share one list
            each.extra_compile_args = [*each.extra_compile_args, *compiling]
            each.extra_link_args = [*each.extra_link_args, *linking]
        command = ParallelBuild(Distribution({"name": GROUP, "ext_modules": extensions}))
        command.build_lib, command.build_temp = str(place / "lib"), str(place / "temp")
        command.ensure_finalized()
        command.run()
    made = (file for file in (place / "lib").rglob("*") if file.name.endswith(tuple(EXTENSION_SUFFIXES)))
    return {file.relative_to(place / "lib").as_posix(): file for file in made}
