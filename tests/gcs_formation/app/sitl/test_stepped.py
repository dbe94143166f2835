"""Autopilots whose clocks are stepped: what is exchanged, that all move in step, and whole flights, byte for byte."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import yaml

from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import LOOPBACK, Address
from airlink.engine import Datagram
from formation_scenario import ScenarioError, load_scenario
from gcs_formation import Flight, run
from gcs_formation.app.sitl import ardupilot_json
from gcs_formation.app.sitl.ardupilot_json import MORE_OUTPUTS, OUTPUTS, SPARE_S, JsonExchange
from gcs_formation.app.sitl.exchange import Exchange, ExchangeError, Sample
from gcs_formation.app.sitl.simulator import Home
from gcs_formation.app.sitl.stepped.fleet import CALL, CYCLE_S, SteppedFleet
from gcs_formation.app.sitl.stepped.flight import on_their_ground
from sim_vehicles.config import fleet_config
from sim_vehicles.truth import TruthRecord, TruthWriter
from tests.flights.conftest import scenario
from tests.processes import LIMIT_S, STATION, events_of, free_ports

STEP_S = 0.0025
HOME = Home(35.0, 125.0, 0.0)
SPHERE_N, SPHERE_E = 111_318.845 / 110_940.6, 111_318.845 / 111_441.5
"""Metres of ArduPilot's sphere for each of the ellipsoid there, along a meridian and a parallel."""
MAGIC, MAGIC_OF_32 = 18458, 29569
PROGRAM = Path(__file__).with_name("stepped_program.py")
FULL = (1500, 1530, 2000, 1500)
"""With which a fixed wing takes off."""
SAMPLE = Sample(
    4, (0.5, -0.25, -9.75), (0.1, 0.2, -0.3), (100.5, -20.25, -30.0), (1.0, 0.0, 0.0, 0.0), (20.0, 1.0, -2.0), 21.5
)


@pytest.fixture
def exchange() -> Iterator[JsonExchange]:
    with closing(JsonExchange(HOME, STEP_S)) as found:
        yield found


@pytest.fixture
def autopilot(exchange: JsonExchange) -> Iterator[socket.socket]:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as found:
        found.connect((LOOPBACK, exchange.port))
        found.settimeout(LIMIT_S)
        yield found


def test_an_ardu_pilots_outputs_are_read_once(exchange: JsonExchange, autopilot: socket.socket) -> None:
    """It sends them again when the answer is late; a second answer would put it a step behind for good."""
    first, second = range(1000, 1016), range(1100, 1116)
    for data in (
        OUTPUTS.pack(MAGIC, 1200, 0, *first),
        OUTPUTS.pack(MAGIC, 1200, 0, *first),
        OUTPUTS.pack(1, 1200, 1, *first),
        b"short",
        OUTPUTS.pack(MAGIC, 1200, 1, *second),
    ):
        autopilot.send(data)
    assert [exchange.outputs_us(), exchange.outputs_us()] == [tuple(first), tuple(second)]


def test_of_32_outputs_all_are_read(exchange: JsonExchange, autopilot: socket.socket) -> None:
    autopilot.send(MORE_OUTPUTS.pack(MAGIC_OF_32, 1200, 0, *range(1000, 1032)))
    assert exchange.outputs_us() == tuple(range(1000, 1032))


def test_one_that_asks_for_nothing_else_is_given_up(
    exchange: JsonExchange, autopilot: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ardupilot_json, "WAITS", 5)
    for _ in range(10):
        autopilot.send(b"no outputs")
    with pytest.raises(ExchangeError, match="asks for no sensors"):
        exchange.outputs_us()


def test_it_is_answered_in_json_between_line_ends(exchange: JsonExchange, autopilot: socket.socket) -> None:
    autopilot.send(OUTPUTS.pack(MAGIC, 1200, 0, *[1500] * 16))
    exchange.outputs_us()
    exchange.answer(SAMPLE)
    line = autopilot.recv(1000)
    assert line[:1] == line[-1:] == b"\n"
    assert json.loads(line) == {
        "timestamp": pytest.approx(4 * STEP_S, abs=1e-9),
        "imu": {"gyro": [0.1, 0.2, -0.3], "accel_body": [0.5, -0.25, -9.75]},
        "position": [pytest.approx(100.5 * SPHERE_N, abs=1e-3), pytest.approx(-20.25 * SPHERE_E, abs=1e-3), -30.0],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
        "velocity": [20.0, 1.0, -2.0],
        "airspeed": 21.5,
        "no_time_sync": 1,
    }


