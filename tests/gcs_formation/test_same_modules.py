"""Processes that a command starts run the same code as the command, whatever its working directory contains."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
import yaml

from tests.processes import free_port

PROGRAM = """
from gcs_formation.__main__ import main
if __name__ == "__main__":
    main()
"""


@pytest.fixture
def beside_other_sources(tmp_path):
    """Return a directory with packages of our names; whoever imports one of them leaves a file `imported`."""
    for package in ("gcs_formation", "sim_vehicles", "airlink"):
        (tmp_path / package).mkdir()
        for module in ("__init__.py", "__main__.py"):
            (tmp_path / package / module).write_text("open('imported', 'w').close()\n")
    scenario = {
        "vehicles": {"count": 2, "endpoint": f"udpin:127.0.0.1:{free_port()}"},
        "start": {"in_air": True, "run_in_s": 25},  # they fly on while processes start: a lap would take minutes
        "finish": {"loiter_s": 0},
        "duration_s": 1,
        "path": {"waypoints_m": [[0, 0, 100], [2000, 0, 100]]},
    }
    (tmp_path / "two.yaml").write_text(yaml.safe_dump(scenario))
    study = {"base": "two.yaml", "seeds": {"first": 1, "count": 1}, "metrics": ["error_x_m.max"], "record": "none"}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "program.py").write_text(PROGRAM)
    return tmp_path


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(("study", "study.yaml", "--workers", "1"), marks=pytest.mark.slow),
        pytest.param(("run", "two.yaml", "--speedup", "5"), marks=pytest.mark.slow),
    ],
    ids=["workers of a study", "emulated vehicles under the real clock"],
)
def test_processes_import_what_the_command_imports(beside_other_sources, arguments):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    environment.pop("PYTHONSAFEPATH", None)
    command = [sys.executable, "bin/program.py", *arguments, "--out", "out"]
    done = subprocess.run(
        command, cwd=beside_other_sources, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not (beside_other_sources / "imported").exists()
