"""Sources and files that `gcs-formation identify` refuses before anything is flown."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from gcs_formation.cli.identify import identify

SCENARIO = "vehicles: {count: 3}\npath: {waypoints_m: [[0, 0, 100], [3000, 0, 100]]}\nstart: {in_air: true}\n"
SOURCES = "the directory of a run, a log (*.tlog, *.bin, *.ulg, *.csv), or a scenario (*.yaml)"


def refusal(*arguments: object) -> str:
    """Return the refusal's text."""
    result = CliRunner().invoke(identify, [str(each) for each in arguments])
    assert result.exit_code == 2
    return result.output.strip()


@pytest.mark.parametrize(("name", "text"), [("README.md", "some: text: here\n"), ("notes.txt", "text\n")])
def test_a_document_is_neither_a_recording_nor_a_scenario(tmp_path: Path, name: str, text: str) -> None:
    source = tmp_path / name
    source.write_text(text, encoding="utf-8")
    said = refusal(source)
    assert said.startswith(f"found {source}, which is neither a recording nor a scenario (")
    assert said.endswith(f"; allowed: {SOURCES}")


def test_a_scenario_that_is_wrong_is_reported_as_such(tmp_path: Path) -> None:
    source = tmp_path / "list.yaml"
    source.write_text("- 1\n", encoding="utf-8")
    assert refusal(source) == f"{source}:1:1: found a list; allowed: a mapping of scenario keys"


@pytest.mark.parametrize("there", [(), ("run.yaml",)])
def test_a_directory_that_is_no_run_s_is_reported_by_what_it_lacks(tmp_path: Path, there: tuple[str, ...]) -> None:
    for name in there:
        (tmp_path / name).write_text(SCENARIO, encoding="utf-8")
    lacking = "flight.tlog" if there else "run.yaml"
    assert refusal(tmp_path) == f"found no {lacking} in {tmp_path}; allowed: the directory of a run"


def test_what_would_be_refused_after_the_flight_is_refused_before_it(tmp_path: Path) -> None:
    source, run = tmp_path / "three.yaml", tmp_path / "run"
    source.write_text(SCENARIO, encoding="utf-8")
    assert refusal(source, "--vehicle", 9, "--run-dir", run) == "--vehicle: found 9; allowed: 1, 2, 3"
    said = refusal(source, "--out", source / "model.yaml", "--run-dir", run)
    assert said.startswith(f"--out: found {source / 'model.yaml'}: ")
    assert said.endswith("; allowed: a file in a directory that can be written")
    said = refusal(source, "--out", tmp_path, "--overwrite", "--run-dir", run)
    assert said == f"--out: found {tmp_path}, a directory; allowed: a vehicle file (*.yaml)"
    assert not run.exists()