def test_an_ardu_pilots_clock_loses_nothing() -> None:
    """It adds differences of timestamps to whole microseconds, and drops what is left."""
    clock_us, last_s = 0, 0.0
    for number in range(1, 400_001):
        at_s = float(f"{number * (STEP_S + SPARE_S):.12f}")
        clock_us = int(clock_us + (at_s - last_s) * 1e6)
        last_s = at_s
    assert clock_us == 400_000 * round(STEP_S * 1e6)


class Scripted(Exchange):
    """An autopilot that puts out always the same, and asks a limited number of times."""

    port, step_s = 0, STEP_S

    def __init__(self, outputs_us: tuple[int, ...], times: int = 1_000_000) -> None:
        self._outputs_us, self._left, self.samples = outputs_us, times, list[Sample]()

    def outputs_us(self) -> tuple[int, ...]:
        if not self._left:
            raise ExchangeError("its simulator asks for no sensors")
        self._left -= 1
        return self._outputs_us

    def answer(self, sample: Sample) -> None:
        self.samples.append(sample)

    def close(self) -> None:
        pass


def fleet_of(exchanges: list[Scripted], writer: TruthWriter, **keys: Any) -> SteppedFleet:
    planes = {"count": len(exchanges), "autopilot": "arduplane"}
    planned = load_scenario(scenario(**({"start": {"in_air": False}, "vehicles": planes} | keys)))
    found = SteppedFleet(fleet_config(planned), exchanges, [0] * len(exchanges), writer)
    found.begin()
    return found


def run_to(fleet: SteppedFleet, end_s: float) -> None:
    while (due := fleet.next_timer()) is not None and due <= after(Instant(0), end_s):
        fleet.handle_timer(due)


def test_all_move_in_step_and_the_ground_truth_says_where(tmp_path: Path) -> None:
    exchanges = [Scripted(FULL), Scripted((1500, 1500, 1000, 1500))]
    with TruthWriter(tmp_path / "truth", 2) as writer, closing(fleet_of(exchanges, writer)) as fleet:
        run_to(fleet, 3.0)
    assert [len(each.samples) for each in exchanges] == [round(3.0 / STEP_S)] * 2
    flew, stood = (each.samples[-1] for each in exchanges)
    assert flew.number == round(3.0 / STEP_S)
    assert -flew.position_m[2] > 4.0
    assert stood.position_m == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    rows = TruthRecord(tmp_path / "truth").between(0.0, 3.0)
    assert rows["airborne"][-1].tolist() == [1.0, 0.0]
    assert rows["height_m"][-1].tolist() == pytest.approx([-flew.position_m[2], 0.0], abs=1e-9)
    assert rows["climb_mps"][-1, 0] == pytest.approx(-flew.velocity_mps[2], abs=1e-9)
    assert rows["time_s"][-1] == pytest.approx(3.0)


def test_disturbances_act_on_them_from_mission_time(tmp_path: Path) -> None:
    gust = {"kind": "step", "at_s": 1.0, "velocity_mps": [0, 4, 0]}
    sides = []
    for disturbances in ([], [gust]):
        exchanges = [Scripted(FULL), Scripted(FULL)]
        with (
            TruthWriter(tmp_path / "truth", 2) as writer,
            closing(fleet_of(exchanges, writer, disturbances=disturbances)) as fleet,
        ):
            fleet.environment.receive_mission_time(0.0, after(Instant(0), 2.0))
            run_to(fleet, 4.0)
        sides.append(exchanges[0].samples[-1].position_m[1])
    assert sides[1] - sides[0] > 1.0


def test_serial_ports_are_on_the_network(tmp_path: Path) -> None:
    exchanges = [Scripted(FULL), Scripted(FULL)]
    with (
        TruthWriter(tmp_path / "truth", 2) as writer,
        closing(fleet_of(exchanges, writer)) as fleet,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as port,
    ):
        port.bind((LOOPBACK, 0))
        port.settimeout(LIMIT_S)
        fleet.receive([Datagram(1, Address(LOOPBACK, 14551), b"too early")], Instant(0))
        port.sendto(b"from the autopilot", (LOOPBACK, fleet.each[1].port))
        run_to(fleet, CYCLE_S)
        (sent,) = fleet.datagrams_to_send()
        assert (sent.socket, sent.data) == (1, b"from the autopilot")
        assert sent.peer.port == 14551
        fleet.receive([Datagram(1, sent.peer, b"from the station")], Instant(NANOSECONDS))
        assert port.recv(1000) == b"from the station"


