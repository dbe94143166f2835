"""A compiled wheel flies the same bytes as its sources, and passes the tests of the compiled modules."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLIGHTS = {
    "noise": ("noise", "start.in_air=true"),
    "hills": ("hills", "seed=2"),
    "copters": ("arducopter", "start.in_air=true"),
    "px4": ("px4", "start.in_air=true"),
    "consensus": ("paper", "law.type=consensus", "links.default={delay_ms: 150, jitter_ms: 30, loss: 0.1}"),
    "crash": ("paper", "faults=[{at_s: 2, vehicles: [1], kind: crash}]", "law.delay_compensation=false"),
}
"""A configuration, and keys set."""
EXTENSIONS: dict[str, tuple[str, ...]] = {
    "lqr_law": ("law.type=lqr", "law.parameters={share: 0.9}"),
    "chase_law": ("law.type=chase",),
    "keep_out_filter": ("extensions={keep_out: {north_m: 200, east_m: 10, radius_m: 40}}",),
    "slot_monitor": ("extensions={in_slot: {within_m: 0.001}}",),
    "lines_recorder": ("extensions={lines: }",),
    "spread_metric": ("expect=[{metric: spread_m, above: 1, to_s: 4}]",),
    "vee_shape": ("formation.shape=vee", "formation.parameters={half_deg: 50}"),
    "drift_predictor": ("law.predictor={type: drift}",),
    "radio_link": ("links.default={process: radio, parameters: {range_m: 3000}}",),
    "icing_fault": ("faults=[{kind: icing, at_s: 1, until_s: 3, vehicles: [2]}]",),
    "rough_air_disturbance": ("disturbances=[{kind: rough_air, at_s: 0}]",),
    "thermal_disturbance": ("disturbances=[{kind: thermal, at_s: 0, parameters: {north_m: 50}}]",),
    "skywalker_aircraft": ("vehicles.1.model={aircraft: skywalker, parameters: {payload_kg: 1}}",),
    "survey_navigation": ("vehicles.1.navigation={source: survey, parameters: {north_m: 2}}",),
    "quiet_family": ("vehicles.1.emulator={family: quiet, parameters: {every_s: 1}}",),
    "known_asymmetry": ("telemetry={clock: known_asymmetry, parameters: {up_share: 0.7}}",),
    "pursuit_guidance": ("path.guidance={type: pursuit}",),
    "forked_plane": ("vehicles={count: 3, autopilot: forked_plane, parameters: {height_step_m: 0.5}}",),
}
"""A file of examples/extensions, as a third party's, and what names it."""
DECIDING = (
    "airlink",
    "flight_model",
    "gcs_formation/control",
    "gcs_formation/estimation",
    "gcs_formation/guidance",
    "gcs_formation/link",
    "gcs_formation/features",
)
"""Tests of compiled modules."""
PATCHING = (
    "a_step_is_the_extended_kalman_filters",
    "whose_path_leads_out_stays_inside",
    "that_the_fence_turns_towards_each_other",
    "junk_at_one_socket_stops_neither",
    "before_what_arrived_during_a_long_receive",
    "after_a_stop_all_that_came_meanwhile",
)
"""Tests among them that replace parts of compiled objects, and so can't run here."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory with the packages of a compiled wheel and the tests."""
    directory = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(directory), str(ROOT)]
    subprocess.run(build, env={**os.environ, "GCS_FORMATION_COMPILE": "1"}, check=True)
    (file,) = directory.glob("*.whl")
    zipfile.ZipFile(file).extractall(directory)
    for name in ("tests", "configs"):
        shutil.copytree(ROOT / name, directory / name)
    shutil.copy(ROOT / "pyproject.toml", directory)
    return directory


def fly(packages: Path, out: Path, scenario: str, *keys: str, plugin: Path | None = None) -> str:
    """Fly with the packages of a directory; return where the state filter was loaded from."""
    ours = {**os.environ, "PYTHONPATH": str(packages)}
    told = [word for key in keys for word in ("--set", key)] + ([] if plugin is None else ["--plugin", str(plugin)])
    flight = [f"configs/{scenario}.yaml", "--clock", "virtual", "--until", "5", *told, "--quiet", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "gcs_formation", "run", *flight], cwd=ROOT, env=ours, check=False
    )
    assert done.returncode in {0, 1}
    where = "import gcs_formation.estimation.estimator as filter; print(filter.__file__)"
    return subprocess.check_output([sys.executable, "-P", "-c", where], env=ours, text=True).strip()


@pytest.mark.slow
@pytest.mark.parametrize("flight", FLIGHTS)
def test_a_compiled_wheel_flies_the_same_bytes(wheel: Path, tmp_path: Path, flight: str) -> None:
    assert fly(wheel, tmp_path / "compiled", *FLIGHTS[flight]).endswith(".so")
    assert fly(ROOT, tmp_path / "plain", *FLIGHTS[flight]).endswith(".py")
    for name in ("flight.tlog", "timeseries.parquet", "events.jsonl"):
        assert (tmp_path / "compiled" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_a_compiled_wheel_flies_a_file_from_outside_of_it(wheel: Path, tmp_path: Path, extension: str) -> None:
    file = Path(shutil.copy(ROOT / "examples" / "extensions" / f"{extension}.py", tmp_path / "theirs.py"))
    keys = ("start.in_air=true", "links.default={delay_ms: 100, jitter_ms: 10}", *EXTENSIONS[extension])
    assert fly(wheel, tmp_path / "compiled", "quickstart", *keys, plugin=file).endswith(".so")
    assert fly(ROOT, tmp_path / "plain", "quickstart", *keys, plugin=file).endswith(".py")
    for name in ("flight.tlog", "timeseries.parquet", "events.jsonl"):
        assert (tmp_path / "compiled" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()


@pytest.mark.slow
def test_a_compiled_wheel_compares_laws_in_processes_of_their_own(wheel: Path, tmp_path: Path) -> None:
    short = ("--laws", "pid,consensus", "--until", "2", "--set", "expect=[]", "--out", str(tmp_path / "laws"))
    compare = [sys.executable, "-P", "-m", "gcs_formation", "compare", "configs/quickstart.yaml", *short]
    subprocess.run(compare, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(wheel)}, check=True)


@pytest.mark.slow
def test_a_compiled_wheel_decides_as_its_tests_say(wheel: Path) -> None:
    ours = {**os.environ, "PYTHONPATH": str(wheel)}
    tests = [f"tests/{each}" for each in DECIDING]
    options = ["-q", "-p", "no:cacheprovider", "-m", "not slow", "-k", f"not ({' or '.join(PATCHING)})"]
    subprocess.run([sys.executable, "-P", "-m", "pytest", *options, *tests], cwd=wheel, env=ours, check=True)
