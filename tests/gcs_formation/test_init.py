"""`gcs-formation init`, and the help texts of the commands."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import sim_vehicles.cli
from formation_scenario import load_scenario
from gcs_formation.cli import COMMANDS, main
from gcs_formation.cli.no_flight import example_names

PROGRAMS = [(main, name) for name in COMMANDS] + [(sim_vehicles.cli.main, name) for name in sim_vehicles.cli.COMMANDS]


def invoke(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.mark.parametrize("name", example_names())
def test_an_example_can_be_flown_from_where_it_was_written(name: str, tmp_path: Path) -> None:
    result = invoke("init", tmp_path / "new", "--example", name)
    path = tmp_path / "new" / f"{name}.yaml"
    assert result.exit_code == 0
    command = "fly" if name in {"arducopter", "arduplane", "px4", "px4_copter"} else "run"
    assert f"gcs-formation {command} {path}" in result.output
    assert load_scenario(path).name
    assert "configs/" not in path.read_text()


def test_who_mistypes_a_command_is_reported_the_nearest() -> None:
    done = CliRunner().invoke(main, ["runn", "x.yaml"])
    assert done.exit_code == 2
    assert "found command 'runn'; allowed: check, compare" in done.output
    assert "did you mean 'run'?" in done.output


def test_what_is_there_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "quickstart.yaml").write_text("mine")
    result = invoke("init", tmp_path)
    assert result.exit_code == 2
    assert "overwrites nothing" in result.output
    assert (tmp_path / "quickstart.yaml").read_text() == "mine"


def test_a_directory_that_cannot_be_made_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = invoke("init", tmp_path / "file")
    assert result.exit_code == 2
    assert "cannot write" in result.output


@pytest.mark.parametrize(("program", "command"), PROGRAMS)
def test_every_command_shows_examples(program: click.Group, command: str) -> None:
    result = CliRunner().invoke(program, [command, "--help"])
    assert result.exit_code == 0
    assert "Examples:" in result.output


def loaded_by(program: str, *arguments: str) -> tuple[str, list[str]]:
    """Return a command's standard output, and the modules that it has loaded at its end."""
    script = "import atexit, sys; atexit.register(lambda: print(chr(0), *sys.modules)); "
    script += f"from {program} import main; main()"
    done = subprocess.run([sys.executable, "-c", script, *arguments], check=False, capture_output=True, text=True)
    said, modules = done.stdout.split("\0")
    return said, modules.split()


@pytest.mark.parametrize(
    ("program", "commands"), [("gcs_formation.__main__", COMMANDS), ("sim_vehicles.cli", sim_vehicles.cli.COMMANDS)]
)
def test_the_list_of_commands_names_them_all_and_loads_none(program: str, commands: Iterable[str]) -> None:
    said, modules = loaded_by(program, "--help")
    assert all(f"\n  {command} " in said for command in commands)
    assert "numpy" not in modules


def test_an_order_is_given_without_loading_what_flies(tmp_path: Path) -> None:
    _, modules = loaded_by("gcs_formation.__main__", "tell", str(tmp_path), "shape", "line")
    assert "gcs_formation.app.order_socket" in modules
    assert "numpy" not in modules
