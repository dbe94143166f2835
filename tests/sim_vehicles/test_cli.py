"""The command line as a user sees it; one flight over UDP."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from airlink.frame import FrameWriter
from airlink.messages.system import Timesync
from sim_vehicles.cli import main

ROOT = Path(__file__).parents[2]
LIMIT_S = 300.0
"""How long a busy machine may take for what usually takes a second."""


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def listener():
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.bind(("127.0.0.1", 0))
    opened.settimeout(LIMIT_S)
    return opened


@pytest.fixture(autouse=True)
def signal_handlers():
    """Restore pytest's signal handlers: the runner installs its own for SIGINT and SIGTERM."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture
def port():
    with listener() as opened:
        yield opened.getsockname()[1]


def test_each_vehicle_gets_a_line_with_where_it_sends(port):
    answer = call("--count", 3, "--base-port", port, "--one-port", "--until", 0, "--speedup", 100)
    assert answer.exit_code == 0
    assert answer.stdout.splitlines() == [f"vehicle {i} sends to 127.0.0.1:{port}" for i in (1, 2, 3)]


def test_quiet_says_nothing(port):
    answer = call("--count", 1, "--base-port", port, "--until", 0, "--quiet")
    assert (answer.exit_code, answer.output) == (0, "")


THREE = """
vehicles:
  - {id: 1, role: leader, endpoint: "udpin:127.0.0.1:24551"}
  - {id: 2, endpoint: "udpin:127.0.0.1:24552"}
  - {id: 2, network: 7, endpoint: "udpin:127.0.0.1:24553", autopilot: arduplane}
path: {waypoints_m: [[0, 0, 100], [2000, 0, 100]]}
disturbances: [{at_s: 1, velocity_mps: [1, 0, 0]}]
faults: [{at_s: 1, vehicles: ['1:2'], kind: crash}]
"""


def test_some_of_a_scenarios_vehicles_where_the_others_fly_elsewhere(tmp_path):
    (tmp_path / "three.yaml").write_text(THREE)
    answer = call(tmp_path / "three.yaml", "--vehicles", "1, 7:2", "--until", 0.1)
    assert answer.exit_code == 0
    assert [line.split(" sends")[0] for line in answer.stdout.splitlines()] == ["vehicle 1", "vehicle 7:2"]
    answer = call(tmp_path / "three.yaml", "--vehicles", "1,3", "--until", 0.1)
    assert answer.exit_code == 2
    assert "--vehicles: found '3'; allowed: the scenario's vehicles, 1, 2, 7:2" in answer.stderr
    answer = call("--vehicles", "1", "--until", 0)
    assert answer.exit_code == 2
    assert "found --vehicles without a scenario" in answer.stderr


def test_ports_count_up_from_the_base_port():
    answer = call("--count", 2, "--base-port", 14550, "--until", 0)
    assert answer.stdout.splitlines() == [f"vehicle {i} sends to 127.0.0.1:{14549 + i}" for i in (1, 2)]


@pytest.mark.parametrize(
    "arguments",
    [
        ["--count", 0],
        ["--count", 2, "--base-port", 65535],
        ["--base-port", 0],
        ["--base-port", 65536],
        ["--nonsense"],
        ["--until", "nan"],
        ["--speedup", "nan"],
        ["--ready", "inf"],
        ["--set", "seed=2"],
    ],
)
def test_bad_usage_exits_2(arguments):
    assert call(*arguments).exit_code == 2


def test_a_scenario_and_a_count_exclude_each_other(tmp_path):
    answer = call(tmp_path / "a.yaml", "--count", 2)
    assert answer.exit_code == 2
    assert "allowed: one of them" in answer.stderr


def test_help_shows_its_examples_a_line_each():
    answer = call("--help")
    assert answer.exit_code == 0
    assert sum(line.lstrip().startswith("sim-vehicles ") for line in answer.stdout.splitlines()) == 6


def test_a_bad_scenario_exits_2_and_names_the_position(tmp_path):
    path = tmp_path / "bad.yaml"
    path.write_text("schema: 1\nname: bad\nduration_s: never\n")
    answer = call(path)
    assert answer.exit_code == 2
    assert str(path) in answer.stderr
    assert "duration_s" in answer.stderr
    assert "Traceback" not in answer.output


def test_a_taken_port_exits_3(tmp_path):
    with listener() as taken:
        port = taken.getsockname()[1]
        path = tmp_path / "taken.yaml"
        path.write_text(
            "schema: 1\nname: taken\nduration_s: 10\nvehicles:\n"
            f'  - {{id: 1, role: leader, endpoint: "udpout:127.0.0.1:{port}"}}\n'
            "path: {speed_mps: 22, waypoints_m: [[0, 0, 100], [500, 0, 100]]}\n"
        )
        answer = call(path)
    assert answer.exit_code == 3
    assert f"127.0.0.1:{port}" in answer.stderr


@pytest.mark.usefixtures("foreground")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_it_speaks_over_udp_and_ends_on_a_signal_without_a_word(number, status):
    with listener() as ground:
        port = ground.getsockname()[1]
        command = [sys.executable, "-m", "sim_vehicles", "--base-port", str(port)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as process:
            first, _ = ground.recvfrom(300)
            process.send_signal(number)
            _, said = process.communicate(timeout=LIMIT_S)
    assert first[0] == 0xFD
    assert (process.returncode, said) == (status, b"")


def test_a_ground_station_by_the_name_of_its_host_is_one_peer_with_one_row_of_numbers(tmp_path):
    path = tmp_path / "named.yaml"
    with listener() as ground:
        path.write_text(
            "schema: 1\nname: named\nduration_s: 10\nvehicles:\n"
            f'  - {{id: 1, role: leader, endpoint: "udpin:localhost:{ground.getsockname()[1]}"}}\n'
            "path: {speed_mps: 22, waypoints_m: [[0, 0, 100], [500, 0, 100]]}\n"
        )
        command = [sys.executable, "-m", "sim_vehicles", str(path), "--speedup", "10"]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
            first, vehicle = ground.recvfrom(300)
            ground.sendto(FrameWriter(255, 190).encode(Timesync(0, 1)), vehicle)
            frames = [first]
            while frames[-1][7:10] != bytes([111, 0, 0]):
                frames.append(ground.recv(300))
            process.terminate()
            greeting, _ = process.communicate(timeout=LIMIT_S)
    assert [frame[4] for frame in frames] == [number % 256 for number in range(len(frames))]
    assert len(frames) > 1
    assert greeting.decode().startswith("vehicle 1 sends to localhost:")
