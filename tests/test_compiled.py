"""A wheel that was compiled flies the same bytes as its sources."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLIGHT = "configs/noise.yaml", "--clock", "virtual", "--until", "5", "--set", "start.in_air=true", "--quiet"


def fly(packages: Path, out: Path) -> str:
    """Fly with the packages of a folder; return where the state filter was loaded from."""
    ours = {**os.environ, "PYTHONPATH": str(packages)}
    command = [sys.executable, "-P", "-m", "gcs_formation", "run", *FLIGHT, "--out", str(out)]
    subprocess.run(command, cwd=ROOT, env=ours, check=True)
    where = "import gcs_formation.estimation.estimator as filter; print(filter.__file__)"
    return subprocess.check_output([sys.executable, "-P", "-c", where], env=ours, text=True).strip()


@pytest.mark.slow
def test_a_compiled_wheel_flies_the_same_bytes(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path), str(ROOT)]
    subprocess.run(build, env={**os.environ, "GCS_FORMATION_COMPILE": "1"}, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "wheel")
    assert fly(tmp_path / "wheel", tmp_path / "compiled").endswith(".so")
    assert fly(ROOT, tmp_path / "plain").endswith(".py")
    for name in ("flight.tlog", "timeseries.parquet", "events.jsonl"):
        assert (tmp_path / "compiled" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()
