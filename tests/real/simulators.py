"""Simulated real autopilots: their processes and parameters, and flights of the ground station with them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from pymavlink import mavutil

from airlink.endpoint import parse_endpoint
from gcs_formation.app.sitl.fleet import SIMULATORS
from gcs_formation.app.sitl.simulator import Craft, Home, Launch, Simulator
from tests.processes import STATION, free_ports

ROOT = Path(__file__).parents[2]
LIMIT_S = 1200
PROXY = [sys.executable, "-m", "airlink"]
ORIGIN_DEG = 35.0, 125.0


def needs(variable: str, what: str) -> list[pytest.MarkDecorator]:
    """Return the marks of tests that need a simulator, whose path is in an environment variable."""
    reason = f"{variable} isn't set to the path of {what}"
    return [pytest.mark.skipif(not os.environ.get(variable), reason=reason), pytest.mark.slow]


@contextmanager
def running(
    command: list[str], directory: Path, variables: Mapping[str, str] | None = None
) -> Generator[subprocess.Popen[bytes]]:
    """Run a program in a directory of its own."""
    environment = os.environ | dict(variables or {})
    with (directory / "log.txt").open("w") as log:
        process = subprocess.Popen(
            command, cwd=directory, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        try:
            yield process
        finally:
            process.terminate()
            process.wait(10)


@contextmanager
def launched(launch: Launch, directory: Path) -> Generator[subprocess.Popen[bytes]]:
    """Run a simulator as `run --sitl` starts it, in a directory that doesn't exist yet."""
    directory.mkdir()
    for name, text in launch.files.items():
        (directory / name).write_text(text)
    with running(launch.command, directory, launch.variables) as process:
        yield process


@dataclass(frozen=True)
class ArduPilot:
    """A vehicle in ArduPilot's simulator; several are in a row to the east."""

    variable: str
    """Environment variable with the path of its binary."""
    simulator: Simulator
    apart_deg: float
    parameters: Mapping[str, float]
    field_m: float = 0.0
    """Height of the field above sea level."""

    @contextmanager
    def simulated(
        self, number: int, port: int, directory: Path, speedup: float = 1.0, **parameters: float
    ) -> Generator[subprocess.Popen[bytes]]:
        """Run a vehicle as system `number`, which sends to `port`; `parameters` are set besides its own."""
        latitude_deg, longitude_deg = ORIGIN_DEG
        home = Home(latitude_deg, longitude_deg + (number - 1) * self.apart_deg, self.field_m)
        station, given = parse_endpoint(f"udpin:127.0.0.1:{port}"), {**self.parameters, **parameters}
        craft = Craft(number, number, home, station, speedup=speedup, parameters=given)
        program = Path(os.environ[self.variable]).absolute()
        with launched(self.simulator.launch(program, craft), directory) as process:
            yield process

    @contextmanager
    def several(
        self, ports: Iterable[int], directory: Path, speedup: float = 1.0, **parameters: float
    ) -> Generator[list[subprocess.Popen[bytes]]]:
        """Run a vehicle for each port, as systems 1, 2, …"""
        with ExitStack() as stack:
            yield [
                stack.enter_context(self.simulated(number, port, directory / f"{number}", speedup, **parameters))
                for number, port in enumerate(ports, 1)
            ]


ARDUPLANE = ArduPilot(
    "ARDUPLANE_SITL",
    SIMULATORS["arduplane"],
    0.0006,
    {
        "FS_GCS_ENABL": 1,
        "FS_LONG_ACTN": 1,
        "AIRSPEED_CRUISE": 22,
        "AIRSPEED_MAX": 30,
        "AIRSPEED_MIN": 10,
        "ROLL_LIMIT_DEG": 65,
        "TKOFF_ALT": 50,
        "WP_LOITER_RAD": 80,
    },
)
ARDUCOPTER = ArduPilot("ARDUCOPTER_SITL", SIMULATORS["arducopter"], 0.0001, {"FS_GCS_ENABLE": 1})


def at_ports(keys: Mapping[str, Any], ports: Iterable[int]) -> dict[str, Any]:
    """Return a scenario with the vehicles' endpoints at these ports."""
    pairs = zip(keys["vehicles"], ports, strict=True)
    return {**keys, "vehicles": [each | {"endpoint": f"udpin:127.0.0.1:{port}"} for each, port in pairs]}


def command_to_fly(directory: Path, keys: Mapping[str, Any], *options: str) -> list[str]:
    """Write the scenario, and return the command that flies it and records in `directory / "run"`."""
    file = directory / "scenario.yaml"
    file.write_text(yaml.safe_dump(dict(keys)))
    return [*STATION, "fly", str(file), "--out", str(directory / "run"), *options]


def fly(directory: Path, keys: Mapping[str, Any], *options: str) -> subprocess.CompletedProcess[str]:
    command = command_to_fly(directory, keys, *options)
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False)


def flown(
    kind: ArduPilot,
    directory: Path,
    keys: Mapping[str, Any],
    speedup: float = 1.0,
    delay_ms: float = 0.0,
    **parameters: float,
) -> Path:
    """Simulate a scenario's vehicles, fly it to its end, and return the run directory.

    With a delay each way, in simulated time, each vehicle is behind a proxy of its own.
    """
    ports = free_ports(2 * len(keys["vehicles"]))
    received, sent_to = ports[::2], ports[1::2] if delay_ms else ports[::2]
    with ExitStack() as stack:
        for number, (listen, to) in enumerate(zip(sent_to, received, strict=True) if delay_ms else (), 1):
            proxy = [*PROXY, "--listen", f"udpin:127.0.0.1:{listen}", "--to", f"udpout:127.0.0.1:{to}"]
            (place := directory / f"proxy{number}").mkdir()
            stack.enter_context(running([*proxy, "--delay-ms", str(delay_ms / speedup)], place))
        stack.enter_context(kind.several(sent_to, directory, speedup, **parameters))
        done = fly(directory, at_ports(keys, received), "--speedup", str(speedup))
    assert done.returncode == 0, done.stderr
    return directory / "run"


def acknowledgements(run: Path) -> Counter[tuple[int, int]]:
    """Return how often the vehicles answered each command with each result."""
    log = mavutil.mavlink_connection(str(run / "flight.tlog"), dialect="ardupilotmega")
    counts: Counter[tuple[int, int]] = Counter()
    while (ack := log.recv_match(type="COMMAND_ACK")) is not None:
        counts[ack.command, ack.result] += 1
    log.close()
    return counts
