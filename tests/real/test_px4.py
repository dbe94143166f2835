"""The ground station against the real autopilot: four PX4s, fixed wings and multirotors, flown by its simulator (SIH).

Set PX4_SITL to the path of PX4's binary for SITL, `build/px4_sitl_default/bin/px4`, to run it. Real time: 15 minutes.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import yaml
from pymavlink import mavutil

from airlink import mavlink as m
from airlink.endpoint import parse_endpoint
from gcs_formation.app.sitl.fleet import SIMULATORS
from gcs_formation.app.sitl.simulator import Craft, Home
from tests.processes import events_of, wait_for_event
from tests.real.simulators import ROOT, acknowledgements, command_to_fly, fly, launched, needs

pytestmark = needs("PX4_SITL", "a PX4 SITL binary")

FIRST_INSTANCE = 40
"""Instance n is system n + 1 and listens at UDP port 18570 + n, away from simulations that somebody else runs."""
GCS_PORT, PILOT_PORT = 18570, 14580
APART_DEG, COPTERS_APART_DEG = 0.0006, 0.0001
BOOT_S = 8.0
PARAMETERS = {"SIH_T_MAX": 10, "FW_AIRSPD_MAX": 22, "FW_AIRSPD_TRIM": 14, "SDLOG_MODE": -1}
"""With its default thrust of 6 N the simulator's aircraft hardly exceeds 14 m/s."""


COPTERS_PARAMETERS = {"NAV_DLL_ACT": 2, "SDLOG_MODE": -1}


@contextmanager
def simulated(instance: int, directory: Path, *, hovers: bool = False) -> Generator[subprocess.Popen[bytes]]:
    """Run one PX4, some distance east of the others; the field is at 10 m."""
    east_deg = (instance - FIRST_INSTANCE) * (COPTERS_APART_DEG if hovers else APART_DEG)
    station = parse_endpoint(f"udpout:127.0.0.1:{GCS_PORT + instance}")
    home, parameters = Home(35.0, 125.0 + east_deg, 10.0), COPTERS_PARAMETERS if hovers else PARAMETERS
    craft = Craft(instance + 1, instance, home, station, hovers, parameters=parameters)
    program = Path(os.environ["PX4_SITL"]).resolve()
    with launched(SIMULATORS["px4"].launch(program, craft), directory) as process:
        yield process


