"""The ground station against the real autopilot: two simulated ArduPlanes, through the same start-up as the emulators.

Set ARDUPLANE_SITL to the path of ArduPilot's `arduplane` binary for SITL to run it.
"""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import sys
from collections import Counter
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from pymavlink import mavutil

from airlink import mavlink as m

BINARY = os.environ.get("ARDUPLANE_SITL")
pytestmark = [
    pytest.mark.skipif(not BINARY, reason="ARDUPLANE_SITL isn't set to the path of an arduplane SITL binary"),
    pytest.mark.slow,
]

ROOT = Path(__file__).parents[2]
SPEEDUP = 3
LIMIT_S = 300
FIRST_INSTANCE = 40
"""Its RC input is at UDP port 5501 + 10 times this: away from a simulation that somebody else runs."""
APART_DEG = 0.0006
METRES_A_DEGREE = 111_200.0
APART_M = APART_DEG * METRES_A_DEGREE * math.cos(math.radians(35.0))
MODEL = {
    "tau_v_s": 4.0,
    "tau_psi_s": 3.4,
    "tau_ha_s": 1.5,
    "tau_hb_s": 2.0,
    "speed_min_mps": 14,
    "speed_max_mps": 29,
    "accel_max_mps2": 1.0,
    "turn_rate_max_rps": 0.25,
    "climb_max_mps": 3.0,
}
LAW = {
    "mixer": {"k_v": 0.0},
    "speed": {"kp": 0.15, "ki": 0.01, "kd": 0.0},
    "heading": {"kp": 1.0, "ki": 0.05, "kd": 1.5},
    "height": {"kp": 0.1, "ki": 0.04, "kd": 0.0},
    "anti_windup_s": 20,
    "disturbance_observer_radps": 0.2,
}
PARAMETERS = {
    "AIRSPEED_CRUISE": 22,
    "AIRSPEED_MAX": 30,
    "AIRSPEED_MIN": 10,
    "ARSPD_USE": 1,
    "TRIM_THROTTLE": 50,
    "ROLL_LIMIT_DEG": 65,
    "TKOFF_ALT": 50,
    "WP_LOITER_RAD": 80,
    "RC3_MIN": 1000,
    "RC3_MAX": 2000,
    "RC3_TRIM": 1000,
    "SERVO3_MIN": 1000,
    "SERVO3_MAX": 2000,
    "INS_ACCOFFS_X": 0.001,
    "INS_ACCOFFS_Y": 0.001,
    "INS_ACCOFFS_Z": 0.001,
    "INS_ACCSCAL_X": 1.001,
    "INS_ACCSCAL_Y": 1.001,
    "INS_ACCSCAL_Z": 1.001,
    "INS_ACC2OFFS_X": 0.001,
    "INS_ACC2OFFS_Y": 0.001,
    "INS_ACC2OFFS_Z": 0.001,
    "INS_ACC2SCAL_X": 1.001,
    "INS_ACC2SCAL_Y": 1.001,
    "INS_ACC2SCAL_Z": 1.001,
}
"""The simulator's accelerometers count as calibrated only with offsets that aren't 0."""


def free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


