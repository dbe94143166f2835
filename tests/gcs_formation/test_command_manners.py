"""Manners of the commands: help lists what they take, refusals and results name the next command."""

import os
import pty
import signal
import subprocess
import sys
from typing import Any

import click
import pytest
from click.testing import CliRunner

from airlink.cli import WithDefault
from gcs_formation.cli import main
from sim_vehicles.cli import main as vehicles
from tests.processes import wait_for

GROUPS = [(main, name) for name in sorted(main.entries)] + [(vehicles, name) for name in sorted(vehicles.entries)]
REFUSED = {"fly": {"--clock"}}


@pytest.mark.parametrize(("group", "name"), GROUPS, ids=[f"{group.name}-{name}" for group, name in GROUPS])
def test_help_lists_every_option_that_a_command_takes_and_none_that_it_only_refuses(group, name):
    chosen: Any = group.get_command(click.Context(group), name)
    default = chosen.default if isinstance(chosen, WithDefault) else None
    takes: Any = chosen if default is None else chosen.get_command(click.Context(chosen), default)
    said = CliRunner().invoke(group, [name, "--help"]).stdout
    for option in (each for each in takes.params if isinstance(each, click.Option)):
        listed = max(option.opts, key=len) in said
        assert listed is not option.hidden
        if group is main:
            assert option.hidden is (max(option.opts, key=len) in REFUSED.get(name, ()))


def test_a_study_that_is_run_and_a_scenario_that_is_studied_are_refused_with_the_command_that_takes_them(tmp_path):
    study, scenario = tmp_path / "study.yaml", tmp_path / "scenario.yaml"
    study.write_text("base: scenario.yaml\nparameters: {seed: [1, 2]}\n")
    scenario.write_text("vehicles: {count: 2}\npath: {waypoints_m: [[0, 0, 100], [4000, 0, 100]]}\n")
    for name in ("run", "fly", "check", "compare"):
        refused = CliRunner().invoke(main, [name, str(study)])
        assert refused.exit_code == 2
        assert "found a study" in refused.stderr
        assert f"gcs-formation study {study} --out DIR" in refused.stderr
    refused = CliRunner().invoke(main, ["study", str(scenario), "--out", str(tmp_path / "out")])
    assert (refused.exit_code, f"gcs-formation run {scenario}" in refused.stderr) == (2, True)


@pytest.mark.slow
@pytest.mark.parametrize("ends", ["terminal", "hangup"])
def test_vehicles_end_when_their_terminal_closes(ends):
    """In a session of their own no shell passes SIGHUP on when the terminal is gone."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "sim_vehicles", "--count", "1", "--base-port", "24550"]
    output = subprocess.PIPE
    with subprocess.Popen(command, stdin=theirs, stdout=output, text=True, start_new_session=True) as process:
        os.close(theirs)
        assert process.stdout is not None
        assert "vehicle 1" in process.stdout.readline()
        if ends == "hangup":
            process.send_signal(signal.SIGHUP)
        else:
            os.close(ours)
        wait_for(lambda: process.poll() is not None, 10.0)
        assert process.returncode == 0
