"""What a command doesn't need isn't imported: that is most of the time that a short command takes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

QUICKSTART = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
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
    unneeded = {"pyarrow", "matplotlib", *(f"scipy.{part}" for part in parts)}
    assert unneeded & set(modules) == set()
