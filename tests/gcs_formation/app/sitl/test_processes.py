"""Simulators' processes: each in its directory, noticed when it ends, and ended by its own handle."""

from __future__ import annotations

import multiprocessing
import signal
import socket
import sys
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from airlink.host_system import STATUS_OF_PROCESS
from gcs_formation.app.sitl import guard
from gcs_formation.app.sitl.fleet import Simulated
from gcs_formation.app.sitl.processes import ended, running, with_free_ports
from gcs_formation.app.sitl.simulator import Craft, Launch, SimulatorError
from tests.gcs_formation.app.sitl.test_fleet import PX4_PATH, fleet
from tests.processes import wait_for

WAITS = "import sys; print('up', flush=True); sys.stdin.close(); import time; time.sleep(60)"
FAILS = "import sys; sys.exit('no such model')"


def as_python(one: Simulated, code: str) -> Simulated:
    """Return a vehicle whose simulator is a line of Python."""

    class Program(type(one.simulator)):  # type: ignore[misc]
        def launch(self, program: Path, craft: Craft) -> Launch:
            return Launch([sys.executable, "-S", "-c", code], files={"set.parm": "A 1\n"})

    return replace(one, simulator=Program())


def test_each_runs_in_its_directory_until_the_flight_is_over(tmp_path: Path) -> None:
    one = as_python(fleet()[0], WAITS)
    with running([one], tmp_path) as (only,):
        wait_for(lambda: (only.directory / "output.txt").read_text() == "up\n")
        assert ended([only]) == ""
        assert (tmp_path / "simulators" / "1" / "set.parm").read_text() == "A 1\n"
    assert only.process.returncode == -15


def test_one_that_ends_is_named_with_its_last_words(tmp_path: Path) -> None:
    with running([as_python(each, code) for each, code in zip(fleet(), (WAITS, FAILS), strict=True)], tmp_path) as both:
        wait_for(lambda: ended(both))
        assert ended(both).startswith("vehicle 2: its simulator has ended: no such model")


def test_where_another_runs_simulator_has_the_port_the_next_numbers_are_taken() -> None:
    one = fleet()[0]
    ((kind, port),) = one.simulator.ports(one.craft)
    with socket.socket(socket.AF_INET, kind) as taken:
        with suppress(OSError):  # a simulator on this machine has it
            taken.bind(("", port))
        (other,) = with_free_ports([one])
    assert other.craft.number > one.craft.number
    assert port not in [each for _, each in other.simulator.ports(other.craft)]


def test_a_stepped_px4_has_a_free_instance_of_its_own_and_the_scenario_s_id() -> None:
    vehicles = {"count": 2, "autopilot": "px4"}
    first = fleet("px4", vehicles=vehicles, path=PX4_PATH, stepped=True)
    needs = [each.simulator.ports(each.craft) for each in first]
    assert not set(needs[0]) & set(needs[1])
    for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
        (port,) = (each for needed, each in needs[1] if needed == kind)
        with socket.socket(socket.AF_INET, kind) as taken:
            with suppress(OSError):  # a simulator on this machine has it
                taken.bind(("", port))
            other = with_free_ports(first)
        assert all(port not in (each for _, each in one.simulator.ports(one.craft)) for one in other)
        launched = [one.simulator.launch(one.program, one.craft) for one in other]
        assert [each.variables["PX4_PARAM_MAV_SYS_ID"] for each in launched] == ["1", "2"]
        assert len({each.command[2] for each in launched}) == 2


def test_a_port_that_its_id_says_and_another_program_has_is_named() -> None:
    vehicles = {"count": 1, "autopilot": "px4", "endpoint": "udpin:127.0.0.1:14550"}
    (one,) = fleet("px4", vehicles=vehicles, path=PX4_PATH)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        with suppress(OSError):  # a simulator on this machine has it
            taken.bind(("", 18570))
        with pytest.raises(SimulatorError, match="found port 18570 taken, which vehicle 1's"):
            with_free_ports([one])


def test_a_program_that_can_not_be_executed_is_named(tmp_path: Path) -> None:
    (tmp_path / "arduplane").write_bytes(b"no program")
    one = replace(fleet()[0], program=tmp_path / "arduplane")
    with pytest.raises(SimulatorError, match=r"can't run .*arduplane: "):
        running([one], tmp_path).__enter__()


def fly_until_killed(out: Path, said: Connection) -> None:
    """Start simulators, as a ground station does, say their numbers, and wait for good."""
    with running([as_python(each, WAITS) for each in fleet()], out) as both:
        said.send([each.process.pid for each in both])
        signal.pause()


def test_simulators_end_with_a_station_that_is_killed(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    hears, says = context.Pipe(duplex=False)
    station = context.Process(target=fly_until_killed, args=(tmp_path, says))
    station.start()
    simulators = hears.recv()
    assert len(simulators) == len(fleet())
    assert all(guard.ours(each, STATUS_OF_PROCESS) for each in simulators)
    station.kill()
    station.join()
    wait_for(lambda: not any(guard.ours(each, STATUS_OF_PROCESS) for each in simulators))