@contextmanager
def simulated(number: int, port: int, directory: Path) -> Generator[None]:
    """Run one ArduPlane as system `number`, some way east of the others."""
    directory.mkdir()
    lines = [f"{name} {value}" for name, value in (PARAMETERS | {"MAV_SYSID": number}).items()]
    (directory / "plane.parm").write_text("\n".join(lines) + "\n")
    command = [str(BINARY), "--model", "plane", "--speedup", str(SPEEDUP), f"-I{FIRST_INSTANCE + number}"]
    command += ["--home", f"35.0,{125.0 + (number - 1) * APART_DEG},0,0", "--defaults", "plane.parm"]
    command += ["--serial0", f"udpclient:127.0.0.1:{port}", "--serial1", "none:0", "--serial2", "none:0"]
    with (directory / "log.txt").open("w") as log:
        process = subprocess.Popen(command, cwd=directory, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            yield
        finally:
            process.terminate()
            process.wait(10)


def scenario(ports: list[int]) -> dict[str, object]:
    return {
        "schema": 1,
        "name": "real",
        "duration_s": 40,
        "start": {"run_in_s": 50, "tolerance_m": 6},
        "vehicles": [
            {
                "id": number,
                "role": "leader" if number == 1 else "follower",
                "autopilot": "arduplane",
                "endpoint": f"udpin:127.0.0.1:{port}",
                "model": MODEL,
            }
            for number, port in enumerate(ports, start=1)
        ],
        "formation": {"shape": "diamond", "spacing_m": 40},
        "law": LAW,
        "path": {"speed_mps": 22, "waypoints_m": [[0, 0, 80], [700, 0, 80], [1400, 150, 85]]},
        "finish": {"loiter_s": 5},
    }


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fly, and return the run directory."""
    return flown(tmp_path_factory.mktemp("real"))


def flown(directory: Path, **changes: object) -> Path:
    """Fly the scenario with keys changed, and return the run directory."""
    ports = free_ports(2)
    file = directory / "real.yaml"
    file.write_text(yaml.safe_dump(scenario(ports) | changes))
    with ExitStack() as stack:
        for number, port in enumerate(ports, start=1):
            stack.enter_context(simulated(number, port, directory / f"plane{number}"))
        command = [sys.executable, "-m", "gcs_formation", "fly", str(file), "--speedup", str(SPEEDUP)]
        command += ["--out", str(directory / "run")]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=LIMIT_S, check=False)
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


def test_every_vehicle_goes_through_take_off_and_guided_to_loiter(run):
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    for vehicle in ("1", "2"):
        modes = [event["text"] for event in events if event["kind"] == "mode" and event.get("vehicle") == vehicle]
        assert modes[-3:] == ["TAKEOFF", "GUIDED", "LOITER"]
    phases = [event["text"] for event in events if event["kind"] == "phase"]
    assert phases == ["assembling", "flying", "ending", "loitering", "done"]


def test_they_land_one_after_another_where_they_took_off(tmp_path):
    run = flown(tmp_path, orders=[{"at_s": 10, "order": "land"}])
    told = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    modes = [(event["vehicle"], event["text"], event["t_s"]) for event in told if event["kind"] == "mode"]
    lands = [(who, at_s) for who, mode, at_s in modes if mode == "AUTOLAND"]
    assert sorted(who for who, _ in lands) == ["1", "2"]
    standing = places_at_the_end(run)
    for number in (1, 2):
        north_m, east_m, height_m, armed = standing[number]
        assert not armed
        assert abs(height_m) < 2.0
        assert math.hypot(north_m, east_m - (number - 1) * APART_M) < 60.0


def places_at_the_end(run: Path) -> dict[int, tuple[float, float, float, bool]]:
    """Return where each vehicle was last told to be, m north, east and up of the first one's home, and if armed."""
    log = mavutil.mavlink_connection(str(run / "flight.tlog"), dialect="ardupilotmega")
    last: dict[int, dict[str, Any]] = {1: {}, 2: {}}
    while (message := log.recv_match(type=["GLOBAL_POSITION_INT", "HEARTBEAT"])) is not None:
        last.get(message.get_srcSystem(), {})[message.get_type()] = message
    log.close()
    found: dict[int, tuple[float, float, float, bool]] = {}
    for number, told in last.items():
        place, beat = told["GLOBAL_POSITION_INT"], told["HEARTBEAT"]
        north_m = (place.lat / 1e7 - 35.0) * METRES_A_DEGREE
        east_m = (place.lon / 1e7 - 125.0) * METRES_A_DEGREE * math.cos(math.radians(35.0))
        found[number] = north_m, east_m, place.relative_alt / 1e3, bool(beat.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
    return found


def test_the_autopilot_refuses_nothing(run):
    counts = acknowledgements(run)
    assert {result for _, result in counts} == {m.MAV_RESULT_ACCEPTED}
    guided = [counts[command, m.MAV_RESULT_ACCEPTED] for command in (43000, 43001, 43002)]
    assert min(guided) > 1000


def test_the_follower_keeps_its_slot(run):
    summary = json.loads((run / "summary.json").read_text())
    follower = summary["followers"]["2"]
    assert follower["error_x_m"]["max"] < 8.0
    assert follower["error_y_m"]["max"] < 4.0
    assert follower["error_z_m"]["max"] < 5.0
    assert summary["safety"]["violations"] == 0


def test_nobody_is_said_to_disobey(run):
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    assert [event for event in events if event["kind"] == "disobeys"] == []
