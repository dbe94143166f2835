"""What a command doesn't need isn't imported: that is most of the time that a short command takes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
FLY = """
import sys
import gcs_formation.app.run, gcs_formation.cli.flight
print(*sys.modules)
"""
CHECK = f"""
import sys
from click.testing import CliRunner
from gcs_formation.cli import main
assert CliRunner().invoke(main, ["check", {str(QUICKSTART)!r}]).exit_code == 0
print(*sys.modules)
"""


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
        *(f"scipy.{each}" for each in parts),
    }
    assert unneeded & set(modules) == set()


@pytest.mark.slow
def test_a_flight_that_nobody_watches_needs_no_terminal_and_no_figures() -> None:
    modules = subprocess.run([sys.executable, "-c", FLY], capture_output=True, text=True, check=True).stdout.split()
    assert {"rich", "matplotlib", "gcs_formation.report", "gcs_formation.studies"} & set(modules) == set()
