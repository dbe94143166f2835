"""Commands import only what they need, because imports take most of the time of a short command."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn, cast

import pytest

from airlink.cli import OBJECTS
from gcs_formation.app import run as run_module
from gcs_formation.app.run_options import RunOptions
from gcs_formation.errors import RunAbortedError

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
FLY = """
import pathlib, sys
import numpy
import gcs_formation.app.run, gcs_formation.cli.run_and_fly
from gcs_formation.record.figures_of_merit import (percentile)
from gcs_formation.record.parquet import write_parquet
percentile(numpy.zeros(3), 50)
flags = ("active", "leads", "yielding", "airborne")
write_parquet(pathlib.Path("/dev/null"), [dict.fromkeys(("phase", "t_s", *flags), numpy.zeros(3))])
print(*sys.modules)
"""
THREADS = """
import os, sys
from {command}.__main__ import main
sys.argv = ["{command}", "--help"]
try:
    main()
except SystemExit:
    import numpy
    print(len(os.listdir("/proc/self/task")))
"""
LEFT_OUT = f"""
from formation_scenario.links import LinkChange
from formation_scenario.load import load_scenario
from formation_scenario.surroundings import Terrain
load_scenario({str(QUICKSTART)!r})
print(Terrain.__pydantic_complete__, LinkChange.__pydantic_complete__)
load_scenario({str(QUICKSTART)!r}, ["terrain={{}}"])
print(Terrain.__pydantic_complete__)
"""
CHECK = f"""
import sys
from click.testing import CliRunner
from gcs_formation.cli import main
assert CliRunner().invoke(main, ["check", {str(QUICKSTART)!r}]).exit_code == 0
print(*sys.modules)
"""


OF_FEW_SCENARIOS = {
    "airlink.transports.serial_line",
    "airlink.transports.tcp",
    "formation_scenario.mission_files",
    "formation_scenario.parameter_files",
    "formation_scenario.repair",
    "serial",
}


@pytest.mark.slow
def test_check_imports_what_it_needs_alone() -> None:
    modules = subprocess.run([sys.executable, "-c", CHECK], capture_output=True, text=True, check=True).stdout.split()
    parts = ("optimize", "interpolate", "spatial", "special")
    unneeded = {
        "pyarrow",
        "matplotlib",
        "numpy.ma",
        "rich",
        "gcs_formation.studies",
        *OF_FEW_SCENARIOS,
        *(f"scipy.{each}" for each in parts),
    }
    assert unneeded & set(modules) == set()


@pytest.mark.slow
def test_a_flight_that_none_watches_needs_no_terminal_and_no_figures() -> None:
    modules = subprocess.run([sys.executable, "-c", FLY], capture_output=True, text=True, check=True).stdout.split()
    unneeded = {"rich", "matplotlib", "numpy.ma", "gcs_formation.report", "gcs_formation.studies", *OF_FEW_SCENARIOS}
    assert unneeded & set(modules) == set()


@pytest.mark.slow
def test_a_group_of_keys_that_a_scenario_leaves_out_is_not_built() -> None:
    """Of the 62 groups most are left out by most scenarios; building all took a tenth of a short command."""
    said = subprocess.run([sys.executable, "-c", LEFT_OUT], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "False", "True"]


@pytest.mark.parametrize("command", ["airlink", "gcs_formation", "sim_vehicles"])
def test_a_command_has_numpy_start_no_threads(command: str) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    script = THREADS.format(command=command)
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert said.stdout.splitlines()[-1] == "1"


@pytest.fixture
def _thresholds() -> Iterator[None]:
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


@pytest.mark.usefixtures("_thresholds")
@pytest.mark.parametrize(("before", "within"), [(700, OBJECTS), (2 * OBJECTS, 2 * OBJECTS), (0, 0)])
def test_a_flight_looks_for_garbage_seldom(before: int, within: int, monkeypatch: pytest.MonkeyPatch) -> None:
    gc.set_threshold(before, 11, 12)
    options, nothing = RunOptions(Path("unused"), "virtual"), cast("Any", None)
    monkeypatch.setattr(run_module, "_run_virtual", lambda *_: gc.get_threshold())
    monkeypatch.setattr(run_module, "require_no_program", lambda _: None)
    assert run_module.run(nothing, options, nothing, nothing) == (within, 11, 12)
    assert gc.get_threshold() == (before, 11, 12)

    def refused(*_: object) -> NoReturn:
        raise RunAbortedError("a port is taken")

    monkeypatch.setattr(run_module, "_run_virtual", refused)
    with pytest.raises(RunAbortedError):
        run_module.run(nothing, options, nothing, nothing)
    assert gc.get_threshold() == (before, 11, 12)