def test_one_that_waits_for_a_station_is_shown_where_it_is(tmp_path: Path) -> None:
    """As PX4's link does, which otherwise sends to a port of its own choice."""
    planned = load_scenario(scenario(start={"in_air": False}, vehicles={"count": 2, "autopilot": "arduplane"}))
    with (
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as port,
        TruthWriter(tmp_path / "truth", 2) as writer,
    ):
        port.bind((LOOPBACK, 0))
        port.settimeout(LIMIT_S)
        serial_ports = [port.getsockname()[1], 0]
        fleet = SteppedFleet(fleet_config(planned), [Scripted(FULL), Scripted(FULL)], serial_ports, writer)
        with closing(fleet):
            fleet.begin()
            run_to(fleet, CYCLE_S)
            called, address = port.recvfrom(1000)
            assert called == CALL
            port.sendto(b"from the autopilot", address)
            run_to(fleet, 2 * CYCLE_S)
            port.recv(1000)  # sent before it was read
            run_to(fleet, 5 * CYCLE_S)
            port.setblocking(False)
            with pytest.raises(BlockingIOError):
                port.recv(1000)
            assert [each.data for each in fleet.datagrams_to_send()] == [b"from the autopilot"]


def test_clocks_of_different_steps_stay_together(tmp_path: Path) -> None:
    slow, fast = Scripted(FULL), Scripted(FULL)
    fast.step_s = STEP_S / 2.0
    with TruthWriter(tmp_path / "truth", 2) as writer, closing(fleet_of([slow, fast], writer)) as fleet:
        run_to(fleet, 1.0)
    assert (len(slow.samples), len(fast.samples)) == (400, 800)
    assert slow.samples[-1].position_m == pytest.approx(fast.samples[-1].position_m, abs=0.05)


def test_over_terrain_they_stand_on_it(tmp_path: Path) -> None:
    planned = load_scenario(scenario(start={"in_air": False}, vehicles={"count": 2, "autopilot": "arduplane"}))
    config = fleet_config(planned)
    alt_m = config.origin.alt_m + 120.0
    raised = on_their_ground(config, [HOME._replace(alt_m=alt_m)] * 2)
    exchanges = [Scripted(FULL), Scripted((1500, 1500, 1000, 1500))]
    with (
        TruthWriter(tmp_path / "truth", 2) as writer,
        closing(SteppedFleet(raised, exchanges, [0, 0], writer)) as fleet,
    ):
        fleet.begin()
        run_to(fleet, 3.0)
    rows = TruthRecord(tmp_path / "truth").between(0.0, 3.0)
    assert rows["height_m"][-1, 1] == 120.0
    assert exchanges[1].samples[-1].position_m[2] == 0.0
    assert rows["height_m"][-1, 0] > 124.0
    assert rows["airborne"][-1].tolist() == [1.0, 0.0]


def test_one_that_asks_no_more_is_named(tmp_path: Path) -> None:
    exchanges = [Scripted(FULL), Scripted(FULL, times=10)]
    with TruthWriter(tmp_path / "truth", 2) as writer, closing(fleet_of(exchanges, writer)) as fleet:
        run_to(fleet, 1.0)
        assert fleet.failure == "vehicle 2: its simulator asks for no sensors"
        assert fleet.next_timer() is None


def planned(directory: Path, **keys: Any) -> Path:
    vehicles = [
        {"id": i, "autopilot": "arduplane", "endpoint": f"udpin:127.0.0.1:{port}", "role": role}
        for i, port, role in zip((1, 2), free_ports(2), ("leader", "follower"), strict=True)
    ]
    path = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [1500, 0, 100], [3000, 0, 100]]}
    given = {"vehicles": vehicles, "path": path, "duration_s": 10, "start": {"run_in_s": 20}, "schema": 1}
    (file := directory / "scenario.yaml").write_text(yaml.safe_dump(given | {"name": "stepped"} | keys))
    (program := directory / "arduplane").write_text(f'#!/bin/sh\nexec {sys.executable} {PROGRAM} "$@"\n')
    program.chmod(0o755)
    return file