def scenario(count: int, config: str = "px4") -> dict[str, object]:
    """Return the shipped scenario with each vehicle at the port of its own simulation."""
    keys = yaml.safe_load((ROOT / "configs" / f"{config}.yaml").read_text())
    keys["vehicles"] = [
        each | {"id": 1 + instance, "endpoint": f"udpout:127.0.0.1:{GCS_PORT + instance}"}
        for instance, each in enumerate(keys["vehicles"][:count], start=FIRST_INSTANCE)
    ]
    return keys


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fly, and return the run directory."""
    directory = tmp_path_factory.mktemp("px4")
    with ExitStack() as stack:
        for instance in range(FIRST_INSTANCE, FIRST_INSTANCE + 4):
            stack.enter_context(simulated(instance, directory / f"plane{instance}"))
        time.sleep(BOOT_S)
        done = fly(directory, scenario(4))
    assert done.returncode == 0, done.stderr
    return directory / "run"


def test_every_vehicle_goes_through_take_off_to_hold(run):
    told = events_of(run)
    for vehicle in map(str, range(FIRST_INSTANCE + 1, FIRST_INSTANCE + 5)):
        modes = [event["text"] for event in told if event["kind"] == "mode" and event.get("vehicle") == vehicle]
        assert modes[-2:] == ["TAKEOFF", "HOLD"]
    phases = [event["text"] for event in told if event["kind"] == "phase"]
    assert phases == ["assembling", "flying", "ending", "loitering", "done"]


def test_the_autopilots_refuse_nothing(run):
    counts = acknowledgements(run)
    assert {result for _, result in counts} == {m.MAV_RESULT_ACCEPTED}
    assert counts[m.MAV_CMD_DO_REPOSITION, m.MAV_RESULT_ACCEPTED] > 4000


def test_three_followers_keep_their_slots_to_2_m(run):
    summary = json.loads((run / "summary.json").read_text())
    assert len(summary["followers"]) == 3
    for follower in summary["followers"].values():
        assert max(follower[axis]["rms"] for axis in ("error_x_m", "error_y_m", "error_z_m")) <= 2.0
    assert summary["safety"]["violations"] == 0


def test_identify_finds_in_the_flight_what_the_shipped_model_says(run, tmp_path):
    command = (
        sys.executable,
        "-m",
        "gcs_formation",
        "identify",
        str(run),
        "--out",
        str(tmp_path / "found.yaml"),
        "--json",
    )
    found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout)
    assert found["lags"]["prompt_share"]["value"] == pytest.approx(0.55, abs=0.15)
    assert found["lags"]["tau_psi_s"]["value"] == pytest.approx(1.3, abs=0.4)


def test_a_pilot_takes_over_with_another_mode_and_gives_back_with_hold(tmp_path):
    """Each setpoint commands Hold: RTL would otherwise last for a tenth of a second."""
    follower, run = FIRST_INSTANCE + 2, tmp_path / "run"
    with ExitStack() as stack:
        for instance in (FIRST_INSTANCE, FIRST_INSTANCE + 1):
            stack.enter_context(simulated(instance, tmp_path / f"plane{instance}"))
        time.sleep(BOOT_S)
        flight = stack.enter_context(subprocess.Popen(command_to_fly(tmp_path, scenario(2)), cwd=ROOT))
        stack.callback(flight.send_signal, signal.SIGINT)
        wait_for_event(run, "flying in formation", vehicle=str(follower))
        pilot = mavutil.mavlink_connection(f"udpout:127.0.0.1:{PILOT_PORT + FIRST_INSTANCE + 1}", source_system=254)
        for sub_mode, mode, member in ((5, "RTL", "parted by its pilot"), (3, "HOLD", "flying in formation")):
            count = len(events_of(run))
            pilot.mav.heartbeat_send(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
            pilot.mav.command_long_send(follower, 1, m.MAV_CMD_DO_SET_MODE, 0, 1, 4, sub_mode, 0, 0, 0, 0)
            wait_for_event(run, mode, count, kind="mode", vehicle=str(follower))
            wait_for_event(run, member, count, vehicle=str(follower))
            time.sleep(5.0)
            modes = [each["text"] for each in events_of(run) if each["kind"] == "mode"]
            assert modes[-1] == mode
        pilot.close()


@contextmanager
def multirotors(directory: Path) -> Generator[list[subprocess.Popen[bytes]]]:
    """Run four."""
    instances = range(FIRST_INSTANCE, FIRST_INSTANCE + 4)
    with ExitStack() as stack:
        places = {each: directory / f"copter{each}" for each in instances}
        started = [stack.enter_context(simulated(each, places[each], hovers=True)) for each in instances]
        time.sleep(BOOT_S)
        yield started


def test_four_multirotors_keep_their_slots_through_stops_and_changes(tmp_path):
    with multirotors(tmp_path):
        done = fly(tmp_path, scenario(4, "px4_copter"))
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert len(summary["followers"]) == 3
    for follower in summary["followers"].values():
        assert max(follower[axis]["rms"] for axis in ("error_x_m", "error_y_m", "error_z_m")) <= 0.8
    assert summary["safety"]["violations"] == 0


def test_a_px4_multicopter_is_refused_before_anything_is_armed(tmp_path):
    with ExitStack() as stack:
        stack.enter_context(simulated(FIRST_INSTANCE, tmp_path / "plane"))
        stack.enter_context(simulated(FIRST_INSTANCE + 1, tmp_path / "copter", hovers=True))
        time.sleep(BOOT_S)
        done = fly(tmp_path, scenario(2))
    assert done.returncode == 3
    assert f"vehicle {FIRST_INSTANCE + 2} says that it is a PX4 QUADROTOR; allowed: PX4 fixed wing" in done.stderr
    log = mavutil.mavlink_connection(str(tmp_path / "run" / "flight.tlog"), dialect="ardupilotmega")
    while (message := log.recv_match(type=["COMMAND_LONG", "HEARTBEAT"])) is not None:
        assert message.get_type() != "COMMAND_LONG" or message.command == m.MAV_CMD_SET_MESSAGE_INTERVAL
        assert message.get_type() != "HEARTBEAT" or not message.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED
    log.close()