def flown(file: Path, out: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [*STATION, "run", str(file), "--sitl", f"arduplane={file.parent / 'arduplane'}", "--clock", "virtual"]
    return subprocess.run(
        [*command, "--json", "--out", str(out)],
        env=os.environ | {"SCENARIO": str(file)} | variables,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )


@pytest.mark.slow
def test_flights_repeat_byte_for_byte_over_impaired_links(tmp_path: Path) -> None:
    file = planned(tmp_path, links={"default": {"delay_ms": 150, "jitter_ms": 20, "loss": 0.03}})
    runs = [tmp_path / name for name in ("one", "other")]
    for out in runs:
        done = flown(file, out)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["clock"] == "virtual"
    for name in ("flight.tlog", "timeseries.parquet", "events.jsonl"):
        assert (runs[0] / name).read_bytes() == (runs[1] / name).read_bytes()


def test_a_simulator_that_crashes_is_said_with_what_it_printed(tmp_path: Path) -> None:
    done = flown(planned(tmp_path), tmp_path / "run", ENDS_AT_S="2")
    assert done.returncode == 3
    assert "its simulator has ended: Segmentation fault" in done.stderr
    said = next(each["text"] for each in events_of(tmp_path / "run") if each["kind"] == "simulators")
    assert said.startswith("2 started")


@pytest.mark.slow
def test_a_flight_whose_simulator_crashed_has_a_summary(tmp_path: Path) -> None:
    """It ends with its simulators, so nothing can go on with it as with a flight of `fly`."""
    done = flown(planned(tmp_path), tmp_path / "run", ENDS_AT_S="80")
    assert done.returncode == 3
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert "its simulator has ended: Segmentation fault" in summary["failure"]
    assert pq.read_metadata(tmp_path / "run" / "timeseries.parquet").num_rows > 0


@pytest.mark.slow
def test_a_program_steps_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`Flight`: each tick waits for the program, and with it the autopilots."""
    file = planned(tmp_path)
    monkeypatch.setenv("SCENARIO", str(file))
    with Flight(file, out=tmp_path / "run", sitl={"arduplane": tmp_path / "arduplane"}) as flight:
        for tick in flight:
            if tick.number == 20:
                flight.disturb(velocity_mps=(0.0, 2.0, 0.0), for_s=1.0)
                for _ in range(2):
                    with pytest.raises(ScenarioError, match="found crash of a real autopilot"):
                        flight.inject("crash", 2)
                break
    assert flight.summary.to_dict()["clock"] == "virtual"
    assert tick.time_s > 1.0


def test_faults_that_a_program_injected_are_refused_before_anything_starts(tmp_path: Path) -> None:
    """As recorded in run.yaml: a real autopilot can't repeat them."""
    file = planned(tmp_path, orders=[{"at_tick": 0, "fault": {"kind": "crash", "vehicles": [2], "at_s": 0.0}}])
    done = flown(file, tmp_path / "run")
    assert done.returncode == 2
    assert "orders.0.fault" in done.stderr
    assert not (tmp_path / "run").exists()


def test_one_that_ends_at_once_is_not_waited_for(tmp_path: Path) -> None:
    file = planned(tmp_path)
    (tmp_path / "arduplane").write_text("#!/bin/sh\necho no such model\nexit 1\n")
    done = flown(file, tmp_path / "run")
    assert done.returncode == 3
    assert "its simulator has ended: no such model" in done.stderr


def test_from_python_too_wrong_programs_are_named(tmp_path: Path) -> None:
    file = planned(tmp_path)
    for given, text in (
        ({"sitl": {"arduplane": "nowhere"}}, "found no program nowhere"),
        ({"sitl": {"jsbsim": PROGRAM}}, "found 'jsbsim'; allowed: arducopter, arduplane, px4"),
        ({"sitl": {"arduplane": PROGRAM}, "clock": "real"}, "found with the real clock"),
        ({"sitl": "arduplane=x"}, "found 'arduplane=x'; allowed: paths by family"),
    ):
        with pytest.raises(ValueError, match=text):
            Flight(file, **given)
    with pytest.raises(ValueError, match="found no program nowhere"):
        run(file, sitl={"arduplane": "nowhere"})
